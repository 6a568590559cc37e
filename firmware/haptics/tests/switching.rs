//! Targets that arrive late, twice, in the wrong order or not at all: no step in force, no energy generated, and no state left once they expire.
//!
//! Energy generated is that of [`mortise_haptics::observer`]: the largest rise over any interval, beyond what is stored. The account grants E₀ once
//! ([`mortise_haptics::PassivitySettings::initial_budget_j`]) and a debt remains owed, so the number of targets and of switches has no influence. To
//! E₀ is added the motion that readings in single precision hide. They round x, less than 2⁻⁴ m here, to 2⁻²⁹ m, so a sum over their differences
//! misses Σ F·Δe = F·e − Σ e·ΔF by no more than
//!
//! 2⁻²⁹ m · (F + Σ |ΔF|),
//!
//! both of the wrench that acted: 6 nJ for 3 N, and as much again each time the force rises and falls.

use crate::support;
use crate::support::hand::{Hand, run};
use crate::support::{BLOCK_HALF, PEG_HALF, axis_on_axis};
use mortise_haptics::observer::Observer;
use mortise_haptics::{Flags, Settings, State, TargetError, Vec3, Wrench};
use mortise_protocol::message::{ConstraintTarget, Feature};
use proptest::prelude::*;

/// Largest change of the handle's wrench from tick to tick.
const STEP_N: f32 = 0.05;
const STEP_NM: f32 = 2e-3;
/// Ticks in which a target fades and its release damper ends: up to 4 targets of 3 N at 0.015 N a tick between them, and a second.
const FADED: u32 = 4 * 200 + 1024;
/// Ticks after which the hand is at rest again: 20 of its time constant, 2·5/400 s.
const AT_REST: u32 = 500;
/// Ticks in which a slip of a millimetre recovers to a micrometre: ln 1000 of the 0.25 s of `energy_bound`.
const SLIP_RECOVERED: u32 = 1730;

/// Command of the desktop.
#[derive(Clone, Copy, Debug)]
enum Command {
    /// Target with this id, one of several placements of its axis.
    Set {
        id: u16,
        place: u8,
        expiry: u16,
    },
    Clear {
        id: u16,
    },
}

/// A command and its fate on the link.
#[derive(Clone, Copy, Debug)]
struct Message {
    /// Ticks after the previous message.
    after: u32,
    command: Command,
    lost: bool,
    /// Delay, ticks: a later message may arrive sooner.
    late: u32,
    /// Ticks after which it arrives again.
    again: Option<u32>,
}

fn command() -> impl Strategy<Value = Command> {
    prop_oneof![
        4 => (0u16..3, 0u8..4, prop_oneof![Just(300u16), 1u16..400])
            .prop_map(|(id, place, expiry)| Command::Set { id, place, expiry }),
        1 => (0u16..3).prop_map(|id| Command::Clear { id }),
    ]
}

fn message() -> impl Strategy<Value = Message> {
    (
        0u32..150,
        command(),
        prop::bool::weighted(0.3),
        prop_oneof![3 => 0u32..5, 1 => 0u32..200],
        prop::option::weighted(0.3, 0u32..400),
    )
        .prop_map(|(after, command, lost, late, again)| Message {
            after,
            command,
            lost,
            late,
            again,
        })
}

/// The hole's axis, or one up to 0.2 mm and 0.6° off: no two placements are equal.
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

/// Arrivals (tick, command, sequence number) in order.
fn arrivals(all: &[Message]) -> Vec<(u32, Command, u16)> {
    let mut arrivals = Vec::new();
    let (mut at, mut sequence) = (0, 65_500u16);
    for message in all {
        at += message.after;
        sequence = sequence.wrapping_add(1);
        if !message.lost {
            arrivals.push((at + message.late, message.command, sequence));
            if let Some(again) = message.again {
                arrivals.push((at + message.late + again, message.command, sequence));
            }
        }
    }
    arrivals.sort_by_key(|(at, ..)| *at);
    arrivals
}

/// Half the last place of a coordinate below 2⁻⁴ m in single precision, m.
const ROUNDED_M: f64 = 1.0 / (1u32 << 29) as f64;

/// The peg `engaged` in its hole, held by a hand.
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

    /// In the middle of a hole with 0.5 mm of clearance all round only guidance acts: a motion that swings by 0.4 mm and a third more touches no
    /// wall.
    #[test]
    fn no_step_no_energy_and_no_state_left(
        all in prop::collection::vec(message(), 1..25),
        offset in prop_oneof![Just(0.0), -0.2e-3..0.2e-3f64],
    ) {
        let scene = IMAGE.open();
        let (mut state, mut hand) = start(&IMAGE, 10e-3);
        let settings = Settings::default();
        hand.goal[0] = offset;
        run(&mut state, &scene, &settings, &mut hand, AT_REST, |_, _, _| {});
        let arrivals = arrivals(&all);
        let until = arrivals.iter().map(|(at, command, _)| match command {
            Command::Set { expiry, .. } => at + u32::from(*expiry),
            Command::Clear { .. } => *at,
        });
        let until = until.max().unwrap_or(0);
        let mut next = arrivals.iter().peekable();
        let mut last: Option<Wrench> = None;
        let mut observer = Observer::new(&scene, &state, &settings, &hand.place()).unwrap();
        let mut changed_n = 0.0;
        for t in 0..until + FADED + SLIP_RECOVERED + AT_REST {
            while let Some((_, command, sequence)) = next.next_if(|(at, ..)| *at == t) {
                match command {
                    Command::Set { id, place, expiry } => {
                        let taken = state.set_target(&target(*id, *place, *expiry, *sequence));
                        prop_assert!(matches!(taken, Ok(()) | Err(TargetError::Full)));
                    }
                    Command::Clear { id } => state.clear_target(*id),
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
        let initial_j = f64::from(settings.passivity.initial_budget_j);
        let rounded = ROUNDED_M * (f64::from(settings.coupling.force_max_n) + changed_n);
        prop_assert!(observer.given_j() <= initial_j + rounded, "{} J, rounding {rounded} J", observer.given_j());
        // Back at its initial place: only the hand's spring acts.
        let (pose, _) = state.object().unwrap();
        prop_assert!((f64::from(pose.position.x) - offset).abs() < 2e-6, "{}", pose.position.x);
    }
}

/// The method changes while a target holds the part: the springs of the old method fade before those of the new one act.
#[test]
fn another_method_takes_over_without_a_step() {
    use mortise_haptics::GuidanceMethod::{Capped, Off, Thesis};
    let scene = IMAGE.open();
    let (mut state, mut hand) = start(&IMAGE, 10e-3);
    let mut settings = Settings::default();
    hand.goal[0] = 0.4e-3;
    run(&mut state, &scene, &settings, &mut hand, AT_REST, |_, _, _| {});
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
