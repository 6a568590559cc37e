//! The program `mortise`: the window and the commands.
//!
//! Layers, each of which imports only earlier ones: [`folder_cache`] keeps results of bakes; [`kept`] what the user has done; [`display`] prepares parts for
//! display; [`session`] is the window's state and does not depend on the window; [`cut`] is the section view's; [`viewport`] draws the parts; [`ui`]
//! draws the rest; [`cli`] is the command line, and the whole program in a build without the feature `window`.

pub mod cli;
#[cfg(feature = "window")]
pub mod cut;
#[cfg(feature = "window")]
pub mod display;
pub mod folder_cache;
#[cfg(feature = "window")]
pub mod kept;
mod kept_model;
#[cfg(feature = "window")]
pub mod session;
#[cfg(feature = "window")]
pub mod ui;
#[cfg(feature = "window")]
pub mod viewport;
