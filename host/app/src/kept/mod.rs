//! What is kept from one start to the next: preferences, recent files, projects. Files of a folder, each written all or nothing.

mod folder;
mod mark;
mod preferences;
pub mod project;
mod recent;
pub mod view;

pub use self::folder::{ENDING as PROJECT_ENDING, StateFolder, read, set_aside};
pub use self::mark::{Mark, left_open};
pub use self::preferences::Preferences;
pub use self::recent::{MOST_RECENT, Recent};
