//! Energy of a pair of parts as a board takes it: a few hundred charges of the moving part in a coarse lattice of the fixed one's density.
//!
//! Three things differ from [`crate::Pair`], because the published form does not guide where it is needed ([`crate`]):
//!
//! * **Without planes.** The density beside a plane, which does not fade with the distance, is subtracted on either side: flat faces no longer draw each other.
//! * **Strongest places.** Of the places in and around the moving part those with the largest density are kept, near the faces that mate.
//! * **Fitted charges.** The energy is linear in the charges at these places. Instead of the densities there, they are those of least size (ridge regression)
//!   with which displacements to either side of the way cost the same, the energy falls evenly from zero, where the way begins in the open, to its depth at the
//!   fit, and beside the way rises as 1 − 1/√(1 + (d/r)² + (φ·L/r)²), L the extent of where it acts. The way comes from exact surfaces: they place the
//!   minimum, the density gives the functions of which the well is made. Densities as charges, as published, contribute nothing to such a well: what they
//!   are scaled by in the best fit is zero for most pairs. Where the fitted energy has its minimum off the way, or does not rise back along it or aside of the
//!   mouth, those places are added and it is fitted again.
//!
//! Besides, the baker samples by how much the energy at a displaced pose exceeds its linear model, and states a stiffness that majorises it, for each depth: what
//! the board's implicit step needs.

use glam::{DAffine3, DVec3};
use mortise_protocol::image::{ChargeRecord, Energy, EnergyRecord};

use crate::minimum::{Start, TILT_ARM_MM};

/// Margin about the moving part in which it has charges, mm.
pub(crate) const MARGIN_MM: f64 = 4.0;
/// Travel beyond the way's begin over which the energy rises to zero, mm, and the part of it over which it is fitted.
pub(crate) const BEYOND_MM: f64 = 12.0;
const FITTED_BEYOND_MM: f64 = 8.0;
/// Largest displacement beside the way for which the energy is fitted, mm.
pub(crate) const ASIDE_MM: f64 = 5.0;
/// r: displacement across the way at which the energy has risen by 0.3 of its depth there, mm.
pub(crate) const WIDTH_MM: f64 = 1.5;
/// Steps from one place of the way to the next, mm.
const PLACE_STEP_MM: f64 = 0.53;
/// How finely [`BakedEnergy::minimum`] is looked for, mm.
const FINE_MM: f64 = 1e-3;
/// Lengths in the image are in metres.
pub(crate) const M_PER_MM: f64 = 1e-3;

/// The motion by which the moving part reaches its fit, relative to the fixed part.
pub struct Way<'a> {
    /// Its length from the fit to the open, mm.
    pub length_mm: f64,
    /// Corners of the box, moving part's frame, about which it has charges, mm: that of its mating faces.
    pub mating: [DVec3; 2],
    /// Unit vector out of the fit along the way, or along a screw's axis; fixed part's frame.
    pub outward: DVec3,
    /// Pose of the moving part in the fixed one's frame (mm) at a travel from the fit, mm; defined beyond the length, too.
    pub pose: &'a (dyn Fn(f64) -> DAffine3 + Sync),
}

impl Way<'_> {
    /// Travel from the fit to where the fit of the charges ends, mm.
    pub(crate) fn fitted_mm(&self) -> f64 {
        self.length_mm + FITTED_BEYOND_MM
    }

    /// Depth of the wanted energy at a travel from the fit: 1 there, 0 from [`BEYOND_MM`] beyond the way's begin on.
    pub(crate) fn height(&self, travel_mm: f64) -> f64 {
        let whole = self.length_mm + BEYOND_MM;
        ((whole - travel_mm) / whole).max(0.0)
    }
}

/// An energy that is ready for an image.
#[derive(Clone, Debug)]
pub struct BakedEnergy {
    /// Its record; the numbers of parts, nodes and charges are zero until it is in an image.
    pub record: EnergyRecord,
    /// Charges.
    pub charges: Vec<ChargeRecord>,
    /// Nodes of its lattice, x fastest.
    pub nodes: Vec<[i8; 2]>,
    /// Root mean square deviation from the intended energy beside the way, over the depth.
    pub deviation: f64,
}

/// What a pose costs, over the depth, and its gradient: along x, y, z (1/mm) and about the axes through a point (1/rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Energy.
    pub energy: f64,
    /// Its derivatives by translation.
    pub slope: DVec3,
    /// Its derivatives by rotation.
    pub turn: DVec3,
}

impl BakedEnergy {
    /// Middle of the charges, moving part's frame, mm.
    pub fn middle(&self) -> DVec3 {
        let places = self
            .charges
            .iter()
            .map(|charge| DVec3::from_array(charge.at.map(f64::from)));
        places.sum::<DVec3>() / (M_PER_MM * self.charges.len().max(1) as f64)
    }

    /// Distance across the way (mm) and tilt (rad) of the least energy near a pose, which stays where it is along the way and in spin about it; by steps along the
    /// coordinates, from half a millimetre down to a micrometre.
    pub fn minimum(&self, pose: &DAffine3) -> (f64, f64) {
        let way = DVec3::from_array(self.record.way.map(f64::from));
        let start = Start::new(*pose, way, pose.transform_point3(self.middle()));
        let at = start.lowest(|pose| self.at(pose, DVec3::ZERO).energy, FINE_MM);
        (at[0].hypot(at[1]), at[2].hypot(at[3]) / TILT_ARM_MM)
    }

    /// Energy as the board computes it, before its sums; `about` is the point in the fixed part's frame (mm) that rotations are about.
    pub fn at(&self, pose: &DAffine3, about: DVec3) -> Cost {
        let Some(energy) = Energy::new(&self.record, &self.charges, &self.nodes) else {
            return Cost::default();
        };
        let mut cost = Cost::default();
        for charge in &self.charges {
            let at = DVec3::from_array(charge.at.map(f64::from)) / M_PER_MM;
            let Some((place, value, slope)) = look(&energy, pose, at, charge.charge) else {
                continue;
            };
            cost.energy -= value;
            cost.slope -= slope;
            cost.turn -= (place - about).cross(slope);
        }
        cost
    }
}

/// Place of a charge, Re(ρ·q) there and its gradient, 1/mm.
fn look(energy: &Energy<'_>, pose: &DAffine3, at: DVec3, charge: [f32; 2]) -> Option<(DVec3, f64, DVec3)> {
    let place = pose.transform_point3(at);
    let step = f64::from(energy.record.step);
    let origin = DVec3::from_array(energy.record.origin.map(f64::from));
    let (value, slope) = energy.at(((place * M_PER_MM - origin) / step).as_vec3().to_array(), charge)?;
    let slope = DVec3::from_array(slope.map(f64::from)) * (M_PER_MM / step);
    Some((place, f64::from(value), slope))
}

/// Travels from the fit to where the fit of the charges ends, mm.
pub(crate) fn travels(way: &Way<'_>) -> Vec<f64> {
    let last = way.fitted_mm();
    let count = (last / PLACE_STEP_MM).ceil().clamp(20.0, 120.0) as usize;
    (0..=count).map(|i| last * i as f64 / count as f64).collect()
}

/// 1 − 1/√(1 + x²): the wanted rise beside the way at x times r, over the depth there.
pub(crate) fn rise(x: f64) -> f64 {
    1.0 - 1.0 / (1.0 + x * x).sqrt()
}

/// Numbers from −1 to 1, the same in every run.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}
