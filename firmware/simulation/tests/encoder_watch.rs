//! Dead encoders and still hands, in closed loop: a spring wall on the encoder readings, the simulated mechanisms, random hands.

use crate::rigs::{arm, paddle, pantograph};
use crate::support::next;
use glam::{Quat, Vec3};
use mortise_firmware::board::{Drive, Mechanism, Sensed, Simulation};
use mortise_haptics::observer::Rise;
use mortise_haptics::{Pose, Wrench};
use mortise_mechanism::encoder_watch::VERDICT_TICKS;
use mortise_protocol::message::{HandScript, Keyframe, WirePose};
use mortise_simulation::described::Described;
use mortise_simulation::simulated::Simulated;
use proptest::prelude::*;

/// Either kind of mechanism, with encoders that can be frozen.
trait Rig: Mechanism + Simulation {
    fn freeze(&mut self, axis: usize);
    fn truth(&self) -> Pose;
}

impl Rig for Simulated {
    fn freeze(&mut self, axis: usize) {
        self.wiring.stuck[axis] = true;
    }
    fn truth(&self) -> Pose {
        self.true_pose()
    }
}

impl Rig for Described {
    fn freeze(&mut self, axis: usize) {
        self.wiring.stuck[axis] = true;
    }
    fn truth(&self) -> Pose {
        self.true_pose()
    }
}

#[derive(Clone, Copy, Debug)]
struct Held {
    stiffness: f32,
    /// Damping over stiffness, s.
    damping_s: f32,
    tremor: f32,
    tremor_hz: f32,
}

const STEADY: Held = Held {
    stiffness: 400.0,
    damping_s: 0.01,
    tremor: 0.0,
    tremor_hz: 0.0,
};

fn any_grip() -> impl Strategy<Value = Held> {
    let tremor = prop_oneof![Just(0.0f32), 1e-6f32..2e-4];
    (1.7f32..3.7, 0.003f32..0.02, tremor, 6.0f32..12.0).prop_map(|(decades, damping_s, tremor, tremor_hz)| {
        Held {
            stiffness: libm::powf(10.0, decades),
            damping_s,
            tremor,
            tremor_hz,
        }
    })
}

fn hand(grip: Held, frames: &[(u32, Pose, Vec3)]) -> HandScript {
    HandScript {
        stiffness: grip.stiffness,
        damping: grip.damping_s * grip.stiffness,
        angular_stiffness: 2.0,
        angular_damping: 0.02,
        tremor: grip.tremor,
        tremor_hz: grip.tremor_hz,
        keyframes: (frames.iter())
            .map(|(tick, pose, push)| Keyframe {
                tick: *tick,
                pose: WirePose {
                    position: pose.position.to_array(),
                    orientation: pose.orientation.to_array(),
                },
                push: push.to_array(),
            })
            .collect(),
    }
}

/// Spring and damper to `anchor` from the sensed pose, at most `most` newtons: the effect of a coupling to a part at rest.
fn held(sensed: &Sensed, anchor: Pose, most: f32) -> Drive {
    let apart = anchor.position - sensed.handle.position;
    let turn = (anchor.orientation * sensed.handle.orientation.conjugate()).to_scaled_axis();
    Drive::Wrench(Wrench {
        force: (apart * 1_000.0 - sensed.twist.linear * 4.0).clamp_length_max(most),
        torque: (turn * 0.5 - sensed.twist.angular * 0.002).clamp_length_max(0.3),
    })
}

/// Number of ticks, out of `ticks`, in which an encoder is reported dead, while `push` newtons press the handle into the spring.
fn press(mut rig: impl Rig, grip: Held, push: Vec3, ticks: u32, mut each: impl FnMut(Pose)) -> u32 {
    let home = rig.truth();
    rig.set_hand(Some(&hand(grip, &[(0, home, Vec3::ZERO), (500, home, push)])));
    let mut dead = 0;
    for _ in 0..ticks {
        let sensed = next(&mut rig);
        dead += u32::from(sensed.encoder_stuck.is_some());
        rig.watch_encoders(true);
        rig.drive(held(&sensed, home, push.length().max(0.1)));
        each(rig.truth());
    }
    dead
}

