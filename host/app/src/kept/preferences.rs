//! What the user prefers: how the window looks, and the files opened last.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::folder::{StateFolder, read};
use super::recent::Recent;

/// Version of the file. A change that older programs cannot read increments it.
const VERSION: u32 = 1;

/// What the user prefers. A field that a file lacks has its default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Preferences {
    version: u32,
    /// Size of the window, points.
    pub window: Option<[f32; 2]>,
    /// Keys of the signals in the plots; `None`: those of the start.
    pub signals: Option<Vec<String>>,
    /// Whether sections are open that were opened or folded, by name.
    pub open: BTreeMap<String, bool>,
    /// The files opened last.
    pub recent: Recent,
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            version: VERSION,
            window: None,
            signals: None,
            open: BTreeMap::new(),
            recent: Recent::default(),
        }
    }
}

impl Preferences {
    /// Reads the contents of a file.
    ///
    /// # Errors
    /// One line without the file's name: what is wrong.
    pub fn from_json(bytes: &[u8]) -> anyhow::Result<Self> {
        let mut read: Self = serde_json::from_slice(bytes)?;
        anyhow::ensure!(
            read.version <= VERSION,
            "it is of a newer version of this program ({} after {VERSION})",
            read.version
        );
        read.version = VERSION;
        read.window = (read.window).filter(|size| size.iter().all(|x| (100.0..=20_000.0).contains(x)));
        read.recent = read.recent.tidied();
        Ok(read)
    }

    /// Those in a folder, if they are there and sound.
    pub fn of(folder: &StateFolder) -> Option<Self> {
        Self::from_json(&read(&folder.preferences()).ok()??).ok()
    }

    /// The contents of a file.
    pub fn to_json(&self) -> String {
        // Numbers and text only: this cannot fail.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use super::*;

    fn some() -> Preferences {
        let mut some = Preferences {
            window: Some([1280.0, 800.0]),
            signals: Some(vec!["points".into(), "loop_cost".into()]),
            open: BTreeMap::from([("Contact".into(), false)]),
            ..Preferences::default()
        };
        some.recent.opened(Path::new("/a b.step"));
        some
    }

    #[test]
    fn preferences_come_back() {
        let back = Preferences::from_json(some().to_json().as_bytes()).expect("its own");
        assert_eq!(back, some());
        let empty = Preferences::from_json(b"{}").expect("all by default");
        assert_eq!(empty, Preferences::default());
        let newer = Preferences::from_json(br#"{"version": 9}"#).expect_err("newer");
        assert!(newer.to_string().contains("newer"), "{newer}");
    }

    #[test]
    fn a_window_of_no_size_is_left_out() {
        for window in ["[0.0, 500.0]", "[1e30, 800.0]", "null"] {
            let text = format!(r#"{{"window": {window}}}"#);
            let read = Preferences::from_json(text.as_bytes()).expect("read");
            assert_eq!(read.window, None, "{window}");
        }
    }

    proptest! {
        #[test]
        fn damaged_preferences_do_not_panic(at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<bool>()) {
            let mut bytes = some().to_json().into_bytes();
            let at = at.index(bytes.len());
            bytes[at] = byte;
            if cut {
                bytes.truncate(at);
            }
            let _ = Preferences::from_json(&bytes);
        }
    }
}
