//! What programs write: files where a user says ([`Output`], [`Folder`]), results in [`lines`], and how a [`program`] ends.

mod error;
mod folder;
pub mod lines;
mod output;
pub mod program;
mod same;

pub use error::OutputError;
pub use folder::Folder;
pub use output::{Existing, Output};
