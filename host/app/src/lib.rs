//! The program `mortise`: the window, the commands, and the state both share.
//!
//! [`session`] holds everything that happens and knows no window; [`ui`] draws it; [`viewport`] draws the parts; [`cli`] is the
//! same without a window.

pub mod cli;
pub mod session;
pub mod ui;
pub mod viewport;
