//! The program `mortise`: the window, the commands, and the state that both share.
//!
//! [`session`] holds the state and does not depend on the window; [`ui`] draws it; [`viewport`] draws the parts; [`cli`] is the same without a
//! window, and the whole program in a build without the feature `window`.

pub mod cli;
pub mod folder_cache;
mod kept_model;
#[cfg(feature = "window")]
pub mod session;
#[cfg(feature = "window")]
pub mod ui;
#[cfg(feature = "window")]
pub mod viewport;
