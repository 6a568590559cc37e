//! Energy that targets deliver to the operator: at most 10 µJ beyond what the operator supplied, over any interval, for any sequence of targets.
//!
//! The observer stands outside of the law and sums in double precision on the handle's true motion: see [`mortise_haptics::observer`] for the storage
//! function and the derivation. In short: the port is the handle, W = F·Δp + τ·Δφ of each held wrench; S, the energy stored on the handle's side of
//! the targets, is the coupling's potential and the kinetic energy of the object. Neither the potential of contacts nor that of targets counts:
//! energy not counted as stored counts as generated, so both only make the bound harder to meet. The energy unaccounted for is
//!
//! E = max over all a < b of Σ_{a ≤ k < b} W_k − S_a
//!
//! and its limit is 10 µJ: without a term for the tick, the look-ahead, the encoders or the number of targets.

use crate::support;
use crate::trial;
use std::sync::LazyLock;

use crate::support::hand::Hand;
use crate::support::image::Image;
use crate::support::{BLOCK_HALF, PEG_HALF, axis_on_axis};
use crate::trial::{Bench, Seen, play};
use glam::{DQuat, DVec3};
use mortise_haptics::observer::{Observer, Place, Rise};
use mortise_haptics::{GuidanceMethod, Quat, Settings, State, Vec3, Wrench, tick};
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};
use proptest::prelude::*;

/// Limit on the energy delivered beyond what the operator supplied, J.
const LIMIT_J: f64 = 10e-6;
/// The peg 10 mm in its hole with 1 mm of clearance, and 40 mm above it.
static HOLE: LazyLock<Image> = LazyLock::new(|| support::exact_hole_and_peg(1e-3, 10e-3));
static ABOVE: LazyLock<Image> = LazyLock::new(|| support::exact_hole_and_peg(1e-3, -40e-3));

/// Sequences of two seconds, every second one in contact with the hole.
fn sequences(seeds: std::ops::Range<u64>, settings: &Settings, guided: bool) -> Vec<Seen> {
    let (hole, above) = (HOLE.open(), ABOVE.open());
    seeds
        .map(|seed| {
            let (scene, range) = if seed % 2 == 0 {
                (&hole, 3e-3)
            } else {
                (&above, 30e-3)
            };
            let bench = Bench {
                scene,
                part: 1,
                fixed: 0,
                range,
                ticks: 2000,
                guided,
            };
            play(&bench, settings, seed)
        })
        .collect()
}

fn worst(all: &[Seen]) -> &Seen {
    (all.iter().max_by(|a, b| a.given_j.total_cmp(&b.given_j))).expect("at least one sequence")
}

#[test]
fn no_sequence_of_targets_delivers_more_than_ten_microjoules_net() {
    let all = sequences(0..300, &Settings::default(), true);
    let worst = worst(&all);
    println!("{worst:?}");
    assert!(worst.given_j <= LIMIT_J, "{worst:?}");
    // Both methods, both kinds of hand, at rest and moving, with exact readings and in counts, and targets that engaged.
    assert!(
        all.iter()
            .filter(|seen| seen.engaged > 0.5 && seen.taken > 3)
            .count()
            > 150
    );
    for kind in [
        |seen: &Seen| seen.moving,
        |seen: &Seen| seen.counted,
        |seen: &Seen| seen.hold == trial::Hold::Position,
        |seen: &Seen| seen.method == GuidanceMethod::Thesis,
        |seen: &Seen| seen.touched > 100,
    ] {
        let count = all.iter().filter(|seen| kind(seen)).count();
        assert!((30..270).contains(&count), "{count}");
    }
}

/// The same hands without targets, and with targets whose energy is not bounded.
#[test]
fn the_observer_detects_unbounded_targets_and_nothing_without_targets() {
    let mut settings = Settings::default();
    let alone = sequences(0..60, &settings, false);
    assert!(worst(&alone).given_j < 0.1 * LIMIT_J, "{:?}", worst(&alone));
    settings.passivity.initial_budget_j = f32::INFINITY;
    let free = sequences(0..60, &settings, true);
    assert!(worst(&free).given_j > 100.0 * LIMIT_J, "{:?}", worst(&free));
}

