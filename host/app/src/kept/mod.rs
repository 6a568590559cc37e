//! What is kept from one start to the next: preferences and recent files. Files of a folder, each written all or nothing.

mod folder;
mod preferences;
mod recent;

pub use self::folder::{StateFolder, read};
pub use self::preferences::Preferences;
pub use self::recent::{MOST_RECENT, Recent};
