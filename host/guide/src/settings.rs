//! How targets are found and sent.

/// Condition under which a target may engage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum When {
    /// Its faces touch, as reported by the board: guidance pulls nothing in from a distance.
    #[default]
    Touching,
    /// Surfaces that could mate are aligned and at most [`GuideSettings::approach_mm`] apart.
    Near,
}

impl When {
    /// All values.
    pub const ALL: [Self; 2] = [Self::Touching, Self::Near];

    /// Name of the value in figures.
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
    /// Whether targets are sent; they are recognised in any case.
    pub sending: bool,
    /// Whether mating surfaces are recognised; fits that are followed guide in any case.
    pub recognising: bool,
    /// Condition under which a target may engage.
    pub when: When,
    /// k_g, N/m.
    pub stiffness_n_per_m: f32,
    /// F_g, N.
    pub force_cap_n: f32,
    /// Cap on the torque, N m.
    pub torque_cap_nm: f32,
    /// Time after its last refresh at which a target fades, ticks.
    pub expiry_ticks: u16,
    /// An active target stays while the surfaces overlap along the axis by more than this, mm (negative: a gap).
    pub near_mm: f64,
    /// Largest gap along the axis at which [`When::Near`] engages a target, mm.
    pub approach_mm: f64,
}

impl Default for GuideSettings {
    /// A cap well below the coupling's 10 N; an expiry of 0.3 s.
    fn default() -> Self {
        Self {
            sending: true,
            recognising: true,
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
