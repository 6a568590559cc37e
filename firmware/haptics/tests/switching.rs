//! Targets that come late, twice, in the wrong order or not at all: no step in force, no energy made, and nothing left once they expire.
//!
//! Energy made is what [`mortise_haptics::observer`] finds: the largest rise over any interval, beyond what is stored. The account lends E₀ once
//! ([`mortise_haptics::PassivitySettings::initial_budget_j`]) and what was lent is owed for good, so the number of targets and of switches does not enter.
//! To E₀ comes what readings in single precision hide of the motion. They round x, less than 2⁻⁴ m here, to 2⁻²⁹ m, so a sum over their
//! differences misses Σ F·Δe = F·e − Σ e·ΔF by no more than
//!
//! 2⁻²⁹ m · (F + Σ |ΔF|),
//!
//! both of the wrench that acted: 6 nJ for 3 N, and as much again each time the force goes up and down.

mod support;

use mortise_haptics::observer::Observer;
use mortise_haptics::{Flags, Settings, State, TargetError, Vec3, Wrench};
use mortise_protocol::message::{ConstraintTarget, Feature};
use proptest::prelude::*;
use support::hand::{Hand, run};
use support::{BLOCK_HALF, PEG_HALF, axis_on_axis};

/// Largest change of the handle's wrench from tick to tick.
const STEP_N: f32 = 0.05;
const STEP_NM: f32 = 2e-3;
/// Ticks in which a target fades and what it held is let go: up to 4 targets of 3 N at 0.015 N a tick between them, and a second.
const FADED: u32 = 4 * 200 + 1024;
/// Ticks after which the hand is at rest again: 20 of its time constant, 2·5/400 s.
const RESTED: u32 = 500;
/// Ticks in which a part that gave way in the hand by a millimetre is back to a micrometre: ln 1000 of `grip`'s 0.25 s.
const BACK: u32 = 1730;

/// What the desktop means to say.
#[derive(Clone, Copy, Debug)]
enum Word {
    /// Target of this id, one of several places of its axis.
    Set {
        id: u16,
        place: u8,
        expiry: u16,
    },
    Clear {
        id: u16,
    },
}

/// What becomes of it on the way.
#[derive(Clone, Copy, Debug)]
struct Sent {
    /// Ticks after the one before it was sent.
    after: u32,
    word: Word,
    lost: bool,
    /// Ticks it takes: what is sent later may come sooner.
    late: u32,
    /// Ticks after which it comes again.
    again: Option<u32>,
}

fn word() -> impl Strategy<Value = Word> {
    prop_oneof![
        4 => (0u16..3, 0u8..4, prop_oneof![Just(300u16), 1u16..400])
            .prop_map(|(id, place, expiry)| Word::Set { id, place, expiry }),
        1 => (0u16..3).prop_map(|id| Word::Clear { id }),
    ]
}

fn sent() -> impl Strategy<Value = Sent> {
    (
        0u32..150,
        word(),
        prop::bool::weighted(0.3),
        prop_oneof![3 => 0u32..5, 1 => 0u32..200],
        prop::option::weighted(0.3, 0u32..400),
    )
        .prop_map(|(after, word, lost, late, again)| Sent {
            after,
            word,
            lost,
            late,
            again,
        })
}

/// The hole's axis, or one up to 0.2 mm and 0.6° beside it: no target of the same id is the same.
fn target(id: u16, place: u8, expiry: u16, sequence: u16) -> ConstraintTarget {
    let [x, y, tilt] = [
        [0.0, 0.0, 0.0],
        [0.2e-3, 0.0, 0.0],
        [0.0, -0.2e-3, 0.01],
        [0.1e-3, 0.1e-3, -0.005],
    ][usize::from(place) % 4];
    ConstraintTarget {
        id,
        fixed: Feature {
            point: [x, y, 0.0],
            direction: Vec3::new(tilt, 0.0, 1.0).normalize().to_array(),
        },
        ..axis_on_axis(sequence, expiry)
    }
}

/// When what arrives, in order of arrival.
fn arrivals(all: &[Sent]) -> Vec<(u32, Word, u16)> {
    let mut arrivals = Vec::new();
    let (mut at, mut sequence) = (0, 65_500u16);
    for sent in all {
        at += sent.after;
        sequence = sequence.wrapping_add(1);
        if !sent.lost {
            arrivals.push((at + sent.late, sent.word, sequence));
            if let Some(again) = sent.again {
                arrivals.push((at + sent.late + again, sent.word, sequence));
            }
        }
    }
    arrivals.sort_by_key(|(at, ..)| *at);
    arrivals
}

/// Half the last place of a coordinate below 2⁻⁴ m in single precision, m.
const ROUNDED_M: f64 = 1.0 / (1u32 << 29) as f64;

/// The peg `engaged` in its hole, in hand.
fn start(image: &support::image::Image, engaged: f64) -> (State, Hand) {
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    let hand = Hand::at([0.0, 0.0, BLOCK_HALF + PEG_HALF - engaged]);
    state.grab(&scene, 1, &hand.pose()).unwrap();
    (state, hand)
}

