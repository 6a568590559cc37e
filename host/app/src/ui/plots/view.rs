//! What the plots show: which signals, over which time, held still or live, and the time under the pointer.

use std::ops::RangeInclusive;

use crate::session::history::{Quantity, SIGNALS, Signal};

/// Spans that can be shown, s.
const SPANS_S: RangeInclusive<f64> = 0.05..=1_200.0;
/// Span at the start, s.
const SPAN_S: f64 = 10.0;
/// Signals at the start.
const CHOSEN: [&str; 5] = [
    "contact_force_n",
    "handle_force_n",
    "contact_torque_mnm",
    "handle_torque_mnm",
    "loop_cost",
];

/// What the plots show.
#[derive(Clone, Debug)]
pub struct View {
    /// For each of [`SIGNALS`].
    chosen: Vec<bool>,
    span_s: f64,
    /// Right end, s, while it is held still; live otherwise.
    held_s: Option<f64>,
    oldest_s: f64,
    newest_s: f64,
    pointed_s: Option<f64>,
    /// Length of the recorded run that is shown, and the present time in it, s.
    run_s: Option<[f64; 2]>,
}

impl Default for View {
    fn default() -> Self {
        let mut view = Self {
            chosen: Vec::new(),
            span_s: SPAN_S,
            held_s: None,
            oldest_s: 0.0,
            newest_s: 0.0,
            pointed_s: None,
            run_s: None,
        };
        view.choose(CHOSEN);
        view
    }
}

impl View {
    /// Shows all of a recorded run when it is opened, and the newest samples when it is closed.
    pub(super) fn show_run(&mut self, run_s: Option<[f64; 2]>) {
        let length = |run: Option<[f64; 2]>| run.map(|[duration, _]| duration);
        let before = std::mem::replace(&mut self.run_s, run_s);
        if length(before) == length(run_s) {
            return;
        }
        self.reset();
        if let Some(duration) = length(run_s) {
            self.span_s = duration.clamp(*SPANS_S.start(), *SPANS_S.end());
        }
    }

    /// The present time in the recorded run that is shown, s.
    pub(super) fn mark_s(&self) -> Option<f64> {
        self.run_s.map(|[_, at]| at)
    }

    /// Takes the times of the oldest and the newest sample, s.
    pub(super) fn follow(&mut self, ends_s: Option<[f64; 2]>) {
        [self.oldest_s, self.newest_s] = ends_s.unwrap_or_default();
        if let Some(end) = self.held_s {
            self.hold_at(end);
        }
    }

    /// Holds the right end still at a time, s, or where the samples end.
    fn hold_at(&mut self, end_s: f64) {
        self.held_s = Some(end_s.max(self.oldest_s).min(self.newest_s));
    }

