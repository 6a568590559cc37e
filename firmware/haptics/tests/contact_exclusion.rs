//! Contact exclusions: mating faces that an engaged target keeps apart are not searched, and the result is the same to the bit.

use crate::support;
use crate::support::hand::{Hand, run};
use crate::support::solids::{Block, Bolt};
use crate::support::{BLOCK_HALF, PEG_HALF, axis_on_axis};
use mortise_haptics::{Output, Quat, Settings, State, Vec3};
use mortise_protocol::image::{Lookup, Nearby};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget};
use proptest::prelude::*;

/// Result of a run with targets, tick by tick.
struct Run {
    outputs: Vec<Output>,
    excluded_ticks: usize,
}

/// Budget for all points, as decimation depends on the work; in a tick all leaves get an exclusion query.
const AMPLE: u32 = 20_000;
/// Budget for all points still, but only some leaves get an exclusion query in a tick.
const SCANT: u32 = 8_000;

/// Runs a hand steered by `script`, with a target set, refreshed and left to expire; with contact exclusions or without.
fn play(
    clearance: f64,
    ticks: u32,
    budget: u32,
    exclusions: bool,
    mut script: impl FnMut(u32, &mut Hand),
) -> Run {
    let image = support::exact_hole_and_peg(clearance, 10e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut settings = Settings::default();
    settings.guidance.exclusions = exclusions;
    settings.contact.point_budget = budget;
    let mut hand = Hand::at([0.0, 0.0, BLOCK_HALF + PEG_HALF - 10e-3]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let mut played = Run {
        outputs: Vec::new(),
        excluded_ticks: 0,
    };
    for t in 0..ticks {
        if t.is_multiple_of(100) && t < ticks / 2 {
            state
                .set_target(&axis_on_axis((t / 100 + 1) as u16, 300))
                .unwrap();
        }
        let (out, _) = run(&mut state, &scene, &settings, &mut hand, 1, |_, hand, _| {
            script(t, hand)
        });
        played.excluded_ticks += usize::from(out.guidance.exclusions > 0);
        played.outputs.push(out);
    }
    played
}

/// Asserts equality to the bit, work apart.
fn same(with: &Run, without: &Run) {
    assert_eq!(without.excluded_ticks, 0);
    for (t, (a, b)) in with.outputs.iter().zip(&without.outputs).enumerate() {
        let plain = |out: &Output| {
            let mut out = out.clone();
            out.work = Default::default();
            out.guidance.exclusions = 0;
            out
        };
        assert_eq!(plain(a), plain(b), "tick {t}");
    }
}

/// Moves into the hole and to and fro in it, tilting and rotating; the target expires half-way.
fn script(t: u32, hand: &mut Hand, offset: f64, tilt: f32, faster: f64) {
    let time = f64::from(t) * 1e-3;
    let tremor = 0.2e-3 * (core::f64::consts::TAU * 10.0 * time).sin();
    let axis = Vec3::new(0.6, 0.8, 0.3);
    hand.orientation = Quat::from_axis_angle(axis.normalize(), tilt * (time / 0.3).min(1.0) as f32);
    hand.goal = [
        offset * (time / 0.3).min(1.0) + tremor,
        0.3 * tremor,
        BLOCK_HALF + PEG_HALF - 10e-3 - 8e-3 * (faster * time).sin(),
    ];
}

#[test]
fn an_exclusion_changes_no_bit() {
    for (clearance, budget) in [
        (1e-3, AMPLE),
        (20e-6, AMPLE),
        (20e-6, SCANT),
        (0.0, AMPLE),
        (0.0, SCANT),
    ] {
        let way = |t: u32, hand: &mut Hand| script(t, hand, 1e-3, 0.035, 3.0);
        let (with, without) = (
            play(clearance, 2400, budget, true, way),
            play(clearance, 2400, budget, false, way),
        );
        same(&with, &without);
        assert!(with.excluded_ticks > 800, "{}", with.excluded_ticks);
        // From its formation until the first missing refresh.
        let points = |run: &Run| {
            run.outputs[400..1200]
                .iter()
                .map(|out| out.work.points)
                .sum::<u32>()
        };
        let (few, all) = (points(&with), points(&without));
        println!(
            "{clearance}, {budget}: excluded in {} ticks, {few} points against {all}",
            with.excluded_ticks
        );
        // With 1 mm of clearance leaves are seldom searched in any case; in a close fit in every tick.
        let share = if clearance > 0.1e-3 { 0.5 } else { 0.3 };
        assert!(f64::from(few) < share * f64::from(all), "{few} {all}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// For any motion of the hand: pulled off against the cap, torn out, pushed through.
    #[test]
    fn an_exclusion_changes_no_bit_for_any_motion_of_the_hand(
        clearance in prop_oneof![Just(0.0), 0.0..200e-6],
        budget in prop_oneof![Just(AMPLE), Just(SCANT)],
        offset in -12e-3..12e-3f64,
        tilt in -0.2f32..0.2,
        faster in 1.0..30.0f64,
    ) {
        let way = |t: u32, hand: &mut Hand| script(t, hand, offset, tilt, faster);
        same(&play(clearance, 900, budget, true, way), &play(clearance, 900, budget, false, way));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// A region reported to hold only the hole's face: every field query in it finds that face or none, and the report reads no more than allowed.
    #[test]
    fn a_region_of_one_face_has_no_other(
        low in prop::array::uniform3(-4.0f32..80.0),
        size in prop_oneof![prop::array::uniform3(0.0f32..4.0), prop::array::uniform3(0.0f32..24.0)],
        within in prop::collection::vec(prop::array::uniform3(0.0f32..1.0), 50),
        most in prop_oneof![Just(u32::MAX), 0u32..200],
    ) {
        let image = &*IMAGE;
        let scene = image.open();
        let field = scene.shape_of_part(0).field;
        let high = core::array::from_fn(|a| low[a] + size[a]);
        let mut left = most;
        let only = field.only(low, high, &mut left, |face| face == 3);
        prop_assert!(left <= most);
        // The limit on reads decides whether there is an answer, not which.
        let of_all = field.only(low, high, &mut u32::MAX.clone(), |face| face == 3);
        prop_assert!(of_all || !only);
        let mut left = most;
        let all = field.all_at(low, high, &mut left, 3);
        prop_assert!(left <= most && (only || !all));
        if only {
            for d in within {
                let record = field.record();
                let p = core::array::from_fn(|a| record.origin[a] + record.cell * (low[a] + size[a] * d[a]));
                match field.lookup(p) {
                    Lookup::Near(sample) => prop_assert_eq!(sample.nearby, Nearby::Face(3)),
                    Lookup::Far { inside, .. } => prop_assert!(!inside && !all),
                }
            }
        }
    }
}

/// A bolt with a 5 mm head and a shaft of 25 mm, pushed into its hole with 5 N by a hand 1 mm and 2° off; with the planes' angle guided too, or not.
/// Returns its largest distances from its stop and its axis once there, m, and in how many of 500 ticks the head touches while the shaft is excluded.
fn bolted(play: f64, parallel: bool) -> ([f64; 2], u32) {
    let mut w = support::image::Writer::exact(0.5e-3);
    let block = w.shape(&Block {
        half: [15e-3, 15e-3, BLOCK_HALF],
        hole: support::HOLE,
        around: 64,
        across: 7,
    });
    let bolt = Bolt {
        radius: support::HOLE - 0.5 * play,
        head: 13e-3,
        half_length: PEG_HALF,
        head_height: 5e-3,
        around: 64,
    };
    let shape = w.shape(&bolt);
    w.part(block, false, [0.0; 3], support::UPRIGHT);
    // 2 mm in.
    let start = BLOCK_HALF + PEG_HALF - 2e-3;
    w.part(shape, true, [0.0, 0.0, start as f32], support::UPRIGHT);
    let image = w.finish();
    let scene = image.open();
    let landed = BLOCK_HALF - bolt.seat();
    let mut state = State::new();
    state.load_scene(&scene);
    let mut hand = Hand::at([0.0, 0.0, start]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let (mut off, mut felt) = ([0.0f64; 2], 0);
    for t in 0..4000u32 {
        if t.is_multiple_of(100) {
            let target = axis_on_axis((t / 100 + 1) as u16, 300);
            state.set_target(&target).unwrap();
            let planes = ConstraintTarget {
                id: 8,
                kind: ConstraintKind::Coplanar,
                faces: heapless::Vec::from_slice(&[(2, 0)]).unwrap(),
                ..target
            };
            if parallel {
                state.set_target(&planes).unwrap();
            }
        }
        let (out, _) = run(
            &mut state,
            &scene,
            &Settings::default(),
            &mut hand,
            1,
            |_, hand, _| {
                hand.orientation = Quat::from_rotation_y(0.035);
                // Goal so far below the stop that hand and coupling push with 5 N.
                let coupling = f64::from(Settings::default().coupling.k_t_n_per_m);
                let below = landed - 5.0 / hand.spring_n_per_m - 5.0 / coupling;
                let down = ((f64::from(t) - 200.0) / 2500.0).clamp(0.0, 1.0);
                hand.goal = [1e-3, 0.0, start + (below - start) * down];
            },
        );
        if t >= 3500 {
            let (pose, _) = state.object().unwrap();
            off[0] = off[0].max((f64::from(pose.position.z) - landed).abs());
            off[1] = off[1].max(f64::from(pose.position.truncate().length()));
            let on_top = out.pairs.iter().any(|p| (p.moving_face, p.static_face) == (2, 0));
            felt +=
                u32::from(on_top && out.guidance.exclusions == 1 && (out.handle.force.z - 5.0).abs() < 0.1);
        }
    }
    println!(
        "{parallel}: {:.2} um off the stop, {:.2} um off the axis",
        1e6 * off[0],
        1e6 * off[1]
    );
    (off, felt)
}

#[test]
fn a_bolts_head_lands_on_its_stop_and_stays_there() {
    for parallel in [false, true] {
        // With clearance in the hole the head alone touches: 64 points of 200 kN/m and more under 5 N.
        let (off, felt) = bolted(3e-3, parallel);
        assert!(off[0] < 1e-6 && off[1] < 5e-6, "{off:?}");
        assert_eq!(felt, 500, "ticks with the head on its stop");
        // In a close fit the rim meets the corner under the head, which interpolation at 0.5 mm rounds (the baker has it exact), and is pushed
        // sideways.
        let (off, _) = bolted(20e-6, parallel);
        assert!(off[0] < 50e-6 && off[1] < 50e-6, "{off:?}");
    }
}

static IMAGE: std::sync::LazyLock<support::image::Image> =
    std::sync::LazyLock::new(|| support::exact_hole_and_peg(20e-6, 10e-3));

/// Queries are not rejected everywhere: in the hole's middle, at its wall, the region holds the hole's face only.
#[test]
fn the_holes_wall_is_a_region_of_its_own() {
    let scene = IMAGE.open();
    let field = scene.shape_of_part(0).field;
    let only = |at: [f64; 3], reach: f32, this: u16| {
        let at = field.in_cells(at.map(|x| x as f32));
        let (low, high) = (at.map(|x| x - reach), at.map(|x| x + reach));
        field.only(low, high, &mut 1000, |face| face == this)
    };
    let wall = [support::HOLE, 0.0, 0.0];
    assert!(only(wall, 1.0, 3));
    assert!(!only(wall, 1.0, 0));
    let at = field.in_cells(wall.map(|x| x as f32));
    let all = |reach: f32| {
        let (low, high) = (at.map(|x| x - reach), at.map(|x| x + reach));
        field.all_at(low, high, &mut 10_000, 3)
    };
    // In the grid, and beyond it.
    assert!(all(1.0) && !all(1e3));
    // Two cells below the rim the cells decide where the bricks do not.
    let below = |cells: f64| [support::HOLE, 0.0, BLOCK_HALF - cells * 0.5e-3];
    assert!(!only(below(0.0), 1.0, 3));
    assert!(only(below(4.0), 1.0, 3));
}
