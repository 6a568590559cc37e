//! Assembly by task: contacts, freedoms, ports, and collision-free sequences with their clearances.
mod assembly;
mod body;
mod clearance;
pub mod cone;
pub mod directions;
mod error;
pub mod mobility;
mod motion;
pub mod removal;
pub use assembly::*;
pub use body::*;
pub use clearance::*;
pub use error::*;
pub use motion::*;
