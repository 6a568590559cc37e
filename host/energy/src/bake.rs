//! From two densities and a way to an energy for an image.

use crate::baked::{BakedEnergy, Way, best};
use crate::density::Density;
use crate::stiffness::majorise;

/// Makes the energy of a moving part in a fixed one's density along a way. `None` where the two have no density for each other.
///
/// Where a minimum is, a few hundred places leave to chance: of several sets the one is kept whose minima are least off the way. Cost: 5 to 25 s on two
/// cores, most of it densities.
pub fn bake(moving: &Density, fixed: &Density, way: &Way<'_>) -> Option<BakedEnergy> {
    let mut energy = best(moving, fixed, way)?;
    majorise(&mut energy, way, moving.center_of_mass());
    Some(energy)
}
