//! How targets are found and sent.

/// When a target may be taken up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum When {
    /// Once faces touch, which the board tells: nothing is pulled in from afar.
    #[default]
    Touching,
    /// As soon as surfaces that could mate are lined up and [`GuideSettings::approach_mm`] apart.
    Near,
}

impl When {
    /// All.
    pub const ALL: [Self; 2] = [Self::Touching, Self::Near];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Touching => "when touching",
            Self::Near => "when near",
        }
    }
}

/// How targets are found and sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideSettings {
    /// Whether targets are sent at all; recognised they are in any case.
    pub sending: bool,
    /// When a target may be taken up.
    pub when: When,
    /// k_g, N/m.
    pub stiffness_n_per_m: f32,
    /// F_g, N.
    pub force_cap_n: f32,
    /// The same of torques, N m.
    pub torque_cap_nm: f32,
    /// A target fades this long after its last refresh, ticks.
    pub expiry_ticks: u16,
    /// A target taken up stays while the surfaces' extents along the axis overlap by more than this, mm (negative: a gap).
    pub near_mm: f64,
    /// Largest gap along the axis at which [`When::Near`] takes a target up, mm.
    pub approach_mm: f64,
}

impl Default for GuideSettings {
    /// A cap well below the coupling's 10 N; an expiry of 0.3 s.
    fn default() -> Self {
        Self {
            sending: true,
            when: When::default(),
            stiffness_n_per_m: 1e6,
            force_cap_n: 3.0,
            torque_cap_nm: 0.1,
            expiry_ticks: 300,
            near_mm: -0.5,
            approach_mm: 2.0,
        }
    }
}