/// Ten newtons for a minute, nothing moving except by the probe. A rule that treated stillness under load as a dead encoder failed after 500 ms.
#[test]
fn a_still_hand_that_presses_for_a_minute_is_no_dead_encoder() {
    let mut way = Vec::new();
    let dead = press(
        Simulated::new(),
        STEADY,
        Vec3::new(0.0, 0.0, -10.0),
        60_000,
        |pose| {
            way.push(pose.position.z);
        },
    );
    assert_eq!(dead, 0);
    // Without the first 10 s, in which the hand presses and settles.
    let rest = &way[10_000..];
    let (low, high) = rest
        .iter()
        .fold((f32::MAX, f32::MIN), |(l, h), z| (l.min(*z), h.max(*z)));
    let peak = |from_hz: u32, to_hz: u32| (from_hz..to_hz).map(|hz| amplitude(rest, hz)).fold(0.0, f64::max);
    let (slow, middle, fast) = (peak(1, 30), peak(30, 100), peak(100, 500));
    println!(
        "handle moves {:.2} µm in all; largest line below 30 Hz {:.3} µm, to 100 Hz {:.3} µm, above {:.4} µm",
        (high - low) * 1e6,
        slow * 1e6,
        middle * 1e6,
        fast * 1e6
    );
    // Two counts there, two back on the other side of zero, and the handle's drift: 21 µm measured, under 5 counts of 5 µm. Spectral lines below the
    // threshold of perception.
    assert!(
        slow < 1e-6 && middle < 0.3e-6 && fast < 0.01e-6,
        "{slow} {middle} {fast}"
    );
    assert!((high - low) < 25e-6, "{} m", high - low);
}

/// A free handle that is moved and then held at rest: the energy its probes give to the hand over any interval, and that they end.
#[test]
fn probes_give_a_resting_hand_less_than_ten_microjoules() {
    for stiffness in [50.0, 100.0, 200.0, 400.0, 1_000.0, 5_000.0] {
        for damping_s in [0.003, 0.01, 0.02] {
            let grip = Held {
                stiffness,
                damping_s,
                ..STEADY
            };
            let mut rig = Simulated::new();
            let place = |x: f32| Pose::new(Vec3::new(x, -0.7 * x, 0.4 * x), Quat::from_rotation_y(10.0 * x));
            let frames = [(0, place(0.0), Vec3::ZERO), (500, place(0.01), Vec3::ZERO)];
            rig.set_hand(Some(&hand(grip, &frames)));
            let (mut rise, mut last, mut probed) = (Rise::default(), (rig.truth(), rig.motors()), 0);
            for tick in 0..20_000 {
                next(&mut rig);
                let (from, held) = last;
                let to = rig.truth();
                let turned = (to.orientation * from.orientation.conjugate()).to_scaled_axis();
                let work = held.force.dot(to.position - from.position) + held.torque.dot(turned);
                rise.stored(0.0);
                rise.gave(f64::from(work));
                rig.watch_encoders(true);
                rig.drive(Drive::Wrench(Wrench::ZERO));
                last = (to, rig.motors());
                if rig.motors() != Wrench::ZERO {
                    probed = tick;
                }
            }
            let given = rise.most();
            println!(
                "{stiffness} N/m, {damping_s} s: {:.2} µJ, last probe after {probed} ms",
                1e6 * given
            );
            assert!(given > 0.0 && given < 10e-6, "{grip:?}: {given} J");
            assert!(probed < 1_500, "{grip:?}: {probed} ms");
        }
    }
}

/// Amplitude of the spectral line at `hz` over whole seconds.
fn amplitude(way: &[f32], hz: u32) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (tick, z) in way.iter().enumerate() {
        let angle = std::f64::consts::TAU * f64::from(hz) * tick as f64 / 1_000.0;
        re += f64::from(z - way[0]) * angle.cos();
        im += f64::from(z - way[0]) * angle.sin();
    }
    2.0 * re.hypot(im) / way.len() as f64
}

