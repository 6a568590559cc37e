//! The selected parts: one that keys, handles and panels act on, and others beside it, to be grouped or hidden with it.

use super::state::Session;

impl Session {
    /// Whether a part is selected, as the first one or beside it.
    pub fn is_selected(&self, part: usize) -> bool {
        self.selected == Some(part) || self.also_selected.contains(&part)
    }

    /// All selected parts, ascending.
    pub fn selection(&self) -> Vec<usize> {
        let mut parts: Vec<usize> = self.also_selected.iter().copied().collect();
        parts.extend(self.selected);
        parts.sort_unstable();
        parts
    }

    /// Selects this part alone, or none.
    pub(super) fn select(&mut self, part: Option<usize>) {
        self.selected = part;
        self.also_selected.clear();
    }

    /// Selects these parts, the first one to act on.
    pub(super) fn select_these(&mut self, parts: &[usize]) {
        self.select(parts.first().copied());
        self.also_selected = parts.iter().skip(1).copied().collect();
        self.also_selected.retain(|part| Some(*part) != self.selected);
    }

    /// Adds parts to the selection, or takes them out of it where all of them are in it.
    pub(super) fn select_also(&mut self, parts: &[usize]) {
        let before = self.selection();
        if parts.iter().all(|part| before.contains(part)) {
            let left: Vec<usize> = before.into_iter().filter(|part| !parts.contains(part)).collect();
            let first = self.selected.filter(|part| left.contains(part));
            let others = left.iter().copied().filter(|part| Some(*part) != first);
            let left: Vec<usize> = first.into_iter().chain(others).collect();
            self.select_these(&left);
        } else {
            // What was added last is acted on.
            let all: Vec<usize> = parts.iter().copied().chain(before).collect();
            self.select_these(&all);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn parts_are_added_and_taken_out() {
        let mut session = Session::new(Arc::new(|| {}));
        let now = |session: &Session| (session.selected, session.selection());
        session.select(Some(4));
        session.select_also(&[1]);
        assert_eq!(now(&session), (Some(1), vec![1, 4]));
        session.select_also(&[1, 2]);
        assert_eq!(now(&session), (Some(1), vec![1, 2, 4]));
        session.select_also(&[1]);
        assert_eq!(now(&session), (Some(2), vec![2, 4]));
        session.select_also(&[2, 4]);
        assert_eq!(now(&session), (None, vec![]));
        session.select_these(&[3, 5, 3]);
        assert_eq!(now(&session), (Some(3), vec![3, 5]));
        session.select(None);
        assert!(!session.is_selected(3) && !session.is_selected(5));
    }
}
