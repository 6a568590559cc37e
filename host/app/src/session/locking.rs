//! Parts locked to the ground, and parts let free: what is locked is fixed where it is, and everything else may be grabbed. A change bakes the scene again.

use std::sync::Arc;

use super::state::Session;

impl Session {
    /// Why a part cannot be locked, or let free, now, as a sentence.
    pub(super) fn no_locking(&self, part: usize, locks: bool) -> Option<String> {
        let no = |reason: &str| Some(reason.to_owned());
        let Some(document) = &self.document else {
            return no("No file is open");
        };
        if part >= document.poses.len() {
            return no("Select a part first");
        }
        if let Some(reason) = self.no_move().or(self.no_other_bake()) {
            return no(reason);
        }
        let grouped = &document.grouped;
        let locked = grouped.locking(part, locks);
        if locked.len() == document.poses.len() {
            return no("One part at the least must be free");
        }
        (grouped.is_locked(part) == locks).then(|| {
            let state = if locks {
                "is locked already"
            } else {
                "is free already"
            };
            format!("{} {state}", document.moving_name(part))
        })
    }

    pub(super) fn lock(&mut self, part: usize, locks: bool) {
        let Some(document) = &mut self.document else {
            return;
        };
        let locked = document.grouped.locking(part, locks);
        document.grouped = Arc::new(document.grouped.with_locked(Some(locked)));
        self.verdict = None;
        self.bake();
    }
}