#[test]
fn a_still_hand_on_a_described_rig_is_no_dead_encoder() {
    for (rig, push) in [
        (arm(), Vec3::new(0.0, 0.0, -4.0)),
        (arm(), Vec3::new(-3.0, 2.0, 1.0)),
        (pantograph(), Vec3::new(1.5, -2.0, 0.0)),
        (paddle(), Vec3::new(4.0, 0.0, 0.0)),
    ] {
        for stiffness in [100.0, 400.0, 1_500.0] {
            let grip = Held { stiffness, ..STEADY };
            let dead = press(Described::new(&rig).unwrap(), grip, push, 60_000, |_| {});
            assert_eq!(dead, 0, "{} {push} {stiffness}", rig.name);
        }
    }
}

/// A joint that the hand presses against its end stop does not follow its motor, and is sound.
#[test]
fn a_joint_at_its_stop_is_not_judged() {
    let rig = paddle();
    let mut mechanism = Described::new(&rig).unwrap();
    let far = Pose::new(Vec3::new(0.2, -0.1, 0.0), Quat::IDENTITY);
    mechanism.set_hand(Some(&hand(STEADY, &[(0, far, Vec3::ZERO)])));
    for _ in 0..5_000 {
        let sensed = next(&mut mechanism);
        assert_eq!(sensed.encoder_stuck, None);
        mechanism.watch_encoders(true);
        mechanism.drive(held(&sensed, Pose::IDENTITY, 4.0));
    }
}

/// Ticks from the freeze of `axis` to the verdict; the hand visits `places` (m, rad) in steps of 250 ms, held by a spring to the first.
fn frozen(
    mut rig: impl Rig,
    grip: Held,
    places: &[(Vec3, Vec3)],
    axis: usize,
    at: u32,
    most: f32,
) -> Option<(u8, u32)> {
    let home = rig.truth();
    let frames: Vec<_> = (places.iter().enumerate())
        .map(|(i, &(place, turn))| {
            let turn = Quat::from_scaled_axis(turn) * home.orientation;
            (250 * i as u32, Pose::new(home.position + place, turn), Vec3::ZERO)
        })
        .collect();
    rig.set_hand(Some(&hand(grip, &frames)));
    for tick in 0..at + 400 {
        if tick == at {
            rig.freeze(axis);
        }
        let sensed = next(&mut rig);
        if let Some(dead) = sensed.encoder_stuck {
            return Some((dead, tick.checked_sub(at).expect("no fault before the freeze")));
        }
        rig.watch_encoders(true);
        rig.drive(held(&sensed, home, most));
    }
    None
}