    /// Keys of the chosen signals.
    pub fn keys(&self) -> Vec<&'static str> {
        let chosen = SIGNALS.iter().zip(&self.chosen).filter(|(_, on)| **on);
        chosen.map(|(signal, _)| signal.key).collect()
    }

    /// Chooses the signals of these keys; a key that no signal has is left out.
    pub fn choose(&mut self, keys: impl IntoIterator<Item = impl AsRef<str>>) {
        self.chosen = vec![false; SIGNALS.len()];
        for key in keys {
            if let Some(place) = SIGNALS.iter().position(|signal| signal.key == key.as_ref()) {
                self.chosen[place] = true;
            }
        }
    }

    /// Whether each signal is drawn, in the order of [`SIGNALS`].
    pub(super) fn switches(&mut self) -> impl Iterator<Item = (&'static Signal, &mut bool)> {
        SIGNALS.iter().zip(&mut self.chosen)
    }

    /// The chosen signals of a quantity.
    pub(super) fn chosen_of(&self, quantity: Quantity) -> Vec<&'static Signal> {
        let chosen = SIGNALS.iter().zip(&self.chosen).filter(|(_, on)| **on);
        let of = chosen.filter(|(signal, _)| signal.quantity == quantity);
        of.map(|(signal, _)| signal).collect()
    }

    /// Times of the left and the right end, s.
    pub fn range_s(&self) -> [f64; 2] {
        let end = self.held_s.unwrap_or(self.newest_s);
        [end - self.span_s, end]
    }

    /// Time from left to right, s.
    pub fn span_s(&self) -> f64 {
        self.span_s
    }

    /// The newest sample's time, s.
    pub(super) fn newest_s(&self) -> f64 {
        self.newest_s
    }

    /// Whether the plots are held still.
    pub fn is_held(&self) -> bool {
        self.held_s.is_some()
    }

    /// Holds the plots still, or lets them follow the newest sample.
    pub fn hold(&mut self, held: bool) {
        self.held_s = held.then_some(self.held_s.unwrap_or(self.newest_s));
    }

    /// Live, with the span of the start.
    pub(super) fn reset(&mut self) {
        (self.held_s, self.span_s) = (None, SPAN_S);
    }

    /// Changes the span by a factor. Held plots keep the time `about_s` (s) where it is, or their middle; live ones keep their right end.
    pub(super) fn zoom(&mut self, factor: f64, about_s: Option<f64>) {
        if !(factor.is_finite() && factor > 0.0) {
            return;
        }
        let before = self.span_s;
        self.span_s = (before * factor).clamp(*SPANS_S.start(), *SPANS_S.end());
        if let Some(end) = self.held_s {
            let about = about_s.unwrap_or(end - 0.5 * before);
            self.hold_at(about + (end - about) * (self.span_s / before));
        }
    }

    /// Moves the plots by a time, s, which holds them still; beyond the newest sample they are live again.
    pub(super) fn pan(&mut self, by_s: f64) {
        let end = self.range_s()[1] + by_s;
        self.held_s = None;
        if by_s.is_finite() && end < self.newest_s {
            self.hold_at(end);
        }
    }

    /// The time under the pointer, s.
    pub(super) fn pointed_s(&self) -> Option<f64> {
        self.pointed_s
    }

    /// Points at a time, s.
    pub(super) fn point(&mut self, at_s: Option<f64>) {
        self.pointed_s = at_s;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn held_plots_stay_while_samples_arrive() {
        let mut view = View::default();
        view.follow(Some([0.0, 50.0]));
        assert_eq!(view.range_s(), [40.0, 50.0]);
        view.hold(true);
        view.follow(Some([0.0, 60.0]));
        assert_eq!(view.range_s(), [40.0, 50.0]);
        view.zoom(0.5, Some(45.0));
        assert_eq!(view.range_s(), [42.5, 47.5]);
        view.pan(-10.0);
        assert_eq!(view.range_s(), [32.5, 37.5]);
        view.pan(100.0);
        assert!(!view.is_held(), "moved beyond the newest sample");
        view.zoom(4.0, Some(59.0));
        assert_eq!(view.range_s(), [40.0, 60.0]);
    }

    #[test]
    fn keys_that_no_signal_has_are_left_out() {
        let mut view = View::default();
        assert_eq!(view.keys(), CHOSEN);
        view.choose(["points", "no such signal", "handle_x_mm"]);
        assert_eq!(view.keys(), ["handle_x_mm", "points"]);
    }

    proptest! {
        #[test]
        fn a_view_stays_finite_and_shows_time(moves in prop::collection::vec((0..3u8, any::<f64>()), 0..40)) {
            let mut view = View::default();
            view.follow(Some([20.0, 100.0]));
            for (kind, value) in moves {
                match kind {
                    0 => view.zoom(value, Some(95.0)),
                    1 => view.zoom(value.abs().fract() + 0.5, None),
                    _ => view.pan(value),
                }
                let [from, to] = view.range_s();
                prop_assert!(SPANS_S.contains(&view.span_s()));
                prop_assert!((20.0..=100.0).contains(&to) && from < to, "{from} to {to}");
            }
        }
    }
}
