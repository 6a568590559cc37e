//! Which parts are seen in the view. A hidden part still collides.

use super::state::Session;

impl Session {
    pub(super) fn hide(&mut self, part: usize, hidden: bool) {
        let document = self.document.as_mut();
        if let Some(place) = document.and_then(|d| d.hidden.get_mut(part)) {
            *place = hidden;
        }
    }

    /// Hides all parts but this one, those selected with it, and the held ones.
    pub(super) fn isolate(&mut self, part: usize) {
        let count = self.document.as_ref().map_or(0, |document| document.hidden.len());
        if part >= count {
            return;
        }
        let with_selection = self.is_selected(part);
        let is_seen =
            |other| other == part || self.is_held(other) || with_selection && self.is_selected(other);
        let hidden = (0..count).map(|other| !is_seen(other)).collect();
        if let Some(document) = &mut self.document {
            document.hidden = hidden;
        }
    }

    pub(super) fn show_all(&mut self) {
        if let Some(document) = &mut self.document {
            document.hidden.fill(false);
        }
    }
}
