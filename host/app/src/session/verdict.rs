//! Outcome of an insertion in words: inserted, stuck (and on what), or released on the way. Pure.
//!
//! A shaft and a bore are an outer and a wider inner cylinder of two parts, one of them held. The depth is the length over which the two
//! overlap along the bore's axis; the full depth is the shorter length of both. A part of any other shape is watched on the way to its place in the
//! file (`place.rs`). Cost: one pass over the pairs of the held part.

use std::fmt;

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;

use super::insertion::{Wall, local_walls};
use super::notes::Severity;
use super::place::{Away, Places};

/// Distance from the end that counts as fully inserted, mm: the lag of the coupling's spring behind a hand that arrives.
const NEAR_END_MM: f64 = 0.1;
/// Distance from its place at which a part that comes to rest is in it, mm: a loose fit lets it lie anywhere in its play.
const IN_PLACE_MM: f64 = 0.5;
/// Motion along the axis that counts as progress, mm.
const PROGRESS_MM: f64 = 0.05;
/// Time without progress near the end after which the part has arrived, s.
const ARRIVED_S: f64 = 0.4;
/// Time without progress under a push after which the part is stuck, s.
const STUCK_S: f64 = 1.0;
/// Least axial contact force that counts as a push, N.
const PUSH_N: f64 = 0.3;
/// Distance in front of the bore at which an insertion begins, mm.
const BEGUN_MM: f64 = 1.0;
/// Largest angle between the axes of an insertion, rad.
const LEAN: f64 = 0.2;
/// Largest difference of the radii of bore and shaft, as a fraction of the bore's radius.
const SLACK: f64 = 0.4;
/// Largest number of pairs examined; an assembly with more shafts of one size is watched only in part.
const MAX_PAIRS: usize = 4096;

/// Outcome of an insertion.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Fully inserted.
    GoesIn {
        /// Depth, mm.
        depth_mm: f64,
        /// Difference of the diameters, mm.
        clearance_mm: f64,
        /// Largest force on the handle on the way, N.
        peak_n: f64,
    },
    /// Back where the file puts it.
    InPlace {
        /// Distance from the place, mm.
        away_mm: f64,
        /// Largest force on the handle on the way, N.
        peak_n: f64,
    },
    /// Pushed without progress in a bore.
    Stuck {
        /// Depth, mm.
        depth_mm: f64,
        /// The feature it meets.
        on: String,
    },
    /// Pushed without progress on the way to its place.
    StuckAway {
        /// Distance from the place, mm.
        away_mm: f64,
        /// The feature it meets.
        on: String,
    },
    /// Released on the way.
    LetGo {
        /// Depth, mm.
        depth_mm: f64,
        /// Full depth, mm.
        full_mm: f64,
    },
}

impl Verdict {
    /// Severity of the message.
    pub fn severity(&self) -> Severity {
        match self {
            Self::GoesIn { .. } | Self::InPlace { .. } => Severity::Good,
            Self::Stuck { .. } | Self::StuckAway { .. } => Severity::Warning,
            Self::LetGo { .. } => Severity::Info,
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::GoesIn {
                depth_mm,
                clearance_mm,
                peak_n,
            } => write!(
                f,
                "Goes in: {depth_mm:.1} mm, clearance {clearance_mm:.3} mm, peak {} N",
                two_digits(*peak_n)
            ),
            Self::InPlace { away_mm, peak_n } => write!(
                f,
                "In place: {away_mm:.2} mm from where the file puts it, peak {} N",
                two_digits(*peak_n)
            ),
            Self::StuckAway { away_mm, on } => write!(f, "Stuck {away_mm:.1} mm from its place: {on}"),
            Self::Stuck { depth_mm, on } => write!(f, "Stuck at {depth_mm:.1} mm: {on}"),
            Self::LetGo { depth_mm, full_mm } => write!(f, "Released at {depth_mm:.1} of {full_mm:.1} mm"),
        }
    }
}

/// A force with two significant digits, but no finer than 0.01: 12, 3.4, 0.84, 0.04.
fn two_digits(newton: f64) -> String {
    // A value that rounds up to the next power of ten has one decimal fewer.
    let digits = match newton.abs() {
        n if n >= 9.95 => 0,
        n if n >= 0.995 => 1,
        _ => 2,
    };
    format!("{newton:.digits$}")
}

