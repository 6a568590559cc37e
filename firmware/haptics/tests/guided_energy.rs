//! What targets that come, go and take hold again give the hand: no more than it has brought, and the endowment.

mod support;

use std::f64::consts::TAU;

use mortise_haptics::{GuidanceMethod, Quat, Settings, State, TargetError, Vec3, tick};
use mortise_protocol::message::{ConstraintTarget, Feature};
use proptest::prelude::*;
use support::hand::Hand;
use support::{BLOCK_HALF, PEG_HALF, axis_on_axis};

/// What a hand does for a while.
#[derive(Clone, Copy, Debug)]
struct Way {
    ticks: u32,
    /// Where it is then, m from the middle of the hole.
    goal: [f64; 3],
    /// How far it leans then, rad.
    lean: [f32; 2],
    /// It trembles by so much, m, and so often, Hz.
    tremor: (f64, f64),
}

/// What comes of the desktop, and when.
#[derive(Clone, Copy, Debug)]
struct Word {
    after: u32,
    id: u16,
    /// Where the axis is taken to be, m; `None`: the target is cleared.
    set: Option<[f32; 2]>,
    expiry: u16,
}

fn way() -> impl Strategy<Value = Way> {
    let aside = || prop_oneof![Just(0.0), -1.5e-3..1.5e-3f64];
    (
        200u32..1500,
        (aside(), aside(), -3e-3..3e-3f64),
        [-0.035f32..0.035, -0.035f32..0.035],
        (prop_oneof![Just(0.0), 0.0..0.3e-3f64], 5.0..12.0f64),
    )
        .prop_map(|(ticks, goal, lean, tremor)| Way {
            ticks,
            goal: goal.into(),
            lean,
            tremor,
        })
}

fn word() -> impl Strategy<Value = Word> {
    (
        0u32..400,
        0u16..3,
        prop::option::weighted(0.85, [-0.3e-3f32..0.3e-3, -0.3e-3f32..0.3e-3]),
        prop_oneof![Just(300u16), 1u16..600],
    )
        .prop_map(|(after, id, set, expiry)| Word {
            after,
            id,
            set,
            expiry,
        })
}

/// What was seen.
#[derive(Debug, Default)]
struct Seen {
    /// Most net work of the device on the hand at any time since the grab, J.
    given_j: f64,
    /// All that passed.
    passed_j: f64,
    /// Most that the endowment allows by then, J.
    allowed_j: f64,
    /// By how much that was exceeded, J.
    beyond_j: f64,
    /// Most that a tick can give before the account knows of it, J: of a spring that stores p, √(2·k·p)·v·h − p, at worst ½·k·(v·h)².
    tick_j: f64,
    /// What the step's look-ahead, h·k on the object's motion relative to the hand, hands on while next to nothing is left, J.
    ahead_j: f64,
    /// Largest force on the handle, N.
    peak_n: f64,
    engaged: f32,
}

/// Work of the torque on a hand that turns from one orientation to another.
fn turned(torque: Vec3, from: Quat, to: Quat) -> f64 {
    let q = (to * from.conjugate()).normalize();
    f64::from(torque.dot(q.to_scaled_axis()))
}

