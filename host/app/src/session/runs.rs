//! Recorded runs that are shown beside each other: the one whose time is shown and that moves the parts, the others that are drawn with it, and what computing
//! each again has given. Pure.

use std::path::PathBuf;

use super::recomputed::{Recomputation, Recomputed, Recomputing};
use super::run::Run;

/// Largest number of runs shown at once: of more, neither the lines nor the columns of figures could be distinguished.
pub const MOST_RUNS: usize = 6;

/// An action of the operator on recorded runs.
#[derive(Clone, Debug, PartialEq)]
pub enum RunIntent {
    /// Ask for the file of a run to show.
    Browse,
    /// Show a run alone.
    Open(PathBuf),
    /// Ask for the file of a run to compare with.
    BrowseOther,
    /// Show a run beside those that are shown.
    Compare(PathBuf),
    /// Show the time of this run, and the parts as it moved them.
    Choose(usize),
    /// Draw the traces of this run beside those of the chosen one, or not.
    Draw(usize, bool),
    /// Show this run no more.
    Remove(usize),
    /// Let it go on, or hold it.
    Play(bool),
    /// Go to a time, s.
    GoTo(f64),
    /// Seconds of the run in a second.
    Speed(f64),
    /// Compute a run again by the simulation, and compare.
    Recompute(usize, Recomputing),
    /// End the computations under way.
    CancelRecompute,
    /// Ask where to write a report.
    SaveReport,
    /// Write a report of the runs that are shown.
    WriteReport {
        /// File to write.
        path: PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Ask where to write the table of figures.
    SaveTable,
    /// Write the figures of the runs that are shown as comma-separated values.
    WriteTable {
        /// File to write.
        path: PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Show no run any more.
    Close,
}

/// A run that was read.
pub struct RunRead {
    /// Whether it is to be compared with the runs that are shown.
    pub compare: bool,
    /// The run, or one line with the reason why there is none.
    pub result: Result<Box<Run>, String>,
}

/// A run among others.
#[derive(Debug)]
pub struct Shown {
    /// The run.
    pub run: Run,
    /// Whether its traces are drawn beside those of the chosen run.
    pub drawn: bool,
    /// Whether the open document has the collision model of the run, so that its parts are moved.
    pub moves_parts: bool,
    /// Whether, and how far, it is being computed again.
    pub recomputation: Option<Recomputation>,
    /// What computing it again has given last.
    pub recomputed: Option<Recomputed>,
}

/// Runs that are shown, at least one, and where the chosen one is.
#[derive(Debug)]
pub struct Playback {
    /// Never empty.
    runs: Vec<Shown>,
    chosen: usize,
    /// Present time in the chosen run, s.
    pub at_s: f64,
    /// Whether it goes on by itself.
    pub plays: bool,
    /// Seconds of the run in a second.
    pub speed: f64,
}

impl Playback {
    /// A run from its beginning.
    pub fn new(run: Run, moves_parts: bool) -> Self {
        let mut playback = Self {
            runs: Vec::new(),
            chosen: 0,
            at_s: 0.0,
            plays: false,
            speed: 1.0,
        };
        playback.push(run, moves_parts);
        playback
    }

    /// Shows another run beside those that are shown.
    pub fn push(&mut self, run: Run, moves_parts: bool) {
        self.runs.push(Shown {
            run,
            drawn: true,
            moves_parts,
            recomputation: None,
            recomputed: None,
        });
    }

    /// The runs in the order in which they were opened.
    pub fn runs(&self) -> &[Shown] {
        &self.runs
    }

    /// A run, to change it.
    pub(super) fn shown_mut(&mut self, index: usize) -> Option<&mut Shown> {
        self.runs.get_mut(index)
    }

    /// All of them, to change them.
    pub(super) fn all_mut(&mut self) -> impl Iterator<Item = &mut Shown> {
        self.runs.iter_mut()
    }

    /// Place of the chosen run among all.
    pub fn chosen(&self) -> usize {
        self.chosen
    }

    /// The chosen run, and how it is shown.
    pub fn shown(&self) -> &Shown {
        &self.runs[self.chosen]
    }

    /// The chosen run.
    pub fn run(&self) -> &Run {
        &self.shown().run
    }

    /// The other runs that are drawn: place among all, run, and what is added to its times so that both touch first at the same time, s; without a touch they begin
    /// together.
    pub fn others(&self) -> impl Iterator<Item = (usize, &Run, f64)> {
        let all = self.runs.iter().enumerate();
        all.filter(|(index, shown)| *index != self.chosen && shown.drawn)
            .map(|(index, shown)| (index, &shown.run, shift_s(self.run(), &shown.run)))
    }

    /// Chooses a run; its time is the one at which it is as far from its first touch as the run before was.
    pub fn choose(&mut self, index: usize) {
        let Some(next) = self.runs.get(index) else {
            return;
        };
        let at_s = self.at_s - shift_s(self.run(), &next.run);
        self.chosen = index;
        self.go_to(at_s);
    }

    /// Shows a run no more. Returns whether one is left; if not, this one stays.
    pub fn remove(&mut self, index: usize) -> bool {
        if index >= self.runs.len() {
            return true;
        }
        if self.runs.len() == 1 {
            return false;
        }
        if index == self.chosen {
            self.choose(if index > 0 { index - 1 } else { 1 });
        }
        self.runs.remove(index);
        self.chosen -= usize::from(self.chosen > index);
        true
    }

    /// Goes to a time, s, within the run.
    pub fn go_to(&mut self, time_s: f64) {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        self.at_s = time_s.clamp(0.0, self.run().duration_s());
    }

    /// Time has passed, s; stops at the end.
    pub fn pass(&mut self, seconds: f64) {
        if self.plays {
            self.go_to(self.at_s + seconds * self.speed);
            self.plays = self.at_s < self.run().duration_s();
        }
    }
}

/// Time from the first touch of `other` to that of `run`, s; 0 without one of them.
fn shift_s(run: &Run, other: &Run) -> f64 {
    let touches = run.touch_s.zip(other.touch_s);
    touches.map_or(0.0, |(own, other)| own - other)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::history::Sample;
    use super::*;

    /// A run of 2 s that first touches at a time, s.
    fn run(name: &str, touch_s: Option<f64>) -> Run {
        let sample = |i: usize| Sample {
            time_s: 0.01 * i as f64,
            ..Sample::default()
        };
        let mut run = Run::of(name, (0..201).map(sample));
        run.touch_s = touch_s;
        run
    }

    #[test]
    fn runs_are_aligned_by_their_first_touch() {
        let mut playback = Playback::new(run("a", Some(0.8)), true);
        playback.push(run("b", Some(0.3)), true);
        playback.push(run("c", None), false);
        let shifts = |playback: &Playback| -> Vec<(usize, f64)> {
            playback
                .others()
                .map(|(index, _, shift)| (index, shift))
                .collect()
        };
        assert_eq!(shifts(&playback), [(1, 0.5), (2, 0.0)]);
        playback.go_to(0.9);
        playback.choose(1);
        assert!((playback.at_s - 0.4).abs() < 1e-12, "as far from the touch");
        assert_eq!(shifts(&playback), [(0, -0.5), (2, 0.0)]);
        playback.runs[0].drawn = false;
        assert_eq!(shifts(&playback), [(2, 0.0)]);
        playback.choose(9);
        assert_eq!(playback.chosen(), 1, "there is no such run");
    }

    #[test]
    fn play_goes_on_at_its_speed_and_stops_at_the_end() {
        let mut playback = Playback::new(run("a", None), true);
        playback.go_to(f64::NAN);
        playback.pass(1.0);
        assert_eq!(playback.at_s, 0.0, "it does not play");
        (playback.plays, playback.speed) = (true, 0.5);
        playback.pass(1.0);
        assert!((playback.at_s - 0.5).abs() < 1e-9 && playback.plays);
        playback.pass(100.0);
        assert!(!playback.plays && (playback.at_s - 2.0).abs() < 1e-9);
    }

    proptest! {
        /// Whatever is chosen and removed, the chosen run is the one that was chosen last, unless it was removed itself.
        #[test]
        fn a_run_stays_chosen_while_others_go(
            touches in prop::collection::vec(prop::option::of(0.0..2.0), 1..MOST_RUNS),
            steps in prop::collection::vec((any::<bool>(), 0..MOST_RUNS), 0..20),
        ) {
            let mut playback = Playback::new(run("0", touches[0]), true);
            for (index, touch) in touches.iter().enumerate().skip(1) {
                playback.push(run(&index.to_string(), *touch), index % 2 == 0);
            }
            for (removes, index) in steps {
                let (before, count) = (playback.run().name(), playback.runs().len());
                let name = playback.runs().get(index).map(|shown| shown.run.name());
                if removes {
                    prop_assert_eq!(playback.remove(index), count > 1 || index >= count);
                    if name.as_ref() != Some(&before) || count == 1 {
                        prop_assert_eq!(playback.run().name(), before);
                    }
                } else {
                    playback.choose(index);
                    prop_assert_eq!(playback.run().name(), name.unwrap_or(before));
                }
                prop_assert!((0.0..=playback.run().duration_s()).contains(&playback.at_s));
                prop_assert!(playback.others().count() + 1 == playback.runs().len());
            }
        }
    }
}