/// One sample of the held part.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Board time, s.
    pub time_s: f64,
    /// Held part.
    pub held: usize,
    /// Force of the contacts on it, N.
    pub contact_n: DVec3,
    /// Force on the handle, N.
    pub handle_n: f64,
}

/// What the held part is on the way to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Goal {
    /// A shaft and a bore.
    Bore(usize, usize),
    /// The place in the file.
    Place,
}

/// Position of a part relative to its goal.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// Insertion depth, mm; negative: distance still in front of the bore, or from the place.
    depth_mm: f64,
    full_mm: f64,
    /// Distance from the full depth that counts as arrived, mm.
    near_mm: f64,
    /// Direction of extraction of the held part, unit vector.
    out: DVec3,
}

#[derive(Clone, Debug)]
struct Attempt {
    goal: Goal,
    deepest_mm: f64,
    since_s: f64,
    peak_n: f64,
    last: Depth,
    /// Depth at which an outcome was reported; the next report requires further motion.
    reported_at_mm: Option<f64>,
}

/// Watches the held part.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    walls: Vec<Wall>,
    held: Option<usize>,
    pairs: Vec<(usize, usize)>,
    places: Places,
    attempt: Option<Attempt>,
}

impl Watch {
    /// A watch for the parts of a model.
    pub fn of(model: &CadModel) -> Self {
        Self {
            walls: local_walls(model),
            places: Places::of(model),
            ..Self::default()
        }
    }

    /// Processes one sample; `on` describes the feature that the held part meets.
    pub fn sample(
        &mut self,
        poses: &[DAffine3],
        moment: &Moment,
        on: impl FnOnce(&[Wall]) -> String,
    ) -> Option<Verdict> {
        if self.held != Some(moment.held) {
            self.held = Some(moment.held);
            self.attempt = None;
            self.pairs = self.pairs_of(moment.held);
        }
        let (goal, now) = (self.nearest(poses, moment.held)).or_else(|| self.place(poses, moment.held))?;
        let arrived_mm = now.full_mm - now.near_mm;
        let attempt = match &mut self.attempt {
            Some(attempt) if attempt.goal == goal => attempt,
            other => other.insert(Attempt {
                goal,
                deepest_mm: now.depth_mm,
                since_s: moment.time_s,
                peak_n: 0.0,
                // A part grabbed at its full depth has not been inserted.
                reported_at_mm: (now.depth_mm > arrived_mm).then_some(now.depth_mm),
                last: now,
            }),
        };
        attempt.last = now;
        attempt.peak_n = attempt.peak_n.max(moment.handle_n);
        let left = (attempt.reported_at_mm).is_some_and(|at| (now.depth_mm - at).abs() > BEGUN_MM);
        // A part that goes back begins anew: neither its time without progress nor its force counts for the next way in.
        if left || now.depth_mm < attempt.deepest_mm - BEGUN_MM {
            *attempt = Attempt {
                goal,
                deepest_mm: now.depth_mm,
                since_s: moment.time_s,
                peak_n: moment.handle_n,
                last: now,
                reported_at_mm: attempt.reported_at_mm.filter(|_| !left),
            };
        }
        if now.depth_mm > attempt.deepest_mm + PROGRESS_MM {
            attempt.deepest_mm = now.depth_mm;
            attempt.since_s = moment.time_s;
        }
        let still_s = moment.time_s - attempt.since_s;
        let near_end = now.depth_mm > arrived_mm;
        let pushed = moment.contact_n.dot(now.out) > PUSH_N;
        let verdict = if attempt.reported_at_mm.is_some() {
            None
        } else if near_end && (still_s > ARRIVED_S || now.depth_mm >= now.full_mm) {
            let peak_n = attempt.peak_n;
            Some(match goal {
                Goal::Bore(shaft, bore) => Verdict::GoesIn {
                    depth_mm: now.depth_mm,
                    clearance_mm: 2.0 * (self.walls[bore].radius - self.walls[shaft].radius),
                    peak_n,
                },
                Goal::Place => Verdict::InPlace {
                    away_mm: -now.depth_mm,
                    peak_n,
                },
            })
        } else if !near_end && pushed && still_s > STUCK_S {
            let on = on(&self.walls);
            Some(match goal {
                Goal::Bore(..) => Verdict::Stuck {
                    depth_mm: now.depth_mm.max(0.0),
                    on,
                },
                Goal::Place => Verdict::StuckAway {
                    away_mm: -now.depth_mm,
                    on,
                },
            })
        } else {
            None
        };
        if verdict.is_some() {
            attempt.reported_at_mm = Some(now.depth_mm);
        }
        verdict
    }