/// The peg in its hole, 1 mm of play; the hand goes its ways while words arrive, and rests a second in the end.
fn play(settings: &Settings, ways: &[Way], words: &[Word]) -> Seen {
    let scene = IMAGE.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let start = [0.0, 0.0, BLOCK_HALF + PEG_HALF - 10e-3];
    let mut hand = Hand::at(start);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    let period = f64::from(settings.period_s);
    let mut words = words.iter().peekable();
    let (mut due, mut sequence) = (0, 0u16);
    let (mut net, mut seen) = (0.0, Seen::default());
    let (mut ended, mut active) = (0.0, 0);
    let (mut from, mut leant) = (start, [0.0f32; 2]);
    let mut t = 0u32;
    let rest = ways.last().map(|way| Way { ticks: 1000, ..*way });
    for way in ways.iter().chain(&rest) {
        let goal: [f64; 3] = std::array::from_fn(|a| start[a] + way.goal[a]);
        for k in 0..way.ticks {
            while let Some(word) = words.next_if(|word| due + word.after <= t) {
                due += word.after;
                sequence += 1;
                match word.set {
                    None => state.clear_target(word.id),
                    Some([x, y]) => {
                        let target = ConstraintTarget {
                            id: word.id,
                            fixed: Feature {
                                point: [x, y, 0.0],
                                direction: [0.0, 0.0, 1.0],
                            },
                            ..axis_on_axis(sequence, word.expiry)
                        };
                        let taken = state.set_target(&target);
                        assert!(matches!(taken, Ok(()) | Err(TargetError::Full)));
                    }
                }
            }
            let s = f64::from(k + 1) / f64::from(way.ticks);
            let s = s * s * (3.0 - 2.0 * s);
            let tremor = way.tremor.0 * (TAU * way.tremor.1 * f64::from(t) * period).sin();
            hand.goal = std::array::from_fn(|a| from[a] + s * (goal[a] - from[a]));
            hand.goal[0] += tremor;
            let lean: [f32; 2] = std::array::from_fn(|a| leant[a] + s as f32 * (way.lean[a] - leant[a]));
            let out = tick(&mut state, &scene, settings, &hand.input());
            let before = hand.orientation;
            let work = hand.advance(out.handle.force, period);
            hand.orientation = Quat::from_scaled_axis(Vec3::new(lean[0], lean[1], 0.0));
            let work = work + turned(out.handle.torque, before, hand.orientation);
            net += work;
            seen.passed_j += work.abs();
            // Once there are no targets a 64th of the endowment is let off.
            ended += f64::from(u8::from(active > 0 && out.guidance.active == 0));
            active = out.guidance.active;
            let allowed = f64::from(settings.passivity.endowment_j) * (1.0 + ended / 64.0);
            if net - allowed > seen.beyond_j || seen.allowed_j == 0.0 {
                seen.beyond_j = net - allowed;
                seen.allowed_j = allowed;
            }
            let moved = hand.velocity.iter().map(|v| v * v).sum::<f64>() * period.powi(2);
            let angle = before.angle_between(hand.orientation);
            let c = &settings.coupling;
            let tick_j = 0.5 * (f64::from(c.k_t_n_per_m) * moved + f64::from(c.k_r * angle * angle));
            seen.tick_j = seen.tick_j.max(tick_j);
            if allowed - net < 0.01 * allowed {
                let object = out.object_twist;
                let drag = f64::from(c.k_t_n_per_m * object.linear.length()) * moved.sqrt()
                    + f64::from(c.k_r * object.angular.length() * angle);
                seen.ahead_j += period * drag;
            }
            seen.given_j = seen.given_j.max(net);
            seen.peak_n = seen.peak_n.max(f64::from(out.handle.force.length()));
            seen.engaged = seen.engaged.max(out.guidance.engagement);
            t += 1;
        }
        (from, leant) = (goal, way.lean);
    }
    seen
}

static IMAGE: std::sync::LazyLock<support::image::Image> =
    std::sync::LazyLock::new(|| support::exact_hole_and_peg(1e-3, 10e-3));

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn targets_give_no_more_than_the_hand_brought(
        ways in prop::collection::vec(way(), 1..5),
        words in prop::collection::vec(word(), 1..25),
        thesis in prop::bool::weighted(0.2),
    ) {
        let mut settings = Settings::default();
        if thesis {
            settings.guidance.method = GuidanceMethod::Thesis;
        }
        let seen = play(&settings, &ways, &words);
        prop_assert!(seen.beyond_j <= seen.tick_j + seen.ahead_j, "{seen:?}");
    }
}

/// A hand at rest 0.4 mm and 2° beside an axis that takes hold of its part and lets go again, 10 times.
#[test]
fn a_hand_at_rest_is_given_next_to_nothing_and_the_part_is_guided_all_the_same() {
    let mut settings = Settings::default();
    let way = |ticks| Way {
        ticks,
        goal: [0.4e-3, 0.0, 0.0],
        lean: [0.0, 0.035],
        tremor: (0.0, 8.0),
    };
    let ways = [way(500), way(16_000)];
    let words: Vec<Word> = (0..10)
        .map(|i| Word {
            after: if i == 0 { 500 } else { 1500 },
            id: 1,
            set: Some([0.0; 2]),
            expiry: 300,
        })
        .collect();
    let paid = play(&settings, &ways, &words);
    settings.passivity.endowment_j = f32::INFINITY;
    let free = play(&settings, &ways, &words);
    println!("{paid:?}\nfree: {free:?}");
    let most = f64::from(Settings::default().passivity.endowment_j) * (1.0 + 10.0 / 64.0)
        + paid.tick_j
        + paid.ahead_j;
    assert!(paid.given_j <= most, "{paid:?}");
    assert_eq!((paid.engaged, free.engaged), (1.0, 1.0));
    // The observer sees what the account keeps from being given.
    assert!(free.given_j > 4.0 * most, "{free:?}");
}
