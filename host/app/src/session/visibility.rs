//! Which parts are seen in the view. A hidden part still collides.

use super::state::Session;

impl Session {
    pub(super) fn hide(&mut self, part: usize, hidden: bool) {
        let document = self.document.as_mut();
        if let Some(place) = document.and_then(|d| d.hidden.get_mut(part)) {
            *place = hidden;
        }
    }

    /// Hides all parts but this one and the held one.
    pub(super) fn isolate(&mut self, part: usize) {
        let held = self.grabbed();
        let Some(document) = &mut self.document else {
            return;
        };
        if part >= document.hidden.len() {
            return;
        }
        for (index, hidden) in document.hidden.iter_mut().enumerate() {
            *hidden = index != part && Some(index) != held;
        }
    }

    pub(super) fn show_all(&mut self) {
        if let Some(document) = &mut self.document {
            document.hidden.fill(false);
        }
    }
}
