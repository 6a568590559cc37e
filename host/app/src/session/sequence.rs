//! The steps in which an assembly goes together, and where its parts are before, between and after them. Pure.
//!
//! Parts that are not yet put on stand at the end of their way, far enough from one another to be seen: a part stands farther out than its way leads where it
//! would be within another part's box there. A group that is put on as one is itself apart before its own steps are done. Lengths are mm.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use mortise_page::Picture;
use mortise_task::report::{self, Sense};
use mortise_task::sequence::Sequence as Found;
use mortise_task::{Assembly, Motion};

use super::grouped::Grouped;

/// Least distance of the boxes of parts that are apart, over the radius of the assembly.
const BETWEEN: f64 = 0.06;
/// Speed of a turn beside that of a slide: the share of the assembly's radius that a point is from the axis.
const ARM: f64 = 0.5;
/// Poses differ by less, mm and as components of unit vectors, where they come back from a file or a board.
const SAME_MM: f64 = 1e-3;
/// See [`Sequence::done`].
const MOST: usize = 1000;
/// Lines of a way that is drawn: a turn by half a circle leaves its arc by 0.1 % of the radius.
const LINES: u32 = 36;

/// A step: a group of parts is put onto others.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Parts that move.
    pub parts: Vec<usize>,
    /// Their names.
    pub names: String,
    /// The step in words.
    pub words: String,
    /// The parts that are on before the step, and those that move with their way in; `None` where an assembly has too many steps.
    pub picture: Option<Arc<Picture>>,
    /// Middle of the parts where the file has them.
    middle: DVec3,
    /// Way from the place of the parts outwards, to where they stand before the step.
    way: Vec<Motion>,
}

impl Step {
    /// The step in words, without what moves.
    pub fn how(&self) -> &str {
        (self.words.strip_prefix(&self.names)).map_or(&self.words, str::trim_start)
    }
}

/// The steps of an assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// The steps, in the order of assembly.
    pub steps: Vec<Step>,
    /// What was found, in a line.
    pub verdict: String,
    /// Parts that do not come apart and what holds them, in words.
    pub stuck: Vec<String>,
    /// Report as a page (HTML).
    pub page: Arc<str>,
    /// Poses in the file.
    file: Vec<DAffine3>,
    /// Radius of the assembly.
    radius: f64,
}

impl Sequence {
    /// The steps of a sequence that was found for `assembly`, with their report. Cost: a picture a step, and a comparison of two boxes for each pair of parts.
    pub fn new(title: &str, assembly: &Assembly, found: &Found) -> Self {
        let report = report::sequence(assembly, found, Sense::Assembly);
        let all: Vec<usize> = (0..assembly.count()).collect();
        let (low, high) = assembly.bounds_of(&all, DAffine3::IDENTITY);
        let radius = (0.5 * low.distance(high)).max(1e-3);
        let count = report.steps.len();
        let pictures = mortise_page::pictures(assembly, found);
        // What each part has been moved by so far, from where the file has it.
        let (mut by, mut steps) = (vec![DAffine3::IDENTITY; all.len()], Vec::with_capacity(count));
        for (step, words) in found.steps.iter().rev().zip(&report.steps) {
            let mut way = step.path.legs.clone();
            let end = step.path.poses().pop().unwrap_or(DAffine3::IDENTITY);
            for part in &step.group {
                by[*part] = end * by[*part];
            }
            let boxes = |of: &[usize]| -> Vec<Bounds> {
                of.iter().map(|part| assembly.bounds(*part, by[*part])).collect()
            };
            let (moved, others) = (boxes(&step.group), boxes(&step.onto));
            let last = way.last().map_or(DVec3::ZERO, |leg| leg.slide);
            let along = last.try_normalize().unwrap_or(DVec3::Z);
            let beyond = along * clear_by(&moved, &others, along, BETWEEN * radius);
            if beyond != DVec3::ZERO {
                way.push(Motion::slide(beyond));
                for part in &step.group {
                    by[*part].translation += beyond;
                }
            }
            let (low, high) = assembly.bounds_of(&step.group, DAffine3::IDENTITY);
            let picture = pictures.get(steps.len());
            steps.push(Step {
                picture: picture.map(|picture| Arc::new(picture.halved())),
                middle: 0.5 * (low + high),
                parts: step.group.clone(),
                names: words.moving.join(", "),
                words: words.words(),
                way,
            });
        }
        let verdict = match (report.verdict, count) {
            ("timed_out", _) => format!("The time ended after {count} steps"),
            ("assembles", 1) => "Goes together in 1 step".to_owned(),
            ("assembles", _) => format!("Goes together in {count} steps"),
            _ => "Does not come apart completely".to_owned(),
        };
        Self {
            steps,
            verdict,
            stuck: report.stuck.iter().map(|stuck| stuck.words()).collect(),
            page: mortise_page::page(title, assembly, found, &pictures, &[]).into(),
            file: all.iter().map(|part| assembly.placement(*part)).collect(),
            radius,
        }
    }