/// A handle on a spring and a damper with a given goal, and the observer.
struct Rig<'i> {
    scene: mortise_protocol::image::SceneImage<'i>,
    state: Box<State>,
    hand: Hand,
    observer: Observer,
    settings: Settings,
    peak_n: f32,
}

impl<'i> Rig<'i> {
    fn new(image: &'i Image, start: [f64; 3], settings: &Settings) -> Self {
        let scene = image.open();
        let mut state = Box::new(State::new());
        state.load_scene(&scene);
        let hand = Hand::at(start);
        state.grab(&scene, 1, &hand.pose()).unwrap();
        let observer = Observer::new(&scene, &state, settings, &place(&hand)).unwrap();
        Self {
            scene,
            state,
            hand,
            observer,
            settings: *settings,
            peak_n: 0.0,
        }
    }

    /// Runs some ticks while the hand rotates at this rate about y, rad/s.
    fn run(&mut self, ticks: u32, turning: f64) {
        for _ in 0..ticks {
            self.hand.angular = Vec3::new(0.0, turning as f32, 0.0);
            self.observer.look(&self.state);
            let out = tick(&mut self.state, &self.scene, &self.settings, &self.hand.input());
            let from = place(&self.hand);
            self.hand
                .advance(out.handle.force, f64::from(self.settings.period_s));
            let turn = Quat::from_rotation_y((turning * 1e-3) as f32);
            self.hand.orientation = (turn * self.hand.orientation).normalize();
            self.observer
                .tick(&self.state, &from, &place(&self.hand), &out.handle);
            self.peak_n = self.peak_n.max(out.handle.force.length());
        }
    }

    fn given_uj(&self) -> f64 {
        1e6 * self.observer.given_j()
    }
}

fn place(hand: &Hand) -> Place {
    Place {
        position: DVec3::from_array(hand.position),
        orientation: hand.orientation.as_dquat().normalize(),
    }
}

/// A way with the orientation of the part at the start: free to turn, straight, or a screw with a pitch of 3 mm.
fn path(number: u16) -> Path {
    Path {
        orientation: [0.0, 0.0, 0.0, 1.0],
        turn: match number % 3 {
            0 => PathTurn::Free,
            1 => PathTurn::Geared(0.0),
            _ => PathTurn::Geared(2094.4),
        },
        ends: number.is_multiple_of(2),
    }
}

fn beside(sequence: u16, off: Vec3, direction: Vec3) -> ConstraintTarget {
    ConstraintTarget {
        fixed: Feature {
            point: off.to_array(),
            direction: direction.normalize().to_array(),
        },
        ..axis_on_axis(sequence, 300)
    }
}

/// Above the block, at the peg's middle.
const START: [f64; 3] = [0.0, 0.0, BLOCK_HALF + PEG_HALF + 40e-3];

/// The part flies to its axis at its largest speed, which once dragged the hand by h·k: 2.6 mJ and 1 N.
#[test]
fn a_target_at_a_tenth_of_a_metre_does_not_drag_a_resting_hand() {
    for method in [GuidanceMethod::Capped, GuidanceMethod::Thesis] {
        let mut settings = Settings::default();
        settings.guidance.method = method;
        let mut rig = Rig::new(&ABOVE, START, &settings);
        rig.state
            .set_target(&beside(1, Vec3::new(0.1, 0.0, 0.0), Vec3::Z))
            .unwrap();
        rig.run(2500, 0.0);
        println!("{method:?}: {:.2} µJ, {} N", rig.given_uj(), rig.peak_n);
        assert!(
            rig.given_uj() <= 10.0 && rig.peak_n < 0.5,
            "{method:?}: {} µJ, {} N",
            rig.given_uj(),
            rig.peak_n
        );
    }
}

