//! The program `mortise`: the window, the commands, and the state both share.
//!
//! [`session`] holds everything that happens and knows no window; [`ui`] draws it; [`viewport`] draws the parts; [`cli`] is the
//! same without a window, and all that a build without the feature `window` has.

pub mod cli;
#[cfg(feature = "window")]
pub mod session;
#[cfg(feature = "window")]
pub mod ui;
#[cfg(feature = "window")]
pub mod viewport;
