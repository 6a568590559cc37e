//! Random convex pairs, probed near touching, against separating axes and GJK.

use glam::{DAffine3, DQuat, DVec3};
use mortise_scenario::probe::{NamedPose, ProbeRow, ProbeScene, Resolution};

use crate::LabError;
use crate::convex::Convex;
use crate::figures::{Plan, Row};
use crate::parallel::trials;
use crate::separation::{overlap, signed_distance_mm};
use crate::step_text::StepText;

/// Distance by which a wrong answer differs from a right one, mm.
const CLEAR_MM: f64 = 0.01;
/// Largest error of a distance called exact, mm.
const EXACT_MM: f64 = 1e-3;
/// Pairs and poses of each, in the full and in the shorter form.
const PAIRS: usize = 250;
const PAIRS_QUICK: usize = 24;
const POSES: usize = 400;
const POSES_QUICK: usize = 200;
/// Longest sides of the solids, mm.
const LENGTHS_MM: [f64; 2] = [5.0, 200.0];
/// Depths and gaps, mm, drawn evenly in their logarithm.
const NEAR_MM: [f64; 2] = [1e-3, 3.0];

/// Answers that were wrong, of those probed.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    poses: usize,
    overlapping: usize,
    /// A gap reported where they overlap.
    gaps: usize,
    /// Contact reported where they are apart.
    ghosts: usize,
    /// Distances called exact that are off.
    inexact: usize,
    /// Largest error of a distance called exact, mm.
    worst_mm: f64,
}

impl Tally {
    fn count(&mut self, truth_mm: f64, row: &ProbeRow) {
        self.poses += 1;
        self.overlapping += usize::from(truth_mm < 0.0);
        self.gaps += usize::from(truth_mm < -CLEAR_MM && row.distance_mm > 0.0);
        let contact = row.contacts > 0 || row.distance_mm <= 0.0;
        self.ghosts += usize::from(truth_mm > CLEAR_MM && contact);
        if row.resolution == Resolution::Exact {
            let error = (row.distance_mm - truth_mm).abs();
            self.inexact += usize::from(error > EXACT_MM);
            if error > EXACT_MM {
                eprintln!("true distance {truth_mm:+.6} mm: {row}");
            }
            self.worst_mm = self.worst_mm.max(error);
        }
    }

    fn add(self, other: Self) -> Self {
        Self {
            poses: self.poses + other.poses,
            overlapping: self.overlapping + other.overlapping,
            gaps: self.gaps + other.gaps,
            ghosts: self.ghosts + other.ghosts,
            inexact: self.inexact + other.inexact,
            worst_mm: self.worst_mm.max(other.worst_mm),
        }
    }
}

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (pairs, poses) = if plan.quick {
        (PAIRS_QUICK, POSES_QUICK)
    } else {
        (PAIRS, POSES)
    };
    let all = trials(pairs, |pair| probed(pair, poses))?;
    let tally = all.into_iter().fold(Tally::default(), Tally::add);
    let what = |what: &str| {
        format!(
            "{} poses of {pairs} random convex pairs, aspect ratios to 1 : 200, default bake: {what}",
            tally.poses
        )
    };
    let count = |of: &str, value: usize| Row::exactly(what(of), value as f64, "poses", 0.0);
    out(count(
        "a gap reported where they overlap by over 10 µm",
        tally.gaps,
    ));
    out(count(
        "contact reported where they are over 10 µm apart",
        tally.ghosts,
    ));
    out(count(
        &format!(
            "called exact and off by over 1 µm (worst {:.1} µm)",
            1e3 * tally.worst_mm
        ),
        tally.inexact,
    ));
    let share = 100.0 * tally.overlapping as f64 / tally.poses as f64;
    out(Row::within(what("overlapping"), share, "%", 20.0, 80.0));
    Ok(())
}

/// Answers at random poses of pair `index`.
fn probed(index: usize, count: usize) -> Result<Tally, LabError> {
    let mut random = fastrand::Rng::with_seed(index as u64);
    let [least, most] = LENGTHS_MM;
    let length = least * (most / least).powf(random.f64());
    // The partner is between a quarter and four times as long.
    let partner = (length * 4f64.powf(2.0 * random.f64() - 1.0)).clamp(least, most);
    let fixed = Convex::random(index, length, &mut random);
    let moving = Convex::random(index / 6 + index, partner, &mut random);
    let scene = baked(&fixed, &moving)?;
    let pair = scene.pair("moving", Some("fixed"))?;
    let poses: Vec<NamedPose> = (0..count).map(|_| near(&fixed, &moving, &mut random)).collect();
    let rows = scene.probe_all(pair, &poses)?;
    let mut tally = Tally::default();
    for (pose, row) in poses.iter().zip(&rows) {
        let truth = signed_distance_mm(&fixed, &moving, &placed(pose));
        tally.count(truth, row);
    }
    if tally.gaps + tally.ghosts + tally.inexact > 0 {
        eprintln!("convex pair {index}: {tally:?}");
    }
    Ok(tally)
}

/// The two solids with the default bake, apart from each other.
fn baked(fixed: &Convex, moving: &Convex) -> Result<ProbeScene, LabError> {
    let mut text = StepText::new();
    for (name, solid, at) in [
        ("fixed", fixed, 0.0),
        ("moving", moving, 1.0 + fixed.radius() + moving.radius()),
    ] {
        let written = solid.write(&mut text);
        text.part(name, written, DAffine3::from_translation(DVec3::Z * at));
    }
    Ok(ProbeScene::load(text.file()?.path(), None)?)
}

/// The pose that the probe sees: rounded to single precision, in metres.
pub(super) fn rounded(position_mm: DVec3, orientation: DQuat) -> NamedPose {
    NamedPose {
        name: String::new(),
        position_mm: 1e3 * (1e-3 * position_mm).as_vec3().as_dvec3(),
        orientation: orientation.as_quat().as_dquat(),
    }
}

/// The rigid motion of a pose.
pub(super) fn placed(pose: &NamedPose) -> DAffine3 {
    DAffine3::from_rotation_translation(pose.orientation.normalize(), pose.position_mm)
}

fn unit(random: &mut fastrand::Rng) -> DVec3 {
    loop {
        let v = DVec3::from_array([0; 3].map(|_| 2.0 * random.f64() - 1.0));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A random pose at which the solids nearly touch: the moving one, turned at random, is shifted along a random line through the fixed one to where they
/// touch, then by a gap or depth.
fn near(fixed: &Convex, moving: &Convex, random: &mut fastrand::Rng) -> NamedPose {
    let turn = DQuat::from_axis_angle(unit(random), std::f64::consts::TAU * random.f64());
    let line = unit(random);
    // Any point of either solid may come near: the line joins a point of each.
    let inner = |solid: &Convex, random: &mut fastrand::Rng| {
        let [p, q] = [0; 2].map(|_| solid.support(unit(random)));
        p.lerp(q, random.f64())
    };
    let from = inner(fixed, random) - turn * inner(moving, random);
    let at = |t: f64| DAffine3::from_rotation_translation(turn, from + line * t);
    let (mut inside, mut outside) = (0.0, 2.0 * (fixed.radius() + moving.radius()));
    while outside - inside > 1e-4 {
        let middle = 0.5 * (inside + outside);
        if overlap(fixed, moving, &at(middle)) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    let [least, most] = NEAR_MM;
    let by = least * (most / least).powf(random.f64());
    let pose = at(outside + if random.bool() { by } else { -by });
    rounded(pose.translation, turn)
}
