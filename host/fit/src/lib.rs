//! Fit finder: the poses at which two solids fit, for any shapes, and the way in.
//!
//! [`find`] needs no names of faces and no preset constraints. Candidate poses come from the placement in the assembly and from equal parts of it
//! (`find`), from planes, axes and centres that can face each other (`rotations`, `translations`), and from points of equal curvature on free-form
//! faces (`frames`). They are rated by samples (`screen`), the best are refined on the exact surfaces until the gap is as uniform as it can be
//! (`refine`), and what overlaps, or does not hold the part, is left out (`mobility`). `path` then finds how each fit is reached.
//!
//! Units: millimetres and radians. Frames: the assembly's for what is returned; inside, the fixed part's own.
//!
//! Source of the problem: M. Behandish, H. Ilieş, *Peg-in-Hole Revisited*, JCISE 2015: no recognised features, shape complementarity alone. Their
//! correlation of densities is not used: it is tens of micrometres off in a 20 µm fit.

mod error;
mod facets;
mod find;
mod frames;
mod gaps;
mod hit;
mod mobility;
mod path;
mod refine;
mod rotations;
mod screen;
mod solid;
mod translations;

pub use error::FitError;
pub use find::{Clearance, Fit, FitOptions, Fits, find, part_named};
pub use path::{Path, PathKind};