fn places() -> impl Strategy<Value = Vec<(Vec3, Vec3)>> {
    let place = (-0.02f32..0.02, -0.02f32..0.02, -0.02f32..0.02);
    let turn = (-0.4f32..0.4, -0.4f32..0.4, -0.4f32..0.4);
    let vector = |(x, y, z)| Vec3::new(x, y, z);
    prop::collection::vec((place.prop_map(vector), turn.prop_map(vector)), 12)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: proptest::test_runner::RngSeed::Fixed(11), ..Default::default() })]

    /// Any hand, any motion, any axis, in contact or free: the frozen axis is named, in time. In contact at 8 N, free at 0 N.
    #[test]
    fn an_encoder_frozen_under_motion_is_found(
        grip in any_grip(), places in places(), axis in 0usize..6, at in 500u32..2_000, most in prop::sample::select(&[0.0f32, 1.0, 8.0][..]),
    ) {
        let found = frozen(Simulated::new(), grip, &places, axis, at, most);
        let in_time = found.is_some_and(|(dead, after)| usize::from(dead) == axis && after <= u32::from(VERDICT_TICKS));
        prop_assert!(in_time, "{found:?}");
    }

    /// The same for the joints of an arm and a pantograph, away from stops and singular postures, where they are not judged.
    ///
    /// In a pantograph the other joint may be named, but only one that has itself been silent since before the freeze, so that its verdict comes
    /// sooner than a frozen one's can (one of the kept cases, by 4 ms; none of 200 random ones). Both joints are then probed at once, and counts
    /// cannot show which silence is a defect: with J₀ and J₁ the handle's displacements per radian of each joint and c the cosine between them, a
    /// hand of stiffness k answers torques τ by δq = (JᵀJ)⁻¹·τ/k. Two equally strong probes with equal levers L move a joint by τ/(k·L²·(1 + c))
    /// where they oppose each other: by as little as half of the motion the amplitude is designed for, which a moving hand may cancel. The motors are
    /// off in time all the same.
    #[test]
    fn a_joint_encoder_frozen_under_motion_is_found(
        grip in any_grip(), places in places(), axis in 0usize..3, at in 500u32..2_000, push in 0.0f32..4.0,
    ) {
        for (rig, joints) in [(arm(), 3), (pantograph(), 2)] {
            let axis = axis % joints;
            let near: Vec<_> = places.iter().map(|&(place, turn)| (0.4 * place, turn)).collect();
            let soft = Held { stiffness: grip.stiffness.min(1_500.0), ..grip };
            let found = frozen(Described::new(&rig).unwrap(), soft, &near, axis, at, push);
            let in_time = found.is_some_and(|(dead, after)| {
                let silent_before = joints == 2 && after < u32::from(VERDICT_TICKS) - 1;
                let named = usize::from(dead) == axis || silent_before;
                named && after <= u32::from(VERDICT_TICKS)
            });
            prop_assert!(in_time, "{}: {found:?}", rig.name);
        }
    }

    /// Sound encoders and any hand up to 5,000 N/m, from no tremor to 0.2 mm: no fault in ten seconds of pressing.
    #[test]
    fn no_hand_makes_a_sound_encoder_look_dead(
        grip in any_grip(), push in (-6.0f32..6.0, -6.0f32..6.0, -6.0f32..6.0),
    ) {
        let push = Vec3::new(push.0, push.1, push.2);
        prop_assert_eq!(press(Simulated::new(), grip, push, 10_000, |_| {}), 0);
    }
}

/// Hands that move slowly and tremble below the encoders' resolution can rarely cancel a probe within a joint's dry friction. Fixed cases.
#[test]
fn a_moving_hand_on_a_described_rig_is_hardly_ever_taken_for_a_dead_encoder() {
    let mut seed = 12_345u64;
    let mut between = |low: f32, high: f32| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((seed >> 40) as f32 / 16_777_216.0)
    };
    let cases: u32 = std::env::var("CASES")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(200);
    let mut alarms = [0u32; 2];
    for _ in 0..cases {
        for (rig, alarms) in [arm(), pantograph()].iter().zip(&mut alarms) {
            let grip = Held {
                stiffness: libm::powf(10.0, between(1.7, 3.17)),
                damping_s: between(0.003, 0.02),
                tremor: between(-2e-4, 2e-4).max(0.0),
                tremor_hz: between(6.0, 12.0),
            };
            let most = between(0.0, 4.0);
            let mut mechanism = Described::new(rig).unwrap();
            let home = mechanism.truth();
            let frames: Vec<_> = (0..12)
                .map(|i| {
                    let place = Vec3::from_array([(); 3].map(|()| between(-0.008, 0.008)));
                    (
                        250 * i,
                        Pose::new(home.position + place, home.orientation),
                        Vec3::ZERO,
                    )
                })
                .collect();
            mechanism.set_hand(Some(&hand(grip, &frames)));
            for _ in 0..2_000 {
                let sensed = next(&mut mechanism);
                if sensed.encoder_stuck.is_some() {
                    *alarms += 1;
                    break;
                }
                mechanism.watch_encoders(true);
                mechanism.drive(held(&sensed, home, most));
            }
        }
    }
    println!(
        "alarms in {} s each: arm {}, pantograph {}",
        2 * cases,
        alarms[0],
        alarms[1]
    );
    // 609 of 4,000 with a single ramp instead of one there and back.
    let seconds = 2 * 2 * cases;
    assert!(
        (alarms[0] + alarms[1]) * 1_000 <= seconds,
        "more than one in 1,000 s: {alarms:?}"
    );
}