    /// The same steps with the parts of each group in place of the one that stands for it. `numbers` are those that the document gives to the parts here.
    pub(super) fn with_groups(mut self, grouped: &Grouped, numbers: &[usize]) -> Self {
        for step in &mut self.steps {
            let parts = step.parts.iter().filter_map(|&part| numbers.get(part));
            step.parts = parts.flat_map(|&part| grouped.groups.together(part)).collect();
        }
        self.file = grouped.file_poses();
        self
    }

    /// Poses of all parts after `done` steps, with its fraction as the share of the way that the next one has gone.
    pub fn poses(&self, done: f64) -> Vec<DAffine3> {
        let mut moved = vec![DAffine3::IDENTITY; self.file.len()];
        for (i, step) in self.steps.iter().enumerate() {
            let out = (1.0 - (done - i as f64)).clamp(0.0, 1.0);
            // Exactly in place where the step is done.
            if out == 0.0 {
                continue;
            }
            let by = along(&step.way, out, ARM * self.radius);
            for part in &step.parts {
                if let Some(moved) = moved.get_mut(*part) {
                    *moved = by * *moved;
                }
            }
        }
        let at = |(by, file): (&DAffine3, &DAffine3)| {
            if *by == DAffine3::IDENTITY {
                *file
            } else {
                super::pose::rigid(&(*by * *file))
            }
        };
        moved.iter().zip(&self.file).map(at).collect()
    }

    /// Number of steps done with the parts at `poses`, a whole one; `None` between them, and where parts are elsewhere. Of an assembly with more than
    /// 1000 steps times parts only the ends are known. Cost: some microseconds a step, for each step.
    pub fn done(&self, poses: &[DAffine3]) -> Option<f64> {
        let count = self.steps.len();
        let each = if count * self.file.len() <= MOST {
            1
        } else {
            count.max(1)
        };
        let is_at = |done: f64| are_same(&self.poses(done), poses);
        (0..=count)
            .rev()
            .step_by(each)
            .map(|done| done as f64)
            .find(|done| is_at(*done))
    }

    /// The step that is next, or under way, after `done` steps.
    pub fn next(&self, done: f64) -> Option<&Step> {
        self.steps.get(done.max(0.0) as usize)
    }

    /// Way of the middle of the parts that the next step puts on, from where they stand before it to their place, mm; empty after the last step.
    pub fn way(&self, done: f64) -> Vec<DVec3> {
        let number = done.max(0.0) as usize;
        let Some(step) = self.steps.get(number) else {
            return Vec::new();
        };
        // What is put on as one later stands apart until then.
        let later = (self.steps[number + 1..].iter())
            .filter(|later| step.parts.iter().all(|part| later.parts.contains(part)))
            .fold(DAffine3::IDENTITY, |by, later| {
                along(&later.way, 1.0, ARM * self.radius) * by
            });
        let at = |line: u32| {
            let out = 1.0 - f64::from(line) / f64::from(LINES);
            let by = later * along(&step.way, out, ARM * self.radius);
            by.transform_point3(step.middle)
        };
        (0..=LINES).map(at).collect()
    }
}

/// Whether all parts are at the same poses, but for the rounding of a file or a board.
pub(super) fn are_same(a: &[DAffine3], b: &[DAffine3]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.abs_diff_eq(*b, SAME_MM))
}

/// Motion along a way up to a share of its length; a turn counts with this `arm`.
fn along(way: &[Motion], share: f64, arm: f64) -> DAffine3 {
    let length = |leg: &Motion| leg.slide.length() + arm * leg.angle.abs();
    let mut left = share * way.iter().map(length).sum::<f64>();
    let mut pose = DAffine3::IDENTITY;
    for leg in way {
        let own = length(leg);
        let share = if own > left { left / own } else { 1.0 };
        pose = leg.at(share) * pose;
        left -= own;
        if left <= 0.0 {
            break;
        }
    }
    pose
}