/// An axis that tilts in another direction every 0.4 s: once 0.66 mJ. Eight targets of all kinds at once likewise: 3.2 mJ.
#[test]
fn many_turning_targets_do_no_work_on_a_resting_hand() {
    let settings = Settings::default();
    let mut leaning = Rig::new(&ABOVE, START, &settings);
    let mut crowd = Rig::new(&ABOVE, START, &settings);
    let kinds = ConstraintKind::ALL;
    for i in 0..40u16 {
        let direction = |k: u16| {
            let a = 2.4 * f32::from(k);
            Vec3::new(a.cos(), a.sin(), 0.8 - 0.1 * f32::from(k % 16))
        };
        leaning
            .state
            .set_target(&beside(i + 1, Vec3::ZERO, direction(i)))
            .unwrap();
        leaning.run(400, 0.0);
        for k in 0..MAX_TARGETS as u16 {
            let target = ConstraintTarget {
                id: k,
                kind: kinds[usize::from(i + k) % kinds.len()],
                path: (kinds[usize::from(i + k) % kinds.len()] == ConstraintKind::Path).then(|| path(k)),
                force_cap: 10.0,
                ..beside(i + 1, 0.05 * direction(3 * k + i), direction(k + i))
            };
            // While the last targets fade there is no space left.
            let _ = crowd.state.set_target(&target);
        }
        crowd.run(400, 0.0);
    }
    println!(
        "leaning {:.2} µJ, crowd {:.2} µJ",
        leaning.given_uj(),
        crowd.given_uj()
    );
    assert!(leaning.given_uj() <= 10.0, "{}", leaning.given_uj());
    assert!(crowd.given_uj() <= 10.0, "{}", crowd.given_uj());
}

/// Guidance acts on a hand that supplies energy: pressed off its axis it feels the target's whole force, and when released it is pulled back with the
/// energy stored in the coupling, in either direction, repeatedly.
#[test]
fn a_hand_that_presses_feels_the_target_and_is_pulled_back() {
    let settings = Settings::default();
    let mut rig = Rig::new(&ABOVE, START, &settings);
    let mut sequence = 0;
    let mut guided = |rig: &mut Rig<'_>, ticks: u32, goal: f64| {
        rig.hand.goal[0] = goal;
        let from = rig.hand.position[0];
        for _ in 0..ticks / 100 {
            sequence += 1;
            rig.state
                .set_target(&beside(sequence, Vec3::ZERO, Vec3::Z))
                .unwrap();
            rig.peak_n = 0.0;
            rig.run(100, 0.0);
        }
        // Of the last tenth of a second.
        (rig.peak_n, rig.hand.position[0] - from)
    };
    guided(&mut rig, 500, 0.0);
    for way in [1.0, -1.0, 1.0, -1.0] {
        // The hand's 400 N/m against the coupling's 1000 N/m: 7 mm press with 2 N.
        let (force, moved) = guided(&mut rig, 600, way * 7e-3);
        assert!(
            (1.9..2.1).contains(&force) && way * moved > 1.5e-3,
            "{force} N, {moved} m"
        );
        let (pose, _) = rig.state.object().unwrap();
        assert!(pose.position.x.abs() < 5e-6, "{}", pose.position.x);
        // Without the hand's spring the handle returns by the stretch of the coupling.
        let spring = std::mem::replace(&mut rig.hand.spring_n_per_m, 0.0);
        let (_, back) = guided(&mut rig, 600, 0.0);
        rig.hand.spring_n_per_m = spring;
        println!("{way}: {force} N, back by {:.2} mm", 1e3 * back);
        assert!(-way * back > 0.8 * 2e-3, "{back}");
        guided(&mut rig, 600, 0.0);
    }
    assert!(rig.given_uj() <= 10.0, "{}", rig.given_uj());
}

