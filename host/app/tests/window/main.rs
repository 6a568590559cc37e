//! Tests of the window, a module for each of its parts: one program, because linking the window takes longer than most of the tests.

mod analyse;
mod clearances;
mod command_line;
mod common;
mod connecting;
mod connections;
#[cfg(target_os = "linux")]
mod desktop_theme;
mod energy;
mod firmware;
mod fits;
mod flow;
mod fonts;
mod getting_started;
mod grouping;
mod groups;
mod guidance;
mod joints;
mod kept;
mod layout;
#[cfg(unix)]
mod link_loss;
mod locking;
mod margin;
mod measure;
mod mechanism;
mod moving;
mod page;
mod picture;
mod playback;
mod plots;
mod project;
mod reach;
mod recording;
mod rig_page;
mod said_once;
mod section_view;
mod sequence;
#[cfg(unix)]
mod space_mouse;
mod views;
mod visibility;