    /// Ends the watch of the held part.
    pub fn let_go(&mut self) -> Option<Verdict> {
        self.held = None;
        let attempt = self.attempt.take()?;
        let Depth {
            depth_mm, full_mm, ..
        } = attempt.last;
        // On the way to its place a part has no positive depth, and its release is not reported.
        let on_the_way = depth_mm > PROGRESS_MM && depth_mm <= full_mm - NEAR_END_MM;
        (on_the_way && attempt.reported_at_mm.is_none()).then_some(Verdict::LetGo { depth_mm, full_mm })
    }

    /// Pairs of shaft and bore whose sizes match, one of each pair belonging to `held`.
    fn pairs_of(&self, held: usize) -> Vec<(usize, usize)> {
        let all = || self.walls.iter().enumerate();
        let fits = |shaft: &Wall, bore: &Wall| {
            let play = bore.radius - shaft.radius;
            (shaft.part == held) != (bore.part == held) && (0.0..=SLACK * bore.radius).contains(&play)
        };
        (all().filter(|(_, shaft)| !shaft.inner))
            .flat_map(|(i, shaft)| {
                (all().filter(|(_, bore)| bore.inner))
                    .filter(move |(_, bore)| fits(shaft, bore))
                    .map(move |(j, _)| (i, j))
            })
            .take(MAX_PAIRS)
            .collect()
    }

    /// The held part on the way to its place.
    fn place(&self, poses: &[DAffine3], held: usize) -> Option<(Goal, Depth)> {
        let Away { mm, out } = self.places.away(held, poses, BEGUN_MM)?;
        let depth = Depth {
            depth_mm: -mm,
            full_mm: 0.0,
            near_mm: IN_PLACE_MM,
            out,
        };
        Some((Goal::Place, depth))
    }

    /// The pair with the largest depth; among equals the one with the least clearance.
    fn nearest(&self, poses: &[DAffine3], held: usize) -> Option<(Goal, Depth)> {
        let mut best: Option<((usize, usize), Depth, f64)> = None;
        for &(i, j) in &self.pairs {
            let (shaft, bore) = (&self.walls[i], &self.walls[j]);
            let Some(now) = depth(shaft, bore, poses, held) else {
                continue;
            };
            let play = bore.radius - shaft.radius;
            let deeper = best.is_none_or(|(_, b, p)| (now.depth_mm, -play) > (b.depth_mm, -p));
            if deeper {
                best = Some(((i, j), now, play));
            }
        }
        best.map(|((shaft, bore), depth, _)| (Goal::Bore(shaft, bore), depth))
    }
}