/// The account's subtraction for counting encoders is less than what a hand with tremor supplies anew: of 2 N at most 2 % are lost after ten seconds
/// (1.98 N remain).
#[test]
fn encoder_counts_do_not_erode_a_pressed_force() {
    const COUNT: f64 = 5e-6;
    let mut settings = Settings::default();
    settings.passivity.position_count_m = COUNT as f32;
    let mut rig = Rig::new(&ABOVE, START, &settings);
    let (mut last, mut speed) = (rig.hand.position, Vec3::ZERO);
    let mut felt = [0.0f64; 2];
    for t in 0..12_000u32 {
        if t.is_multiple_of(100) {
            let target = beside((t / 100 + 1) as u16, Vec3::ZERO, Vec3::Z);
            rig.state.set_target(&target).unwrap();
        }
        let tremor = 0.05e-3 * (0.055 * f64::from(t)).sin();
        rig.hand.goal[0] = 7e-3 * (f64::from(t) / 1000.0).min(1.0) + tremor;
        let reading = rig.hand.position.map(|x| (x / COUNT).round() * COUNT);
        let rate = Vec3::from_array(std::array::from_fn(|a| ((reading[a] - last[a]) * 1e3) as f32));
        speed += (rate - speed) * 0.25;
        last = reading;
        let mut input = rig.hand.input();
        input.handle.position = support::hand::vec3(reading);
        input.handle_twist.linear = speed;
        rig.observer.look(&rig.state);
        let out = tick(&mut rig.state, &rig.scene, &settings, &input);
        let from = place(&rig.hand);
        rig.hand.advance(out.handle.force, 1e-3);
        rig.observer
            .tick(&rig.state, &from, &place(&rig.hand), &out.handle);
        // Mean of the second second and of the last.
        for (sum, first) in felt.iter_mut().zip([1000, 11_000]) {
            if (first..first + 1000).contains(&t) {
                *sum -= 1e-3 * f64::from(out.handle.force.x);
            }
        }
    }
    println!("{felt:?} N, {:.2} µJ", rig.given_uj());
    assert!((felt[0] - 2.0).abs() < 0.05, "{felt:?}");
    assert!((felt[1] - felt[0]).abs() < 0.04, "{felt:?}");
    assert!(rig.given_uj() <= 10.0, "{}", rig.given_uj());
}

/// A hand at rest 0.4 mm and 2° off an axis whose target engages and releases 10 times.
#[test]
fn a_hand_at_rest_receives_no_energy_while_the_part_is_guided() {
    let mut settings = Settings::default();
    let mut delivered_uj = |initial_budget_j: f32| {
        settings.passivity.initial_budget_j = initial_budget_j;
        let start = [0.0, 0.0, BLOCK_HALF + PEG_HALF - 10e-3];
        let mut rig = Rig::new(&HOLE, start, &settings);
        rig.hand.goal[0] = 0.4e-3;
        rig.run(500, 0.07);
        rig.run(500, 0.0);
        for i in 0..10 {
            rig.state.set_target(&axis_on_axis(i + 1, 300)).unwrap();
            rig.run(290, 0.0);
            let (pose, _) = rig.state.object().unwrap();
            assert!(pose.position.x.abs() < 2e-6, "{}", pose.position.x);
            rig.run(1210, 0.0);
        }
        rig.given_uj()
    };
    let (bounded, free) = (
        delivered_uj(Settings::default().passivity.initial_budget_j),
        delivered_uj(f32::INFINITY),
    );
    println!("{bounded:.2} µJ, without the account {free:.2} µJ");
    assert!(bounded <= 10.0, "{bounded} µJ");
    assert!(free > 3.0 * bounded, "{free} µJ");
}

