//! STEP files to parts, faces, edges and tessellation: the only crate that uses the CAD kernel.
//!
//! [`load_step`] gives a [`CadModel`] of plain values in millimetres and radians. The text is checked and rewritten here first (`part21`), then read
//! by OpenCASCADE behind one thin bridge (`kernel`), in a separate process (`child`), so that neither a crash, a hang nor excessive memory use of the
//! kernel affects the program. Losses of the import are reported: an error when a solid is missing, a warning otherwise.
//!
//! Programs call [`child::init`] first in `main`.
//!
//! ```no_run
//! fn main() -> Result<(), mortise_brep::BrepError> {
//!     mortise_brep::child::init();
//!     let model = mortise_brep::load_step("pair.step")?;
//!     for part in &model.parts {
//!         println!("{}: {:.1} mm³", part.name, model.shapes[part.shape].volume_mm3);
//!     }
//!     Ok(())
//! }
//! ```

mod assemble;
pub mod child;
mod error;
mod external;
mod free_form;
mod kernel;
mod load;
mod machine;
mod model;
mod options;
pub mod oracle;
mod part21;
mod progress;
mod question;
mod recognise;
mod recognise_curve;
mod shape;
mod topology;
pub mod write;

pub use error::BrepError;
pub use load::{load_step, load_step_while, load_step_with};
pub use model::*;
pub use options::{LoadOptions, set_time_limit_s};