/// Depth of a shaft in a bore; `None` when the shaft is not near the bore.
fn depth(shaft: &Wall, bore: &Wall, poses: &[DAffine3], held: usize) -> Option<Depth> {
    let [s, b] = [shaft, bore].map(|wall| poses.get(wall.part).map(|pose| wall.moved(pose)));
    let (s, b) = (s?, b?);
    if s.axis.cross(b.axis).length() > LEAN {
        return None;
    }
    let between = s.middle() - b.middle();
    let along = between.dot(b.axis);
    if (between - along * b.axis).length() > b.radius {
        return None;
    }
    let lengths = [s.length(), b.length()];
    let full_mm = lengths[0].min(lengths[1]);
    let depth_mm = (0.5 * (lengths[0] + lengths[1]) - along.abs()).min(full_mm);
    let out = if (along >= 0.0) == (shaft.part == held) {
        b.axis
    } else {
        -b.axis
    };
    (depth_mm > -BEGUN_MM).then_some(Depth {
        depth_mm,
        full_mm,
        near_mm: NEAR_END_MM,
        out,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(part: usize, radius: f64, length: f64, inner: bool) -> Wall {
        Wall {
            part,
            origin: DVec3::ZERO,
            axis: DVec3::Z,
            radius,
            ends: (0.0, length),
            inner,
            faces: vec![0],
        }
    }

    /// A bore of 40 mm from z = −40 and a shaft of 60 mm; `z` is the shaft's lower end.
    struct Bench {
        watch: Watch,
        time_s: f64,
    }

    impl Bench {
        fn new() -> Self {
            let walls = vec![wall(0, 9.375, 40.0, true), wall(1, 8.875, 60.0, false)];
            Self {
                watch: Watch {
                    walls,
                    ..Watch::default()
                },
                time_s: 0.0,
            }
        }

        fn at(&mut self, z: f64, push_n: f64) -> Option<Verdict> {
            self.time_s += 0.016;
            let poses = [-40.0, z].map(|z| DAffine3::from_translation(z * DVec3::Z));
            let moment = Moment {
                time_s: self.time_s,
                held: 1,
                contact_n: push_n * DVec3::Z,
                handle_n: push_n,
            };
            self.watch
                .sample(&poses, &moment, |_| "rim of plate, hole 2".to_owned())
        }

        fn hold(&mut self, z: f64, push_n: f64, seconds: f64) -> Vec<Verdict> {
            let samples = (seconds / 0.016) as usize;
            (0..samples).filter_map(|_| self.at(z, push_n)).collect()
        }
    }

    #[test]
    fn what_goes_in_says_how_far_and_how_hard_once() {
        let mut bench = Bench::new();
        let mut said = Vec::new();
        for step in 0..=600 {
            let z = 20.0 - 0.1 * f64::from(step);
            said.extend(bench.at(z, if step == 300 { 0.84 } else { 0.0 }));
        }
        said.extend(bench.hold(-40.0, 0.0, 2.0));
        let words: Vec<String> = said.iter().map(ToString::to_string).collect();
        assert_eq!(words, ["Goes in: 40.0 mm, clearance 1.000 mm, peak 0.84 N"]);
        // A part that rests within the spring's lag of the end has arrived.
        let mut bench = Bench::new();
        bench.at(0.0, 0.0);
        assert_eq!(bench.hold(-39.93, 0.0, 0.3), []);
        assert_eq!(bench.hold(-39.93, 0.0, 0.3).len(), 1);
        // A second insertion is reported again.
        assert_eq!(bench.hold(-20.0, 0.0, 0.2), []);
        assert_eq!(bench.hold(-40.0, 0.0, 0.2).len(), 1);
    }

    #[test]
    fn a_part_that_is_taken_out_and_touches_on_its_way_back_is_not_stuck() {
        let mut bench = Bench::new();
        assert_eq!(bench.hold(-40.0, 0.0, 1.0), []);
        for step in 0..=400 {
            let push_n = if step < 350 { 5.0 } else { 0.0 };
            assert_eq!(bench.at(-40.0 + 0.1 * f64::from(step), push_n), None, "out");
        }
        let mut said = Vec::new();
        for step in 0..=400 {
            said.extend(bench.at(-0.1 * f64::from(step), 1.0));
        }
        let words: Vec<_> = said.iter().map(ToString::to_string).collect();
        assert_eq!(
            words,
            ["Goes in: 40.0 mm, clearance 1.000 mm, peak 1.0 N"],
            "of the way in"
        );
    }

    #[test]
    fn a_small_force_is_reported_in_two_digits() {
        let expected = [
            (0.0, "0.00"),
            (0.004, "0.00"),
            (0.04, "0.04"),
            (0.044, "0.04"),
            (0.8449, "0.84"),
            (0.9949, "0.99"),
            (0.9951, "1.0"),
            (1.04, "1.0"),
            (3.449, "3.4"),
            (9.949, "9.9"),
            (9.951, "10"),
            (12.4, "12"),
        ];
        for (newton, words) in expected {
            assert_eq!(two_digits(newton), words, "{newton}");
        }
    }

    #[test]
    fn what_is_stuck_says_where_and_on_what_once_for_each_place() {
        let mut bench = Bench::new();
        bench.at(0.5, 0.0);
        assert_eq!(bench.hold(-12.3, 1.0, 0.9), []);
        let said = bench.hold(-12.3, 1.0, 3.0);
        let words: Vec<String> = said.iter().map(ToString::to_string).collect();
        assert_eq!(words, ["Stuck at 12.3 mm: rim of plate, hole 2"]);
        assert_eq!(bench.hold(-15.0, 1.0, 3.0).len(), 1, "another place");
        assert_eq!(bench.watch.let_go(), None, "already reported");
        // Without a push the part only rests.
        let mut bench = Bench::new();
        assert_eq!(bench.hold(-12.3, 0.0, 5.0), []);
        let said = bench.watch.let_go().map(|v| v.to_string());
        assert_eq!(said.as_deref(), Some("Released at 12.3 of 40.0 mm"));
    }

    #[test]
    fn a_part_taken_in_hand_where_it_belongs_has_not_been_inserted() {
        let mut bench = Bench::new();
        assert_eq!(bench.hold(-40.0, 1.0, 3.0), []);
        assert_eq!(bench.watch.let_go(), None);
    }

    /// Cubes of 2 mm side, the second's place inside the first; its offset along z over time, with a push.
    fn cube(path: &[(f64, f64)]) -> Vec<String> {
        let mut watch = Watch {
            places: Places::of_cubes(vec![None, Some((0, DAffine3::IDENTITY))]),
            ..Watch::default()
        };
        let sample = |(i, &(z, push_n)): (usize, &(f64, f64))| {
            let poses = [0.0, z].map(|z| DAffine3::from_translation(z * DVec3::Z));
            let moment = Moment {
                time_s: 0.016 * i as f64,
                held: 1,
                contact_n: push_n * DVec3::Z,
                handle_n: push_n,
            };
            watch.sample(&poses, &moment, |_| "rim of plate".to_owned())
        };
        let said = path.iter().enumerate().filter_map(sample);
        said.map(|verdict| verdict.to_string()).collect()
    }

    #[test]
    fn a_part_of_any_shape_is_in_its_place_or_stuck_on_the_way_there() {
        let down =
            |from: f64, to: f64| (0..=100).map(move |i| (from + (to - from) * f64::from(i) / 100.0, 0.2));
        let rest = |z: f64, push_n: f64| std::iter::repeat_n((z, push_n), 100);
        let path: Vec<_> = down(2.5, 0.04).chain(rest(0.04, 0.84)).collect();
        assert_eq!(
            cube(&path),
            ["In place: 0.04 mm from where the file puts it, peak 0.84 N"]
        );
        let path: Vec<_> = down(2.5, 1.26).chain(rest(1.26, 1.0)).collect();
        assert_eq!(cube(&path), ["Stuck 1.3 mm from its place: rim of plate"]);
        // Without a push it only rests; a push outwards is a pull.
        for push_n in [0.0, -1.0] {
            let path: Vec<_> = down(2.5, 1.26).chain(rest(1.26, push_n)).collect();
            assert_eq!(cube(&path), [""; 0]);
        }
        // Taken from its place and not brought back.
        let path: Vec<_> = rest(0.0, 1.0)
            .chain(down(0.0, 2.9))
            .chain(rest(5.0, 1.0))
            .collect();
        assert_eq!(cube(&path), [""; 0]);
    }

    #[test]
    fn beside_or_far_from_the_bore_nothing_is_said() {
        let mut bench = Bench::new();
        assert_eq!(bench.hold(15.0, 1.0, 3.0), []);
        let poses =
            [DVec3::new(0.0, 0.0, -40.0), DVec3::new(12.0, 0.0, -12.0)].map(DAffine3::from_translation);
        for tick in 0..300 {
            let moment = Moment {
                time_s: 100.0 + 0.016 * f64::from(tick),
                held: 1,
                contact_n: DVec3::Z,
                handle_n: 1.0,
            };
            assert_eq!(bench.watch.sample(&poses, &moment, |_| String::new()), None);
        }
    }
}