static IMAGE: std::sync::LazyLock<support::image::Image> =
    std::sync::LazyLock::new(|| support::exact_hole_and_peg(1e-3, 10e-3));

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// In the middle of a hole with 0.5 mm of play all round nothing but guidance is felt: what swings by 0.4 mm and a third more touches no wall.
    #[test]
    fn no_step_no_energy_and_nothing_left(
        all in prop::collection::vec(sent(), 1..25),
        aside in prop_oneof![Just(0.0), -0.2e-3..0.2e-3f64],
    ) {
        let scene = IMAGE.open();
        let (mut state, mut hand) = start(&IMAGE, 10e-3);
        let settings = Settings::default();
        hand.goal[0] = aside;
        run(&mut state, &scene, &settings, &mut hand, RESTED, |_, _, _| {});
        let arrivals = arrivals(&all);
        let until = arrivals.iter().map(|(at, word, _)| match word {
            Word::Set { expiry, .. } => at + u32::from(*expiry),
            Word::Clear { .. } => *at,
        });
        let until = until.max().unwrap_or(0);
        let mut next = arrivals.iter().peekable();
        let mut last: Option<Wrench> = None;
        let mut observer = Observer::new(&scene, &state, &settings, &hand.place()).unwrap();
        let mut changed_n = 0.0;
        for t in 0..until + FADED + BACK + RESTED {
            while let Some((_, word, sequence)) = next.next_if(|(at, ..)| *at == t) {
                match word {
                    Word::Set { id, place, expiry } => {
                        let taken = state.set_target(&target(*id, *place, *expiry, *sequence));
                        prop_assert!(matches!(taken, Ok(()) | Err(TargetError::Full)));
                    }
                    Word::Clear { id } => state.clear_target(*id),
                }
            }
            observer.look(&state);
            let from = hand.place();
            let (out, seen) = run(&mut state, &scene, &settings, &mut hand, 1, |_, _, _| {});
            observer.tick(&state, &from, &hand.place(), &out.handle);
            prop_assert!(!seen.flags.intersects(unwanted()), "{:?}", seen.flags);
            if let Some(last) = last {
                let (force, torque) = (out.handle.force - last.force, out.handle.torque - last.torque);
                prop_assert!(force.length() <= STEP_N, "tick {t}: {} N", force.length());
                prop_assert!(torque.length() <= STEP_NM, "tick {t}: {} N m", torque.length());
                changed_n += f64::from(force.length());
            }
            last = Some(out.handle);
            if t >= until {
                prop_assert_eq!(out.guidance.active, 0);
            }
            if t >= until + FADED {
                prop_assert_eq!(out.guidance.engagement, 0.0);
                prop_assert!(out.guidance.wrench.force.length() == 0.0);
            }
        }
        let lent = f64::from(settings.passivity.initial_budget_j);
        let rounded = ROUNDED_M * (f64::from(settings.coupling.force_max_n) + changed_n);
        prop_assert!(observer.given_j() <= lent + rounded, "{} J, rounding {rounded} J", observer.given_j());
        // Where it was: the hand's spring and nothing else.
        let (pose, _) = state.object().unwrap();
        prop_assert!((f64::from(pose.position.x) - aside).abs() < 2e-6, "{}", pose.position.x);
    }
}

/// The method is chosen anew while a target holds the part: what pulled fades before another pulls.
#[test]
fn another_method_takes_over_without_a_step() {
    use mortise_haptics::GuidanceMethod::{Capped, Off, Thesis};
    let scene = IMAGE.open();
    let (mut state, mut hand) = start(&IMAGE, 10e-3);
    let mut settings = Settings::default();
    hand.goal[0] = 0.4e-3;
    run(&mut state, &scene, &settings, &mut hand, RESTED, |_, _, _| {});
    let mut last: Option<Wrench> = None;
    let methods = [Capped, Thesis, Capped, Off, Thesis, Off, Capped];
    for t in 0..methods.len() as u32 * 600 {
        settings.guidance.method = methods[t as usize / 600];
        if t.is_multiple_of(100) {
            state
                .set_target(&axis_on_axis((t / 100 + 1) as u16, 300))
                .unwrap();
        }
        let (out, _) = run(&mut state, &scene, &settings, &mut hand, 1, |_, _, _| {});
        if let Some(last) = last {
            let (force, torque) = (out.handle.force - last.force, out.handle.torque - last.torque);
            assert!(force.length() <= STEP_N, "tick {t}: {} N", force.length());
            assert!(torque.length() <= STEP_NM, "tick {t}: {} N m", torque.length());
        }
        last = Some(out.handle);
        if t % 600 == 599 {
            let engaged = if settings.guidance.method == Off { 0.0 } else { 1.0 };
            assert_eq!(out.guidance.engagement, engaged, "{:?}", settings.guidance.method);
            // Capped it holds the axis; the thesis' spring, softer than the coupling, does not.
            let (pose, _) = state.object().unwrap();
            let off = pose.position.x;
            assert_eq!(off < 5e-6, settings.guidance.method == Capped, "{off}");
        }
    }
}

/// Flags that no target may raise.
fn unwanted() -> Flags {
    let mut flags = Flags::NON_FINITE;
    flags.insert(Flags::UNSETTLED);
    flags.insert(Flags::FORCE_SLEW);
    flags.insert(Flags::TORQUE_SLEW);
    flags
}
