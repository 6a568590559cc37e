//! The way of a simulated hand that brings a part in: where it is when, and how far off. Pure.

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use mortise_protocol::limits::MAX_KEYFRAMES;
use mortise_task::insertion::Insertion;

use crate::hand::TICK_HZ;

/// Share of the time of a way after which the hand is off it by the full amount.
const OFF_AFTER: f64 = 0.15;

/// How the hand moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Speed of the part's centre of mass, mm/s.
    pub speed_mm_s: f64,
    /// Angular speed, rad/s.
    pub speed_rad_s: f64,
    /// Largest distance of the hand from its way, mm: reached early, and gone at the end. Along [`Self::off_to`].
    pub off_mm: f64,
    /// Largest turn off its way, radians.
    pub off_rad: f64,
    /// Direction in which the hand is off, of any length, and axis about which it is turned off.
    pub off_to: DVec3,
    /// Amplitude of the tremor, mm.
    pub tremor_mm: f64,
    /// Frequency of the tremor, Hz.
    pub tremor_hz: f32,
}

impl Default for Manner {
    /// 40 mm/s, 0.5 mm and 0.5° off, and a tremor of 0.2 mm at 10 Hz.
    fn default() -> Self {
        Self {
            speed_mm_s: 40.0,
            speed_rad_s: 1.0,
            off_mm: 0.5,
            off_rad: 0.5f64.to_radians(),
            off_to: DVec3::new(0.6, -0.64, 0.48),
            tremor_mm: 0.2,
            tremor_hz: 10.0,
        }
    }
}

/// Targets of the hand along an insertion, mm, with their ticks.
pub(crate) struct Way {
    pub keys: Vec<(u32, DAffine3)>,
}

impl Way {
    pub fn new(model: &CadModel, insertion: &Insertion, manner: &Manner) -> Self {
        let center = model.shapes[model.parts[insertion.part].shape].center_of_mass;
        // The handle is at the centre of mass, and turned as the world at the grab.
        let grip = insertion.way[0].inverse()
            * DAffine3::from_translation(insertion.way[0].transform_point3(center));
        let timed = timed(
            &insertion.way.iter().map(|pose| *pose * grip).collect::<Vec<_>>(),
            manner,
        );
        let end = timed.last().map_or(0.0, |(t, _)| *t);
        let key = |&(t, pose): &(f64, DAffine3)| {
            let share = if t < OFF_AFTER * end {
                t / (OFF_AFTER * end)
            } else {
                (end - t) / ((1.0 - OFF_AFTER) * end).max(f64::MIN_POSITIVE)
            };
            ((t * TICK_HZ).round() as u32, off_by(&pose, share, manner))
        };
        let mut keys: Vec<(u32, DAffine3)> = timed.iter().map(key).collect();
        // Of keys in the same tick the last one counts: the way ends at its end.
        keys.dedup_by(|later, earlier| {
            let same = later.0 == earlier.0;
            if same {
                earlier.1 = later.1;
            }
            same
        });
        Self { keys }
    }

    /// Where the hand takes the part.
    pub fn grip(&self) -> DAffine3 {
        self.keys[0].1
    }

    /// The way back from where the hand is after it.
    pub fn back(&self, from: DAffine3) -> Vec<(u32, DAffine3)> {
        let end = self.keys.last().map_or(0, |(tick, _)| *tick);
        let mut keys: Vec<_> = self
            .keys
            .iter()
            .rev()
            .map(|(tick, pose)| (end - tick, *pose))
            .collect();
        keys[0].1 = from;
        keys
    }
}

/// Timed targets in scripts as long as a board takes, each starting where the one before ends.
pub(crate) fn scripts(keys: &[(u32, DAffine3)]) -> Vec<Vec<(u32, DAffine3)>> {
    let mut scripts = Vec::new();
    let mut first = 0;
    while first + 1 < keys.len() {
        let last = (first + MAX_KEYFRAMES - 1).min(keys.len() - 1);
        let start = keys[first].0;
        scripts.push(
            keys[first..=last]
                .iter()
                .map(|(tick, pose)| (tick - start, *pose))
                .collect(),
        );
        first = last;
    }
    scripts
}

/// Poses with the times at which a hand reaches them, and one more where it is off its way by the full amount.
fn timed(poses: &[DAffine3], manner: &Manner) -> Vec<(f64, DAffine3)> {
    let mut t = 0.0;
    let mut timed = vec![(t, poses[0])];
    for pair in poses.windows(2) {
        let (slide, turn) = between(&pair[0], &pair[1]);
        t += (slide.length() / manner.speed_mm_s).max(turn.length() / manner.speed_rad_s);
        timed.push((t, pair[1]));
    }
    let off = OFF_AFTER * t;
    if let Some(after) = timed
        .iter()
        .position(|(t, _)| *t > off)
        .filter(|after| *after > 0)
    {
        let ((t0, a), (t1, b)) = (timed[after - 1], timed[after]);
        let (slide, turn) = between(&a, &b);
        let share = (off - t0) / (t1 - t0);
        let turn = DQuat::from_scaled_axis(turn * share);
        let pose = DAffine3::from_rotation_translation(turn * rotation(&a), a.translation + slide * share);
        timed.insert(after, (off, pose));
    }
    timed
}