/// Low and high corner of a box along the axes.
type Bounds = (DVec3, DVec3);

/// Travels along a unit direction at which a box is nearer than `between` to another one, from and to; `None` where that is over before it begins.
fn meets(own: &Bounds, other: &Bounds, along: DVec3, between: f64) -> Option<[f64; 2]> {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let before = other.0[axis] - between - own.1[axis];
        let after = other.1[axis] + between - own.0[axis];
        if along[axis].abs() < 1e-9 {
            if before >= 0.0 || after <= 0.0 {
                return None;
            }
            continue;
        }
        let [a, b] = [before / along[axis], after / along[axis]];
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    (from < to && to > 0.0).then_some([from, to])
}

/// Least travel along a unit direction after which no box of `moved` is nearer than `between` to one of `others`.
fn clear_by(moved: &[Bounds], others: &[Bounds], along: DVec3, between: f64) -> f64 {
    let mut meetings: Vec<[f64; 2]> = (moved.iter())
        .flat_map(|a| others.iter().filter_map(|b| meets(a, b, along, between)))
        .collect();
    meetings.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut travel: f64 = 0.0;
    for [from, to] in meetings {
        if from >= travel {
            break;
        }
        travel = travel.max(to);
    }
    travel
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::time::Duration;

    use mortise_brep::CadModel;
    use proptest::prelude::*;

    use super::*;
    use crate::session::document::Document;

    fn taken_apart(model: CadModel) -> (Assembly, Sequence) {
        let assembly = Assembly::new(model).expect("an assembly");
        let all: Vec<usize> = (0..assembly.count()).collect();
        let found = mortise_task::sequence::disassemble(&assembly, &all, Duration::from_secs(60));
        let sequence = Sequence::new("sample", &assembly, &found);
        (assembly, sequence)
    }

    /// A file of the repository.
    fn of_file(file: &str) -> (Assembly, Sequence) {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("..")
            .join(file);
        taken_apart(mortise_brep::load_step(&file).expect("a file of the repository"))
    }

    fn sample() -> (Assembly, Sequence) {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        taken_apart((*document.model).clone())
    }

    #[test]
    fn the_sample_goes_together_in_a_step_and_is_apart_before_it() {
        let (assembly, sequence) = sample();
        assert_eq!(sequence.verdict, "Goes together in 1 step");
        let file: Vec<DAffine3> = assembly.model.parts.iter().map(|part| part.placement).collect();
        assert_eq!(sequence.poses(1.0), file);
        assert_eq!(sequence.poses(7.0), file, "beyond the end");
        assert_eq!(sequence.done(&file), Some(1.0));
        assert_eq!(sequence.done(&sequence.poses(0.0)), Some(0.0));
        assert_eq!(sequence.done(&sequence.poses(0.3)), None);
        let apart = sequence.poses(0.0);
        assert_eq!(sequence.poses(-3.0), apart, "before the beginning");
        let [moved] = sequence.next(0.0).expect("a step").parts[..] else {
            panic!("one part")
        };
        let way = apart[moved].translation - file[moved].translation;
        assert!(way.length() > 1.0);
        let half = sequence.poses(0.5)[moved].translation - file[moved].translation;
        assert!((half - 0.5 * way).length() < 1e-9);
        assert_eq!(sequence.next(1.0), None);
        let picture = sequence.next(0.0).and_then(|step| step.picture.as_ref());
        let picture = picture.expect("a picture");
        let how = sequence.next(0.0).map(Step::how).unwrap_or_default();
        assert!(how.starts_with("along ") && how.contains(": clear"), "{how}");
        assert_eq!([picture.width, picture.height], [190, 140]);
    }

    /// The way that is drawn of a step is where its parts go, from their place before the step to that after it.
    #[test]
    fn the_way_of_a_step_is_where_its_parts_go() {
        let (assembly, row) = of_file("lab/data/fixture_row.step");
        let (pair, sample) = sample();
        for (assembly, sequence) in [(assembly, row), (pair, sample)] {
            for (number, step) in sequence.steps.iter().enumerate() {
                let way = sequence.way(number as f64);
                let (low, high) = assembly.bounds_of(&step.parts, DAffine3::IDENTITY);
                for (line, point) in way.iter().enumerate() {
                    let done = number as f64 + line as f64 / f64::from(LINES);
                    let poses = sequence.poses(done);
                    let by = poses[step.parts[0]] * sequence.file[step.parts[0]].inverse();
                    let middle = by.transform_point3(0.5 * (low + high));
                    assert!(middle.distance(*point) < 1e-9, "{done}: {middle} {point}");
                }
            }
            assert!(sequence.way(sequence.steps.len() as f64).is_empty());
        }
    }

    /// Of files with several parts: no two are nearer than their boxes are to be once all are off, and each step is clear of those that follow.
    #[test]
    fn parts_that_are_off_stand_apart() {
        for file in [
            "lab/data/fixture_row.step",
            "mating/tests/data/two_pin_exact.step",
        ] {
            let (assembly, sequence) = of_file(file);
            let count = assembly.count();
            assert_eq!(sequence.steps.len(), count - 1, "{}", sequence.verdict);
            let apart = sequence.poses(0.0);
            let boxes: Vec<Bounds> = (0..count)
                .map(|part| assembly.bounds(part, apart[part] * sequence.file[part].inverse()))
                .collect();
            for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (a, b))) {
                let near = overlap(&boxes[a], &boxes[b], 0.999 * BETWEEN * sequence.radius);
                assert!(!near, "{} and {} of {}", assembly.name(a), assembly.name(b), file);
            }
        }
    }

    fn cuboid() -> impl Strategy<Value = Bounds> {
        let corner = prop::array::uniform3(-10.0f64..10.0);
        let size = prop::array::uniform3(0.1f64..8.0);
        (corner, size).prop_map(|(corner, size)| {
            let low = DVec3::from(corner);
            (low, low + DVec3::from(size))
        })
    }

    fn overlap(a: &Bounds, b: &Bounds, between: f64) -> bool {
        a.0.cmplt(b.1 + between).all() && b.0.cmplt(a.1 + between).all()
    }

    proptest! {
        /// After the travel the boxes are apart, and after none of a hundred shorter ones.
        #[test]
        fn boxes_travel_as_far_as_they_must(
            moved in prop::collection::vec(cuboid(), 1..4),
            others in prop::collection::vec(cuboid(), 1..6),
            direction in prop_oneof![
                Just(DVec3::Z),
                Just(DVec3::NEG_X),
                prop::array::uniform3(-1.0f64..1.0).prop_map(|d| DVec3::from(d).try_normalize().unwrap_or(DVec3::Y)),
            ],
            between in 0.0f64..1.0,
        ) {
            let travel = clear_by(&moved, &others, direction, between);
            let meets = |travel: f64| {
                let by = travel * direction;
                let at: Vec<Bounds> = moved.iter().map(|a| (a.0 + by, a.1 + by)).collect();
                at.iter().any(|a| others.iter().any(|b| overlap(a, b, between)))
            };
            prop_assert!(!meets(travel + 1e-9), "{travel}");
            for share in 0..100 {
                let shorter = 0.01 * f64::from(share) * travel;
                prop_assert!(travel < 1e-6 || meets(shorter), "{shorter} of {travel}");
            }
        }

        /// A way of slides and turns is gone along without jumps, from its start to its end.
        #[test]
        fn a_way_is_continuous(
            legs in prop::collection::vec((prop::array::uniform3(-20.0f64..20.0), -3.0f64..3.0), 1..5),
        ) {
            let way: Vec<Motion> = legs
                .iter()
                .map(|(slide, angle)| Motion { slide: DVec3::from(*slide), point: DVec3::X, axis: DVec3::Z, angle: *angle })
                .collect();
            let end = way.iter().fold(DAffine3::IDENTITY, |pose, leg| leg.at(1.0) * pose);
            prop_assert_eq!(along(&way, 0.0, 10.0), DAffine3::IDENTITY);
            prop_assert!(along(&way, 1.0, 10.0).abs_diff_eq(end, 1e-9));
            let total: f64 = way.iter().map(|leg| leg.slide.length() + 10.0 * leg.angle.abs()).sum();
            let at = |share: f64| along(&way, share, 10.0).transform_point3(DVec3::new(1.0, 10.0, 0.0));
            let places: Vec<DVec3> = (0..=50).map(|i| at(f64::from(i) / 50.0)).collect();
            // A point at the arm from the axis has the same speed all along; one farther out is faster in turns.
            let arm = places.iter().map(|p| (*p - DVec3::X).truncate().length()).fold(10.0, f64::max);
            let most = total / 50.0 * arm / 10.0;
            for pair in places.windows(2) {
                prop_assert!(pair[0].distance(pair[1]) <= 1.2 * most + 1e-9, "{pair:?} {most}");
            }
        }
    }
}