/// Wrenches already sent to late motors are covered before another is given.
#[test]
fn wrenches_pending_in_late_motors_are_covered_first() {
    for delay in [1u32, 2, 4] {
        let mut settings = Settings::default();
        settings.passivity.delay_ticks = delay;
        let mut rig = Rig::new(&ABOVE, START, &settings);
        let mut pending = std::collections::VecDeque::from(vec![Wrench::ZERO; delay as usize]);
        for t in 0..6000u32 {
            if t.is_multiple_of(400) {
                let side = if t.is_multiple_of(800) { 0.05 } else { -0.05 };
                let target = beside((t / 400 + 1) as u16, Vec3::new(side, 0.0, 0.0), Vec3::Z);
                let _ = rig.state.set_target(&target);
            }
            rig.observer.look(&rig.state);
            let out = tick(&mut rig.state, &rig.scene, &settings, &rig.hand.input());
            pending.push_back(out.handle);
            let acts = pending.pop_front().unwrap();
            let from = place(&rig.hand);
            rig.hand.advance(acts.force, 1e-3);
            rig.observer.tick(&rig.state, &from, &place(&rig.hand), &acts);
        }
        println!("{delay} late: {:.2} µJ", rig.given_uj());
        assert!(rig.given_uj() <= 10.0, "{delay}: {} µJ", rig.given_uj());
    }
}

proptest! {
    /// The one-pass result equals that of trying every interval.
    #[test]
    fn the_rise_is_the_largest_over_any_interval(
        ticks in prop::collection::vec((0.0f64..2.0, -1.0f64..1.0), 1..40),
    ) {
        let mut rise = Rise::default();
        let mut found = 0.0f64;
        for (a, (stored, _)) in ticks.iter().enumerate() {
            let mut given = 0.0;
            for (_, work) in &ticks[a..] {
                given += work;
                // Nothing was stored before the first tick.
                found = found.max(given - if a == 0 { 0.0 } else { *stored });
            }
        }
        for (stored, work) in &ticks {
            rise.stored(*stored);
            rise.gave(*work);
        }
        prop_assert!((rise.most() - found).abs() < 1e-12, "{} {}", rise.most(), found);
    }
}

/// For a coupling alone the observer's storage and work are those of a spring and a damper: pressed onto a fixed part quickly and released slowly,
/// the hand gets back the stored energy and none is generated; a push unaccounted for is detected to the last microjoule.
#[test]
fn the_observer_counts_springs_as_stored_and_pushes_as_delivered() {
    let settings = Settings::default();
    let scene = ABOVE.open();
    let mut state = Box::new(State::new());
    state.load_scene(&scene);
    let at = |x: f64| Place {
        position: DVec3::new(x, 0.0, START[2]),
        orientation: DQuat::IDENTITY,
    };
    state.grab(&scene, 1, &at(0.0).pose()).unwrap();
    let mut observer = Observer::new(&scene, &state, &settings, &at(0.0)).unwrap();
    let push = |x: f64| Wrench {
        force: Vec3::new(x as f32, 0.0, 0.0),
        torque: Vec3::ZERO,
    };
    // No tick runs: the object stands still and the handle moves out 2 mm against 1 N/mm and back.
    let k = f64::from(settings.coupling.k_t_n_per_m);
    let step = 1e-6;
    let path: Vec<f64> = (0..2000).map(|i| step * f64::from(i)).collect();
    for pair in path.windows(2) {
        observer.look(&state);
        observer.tick(
            &state,
            &at(pair[0]),
            &at(pair[1]),
            &push(-k * 0.5 * (pair[0] + pair[1])),
        );
    }
    for pair in path.windows(2).rev() {
        observer.look(&state);
        observer.tick(
            &state,
            &at(pair[1]),
            &at(pair[0]),
            &push(-k * 0.5 * (pair[0] + pair[1])),
        );
    }
    assert!(observer.given_j() < 1e-9, "{}", observer.given_j());
    observer.tick(&state, &at(0.0), &at(50e-6), &push(0.2));
    assert!(
        (observer.given_j() - 10e-6).abs() < 1e-9,
        "{}",
        observer.given_j()
    );
}