/// Translation and rotation vector from one pose to another.
pub(crate) fn between(a: &DAffine3, b: &DAffine3) -> (DVec3, DVec3) {
    let turn = rotation(b) * rotation(a).inverse();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    (b.translation - a.translation, turn.to_scaled_axis())
}

pub(crate) fn rotation(pose: &DAffine3) -> DQuat {
    DQuat::from_mat3(&pose.matrix3).normalize()
}

/// A pose with the hand off it by this share of the most.
fn off_by(pose: &DAffine3, share: f64, manner: &Manner) -> DAffine3 {
    let to = manner.off_to.normalize_or(DVec3::X);
    let turn = DQuat::from_axis_angle(to, manner.off_rad * share);
    DAffine3::from_rotation_translation(
        turn * rotation(pose),
        pose.translation + to * (manner.off_mm * share),
    )
}

#[cfg(test)]
mod tests {
    use mortise_brep::{Part, Shape};

    use super::*;

    /// A part whose centre of mass is beside its origin.
    fn model(center_of_mass: DVec3) -> CadModel {
        let shape = Shape {
            center_of_mass,
            ..Shape::default()
        };
        let part = Part {
            name: "part".into(),
            path: Vec::new(),
            shape: 0,
            placement: DAffine3::IDENTITY,
            color: None,
        };
        CadModel {
            parts: vec![part],
            shapes: vec![shape],
            ..CadModel::default()
        }
    }

    fn pose(random: &mut fastrand::Rng) -> DAffine3 {
        let mut vector =
            |size: f64| size * (2.0 * DVec3::new(random.f64(), random.f64(), random.f64()) - 1.0);
        DAffine3::from_rotation_translation(DQuat::from_scaled_axis(vector(0.3)), vector(60.0))
    }

    /// On any way the hand starts and ends on it, is off by no more than it may, and no faster than its speed allows; its scripts follow each other.
    #[test]
    fn a_hand_starts_and_ends_on_its_way() {
        let mut random = fastrand::Rng::with_seed(5);
        for count in 2..60 {
            let center = pose(&mut random).translation;
            let way: Vec<DAffine3> = (0..count).map(|_| pose(&mut random)).collect();
            let insertion = Insertion {
                with: Vec::new(),
                part: 0,
                onto: Vec::new(),
                way: way.clone(),
            };
            let manner = Manner::default();
            let keys = Way::new(&model(center), &insertion, &manner).keys;
            let at = |pose: &DAffine3| pose.transform_point3(center);
            let (first, last) = (keys[0], keys[keys.len() - 1]);
            assert_eq!(first.0, 0);
            assert!(first.1.translation.distance(at(&way[0])) < 1e-9);
            assert!(last.1.translation.distance(at(&way[count - 1])) < 1e-6);
            // Turned as the part is since the grab.
            let turned = rotation(&way[count - 1]) * rotation(&way[0]).inverse();
            assert!(rotation(&last.1).angle_between(turned) < 1e-6);
            for pair in keys.windows(2) {
                let ticks = f64::from(pair[1].0 - pair[0].0);
                assert!(ticks > 0.0);
                let (slide, turn) = between(&pair[0].1, &pair[1].1);
                // Half a tick is rounded at either end, and the hand leaves its way meanwhile.
                let seconds = (ticks + 1.0) / TICK_HZ;
                assert!(slide.length() <= manner.speed_mm_s * seconds + manner.off_mm + 1e-9);
                assert!(turn.length() <= manner.speed_rad_s * seconds + manner.off_rad + 1e-9);
            }
            for corner in &way {
                let off = keys.iter().map(|(_, key)| key.translation.distance(at(corner)));
                assert!(off.fold(f64::INFINITY, f64::min) <= manner.off_mm + 1e-9);
            }
            let parts = scripts(&keys);
            let mut ends = first.1;
            let mut ticks = 0;
            for script in &parts {
                assert!((2..=MAX_KEYFRAMES).contains(&script.len()));
                assert_eq!((script[0].0, script[0].1), (0, ends));
                (ticks, ends) = (ticks + script[script.len() - 1].0, script[script.len() - 1].1);
            }
            assert_eq!((ticks, ends), last);
        }
    }
}
