//! Energy that a geometric energy delivers to the operator: at most 10 µJ beyond what the operator supplied, over any interval.
//!
//! The observer stands outside of the law: see [`mortise_haptics::observer`]. What the energy stores was supplied by nobody and counts as generated once
//! the hand has it.

use std::sync::LazyLock;

use crate::support::image::Image;
use crate::support::{BLOCK_HALF, PEG_HALF};
use crate::trial::{COUNT_M, COUNT_RAD, Hold, Operator, Random};
use crate::well::{Frame, HOLE, HOME, LARGE, OPEN, SMALL, Well, energy_settings, fixed, frame_of, with};
use glam::{DQuat, DVec3};
use mortise_haptics::observer::{Observer, Place};
use mortise_haptics::{Flags, GuidanceMethod, Output, Settings, State, tick};

/// Limit on the energy delivered beyond what the operator supplied, J.
const LIMIT_J: f64 = 10e-6;

/// Outcome of a hand about a well.
#[derive(Debug)]
#[expect(dead_code, reason = "printed")]
struct Seen {
    seed: u64,
    hold: Hold,
    moving: bool,
    counted: bool,
    released: bool,
    given_j: f64,
    engaged: f32,
    /// Deepest and shallowest pose, over the depth.
    deepest: f64,
    shallowest: f64,
    peak_n: f32,
    touched: u32,
}

impl Seen {
    fn of(seed: u64, hand: &Operator) -> Self {
        Self {
            seed,
            hold: hand.hold,
            moving: hand.moving,
            counted: hand.readings.is_some(),
            released: false,
            given_j: 0.0,
            engaged: 0.0,
            deepest: 0.0,
            shallowest: 1.0,
            peak_n: 0.0,
            touched: 0,
        }
    }

    fn look(&mut self, out: &Output) {
        assert!(!out.work.flags.contains(Flags::NON_FINITE), "{self:?}");
        self.engaged = self.engaged.max(out.guidance.engagement);
        self.peak_n = self.peak_n.max(out.handle.force.length());
        self.touched += u32::from(out.work.contacts > 0);
    }

    /// With the part at `pose` in the fixed part's frame.
    fn measure(&mut self, well: &Well, pose: Frame) {
        let depth = -well.cost(pose).energy;
        self.deepest = self.deepest.max(depth);
        self.shallowest = self.shallowest.min(depth);
    }
}

/// Wells of the sequences: image, the well that [`Seen`] measures, pose of the fixed part. Two of them at the start of the part, one beside it, one in
/// the hole.
static WELLS: LazyLock<[(Image, Well, Frame); 3]> = LazyLock::new(|| {
    let off = Well::new(1, 0, HOME[0] + DVec3::new(2e-3, 1e-3, -1.5e-3), 38);
    let below = DVec3::new(0.3e-3, -0.1e-3, BLOCK_HALF + PEG_HALF - 12e-3);
    let hole = Well::new(1, 0, below, 38);
    let upright = (DVec3::ZERO, DQuat::IDENTITY);
    [
        (with(&OPEN, &[&LARGE, &SMALL]), LARGE.clone(), fixed()),
        (with(&OPEN, &[&off]), off, fixed()),
        (with(&HOLE, &[&hole]), hole, upright),
    ]
});

/// What a sequence changes on its way.
struct Changes {
    switches: bool,
    releases: bool,
    /// The hand's own dynamics.
    firm: Hold,
}

impl Changes {
    /// Perhaps another method, and perhaps the hand lets go or takes hold again.
    fn make(&self, random: &mut Random, settings: &mut Settings, hand: &mut Operator) {
        if self.switches && random.chance(0.003) {
            settings.guidance.method = match random.below(4) {
                0 => GuidanceMethod::Off,
                1 => GuidanceMethod::Capped,
                _ => GuidanceMethod::Energy,
            };
        }
        if let (Hold::Impedance { linear, angular }, true) =
            (self.firm, self.releases && random.chance(0.005))
        {
            let firmness = if random.chance(0.5) { 0.0 } else { 1.0 };
            hand.hold = Hold::Impedance {
                linear: [linear[0], firmness * linear[1], linear[2]],
                angular: [angular[0], firmness * angular[1], angular[2]],
            };
        }
    }
}

/// A hand in or about a well for two seconds: at rest or on paths through it, in some sequences released for a while, the method changed, in the hole or in
/// the open.
fn play(seed: u64, budget_j: Option<f32>) -> Seen {
    let (image, well, base) = &WELLS[seed as usize % 3];
    let scene = image.open();
    let mut random = Random(seed);
    let mut settings = energy_settings();
    settings.guidance.geometric_force_n = random.decade(0.5, 10.0) as f32;
    if let Some(budget) = budget_j {
        settings.passivity.initial_budget_j = budget;
    }
    let period = f64::from(settings.period_s);
    let mut state = Box::new(State::new());
    state.load_scene(&scene);
    let placed = state.placement(1).expect("in the scene");
    let start = Place {
        position: placed.position.as_dvec3() + random.direction() * random.within(0.0, 0.02),
        orientation: DQuat::IDENTITY,
    };
    let range = if seed % 3 == 2 { 3e-3 } else { 30e-3 };
    let mut hand = Operator::new(&mut random, start, range);
    if hand.readings.is_some() {
        settings.passivity.position_count_m = COUNT_M as f32;
        settings.passivity.angle_count_rad = COUNT_RAD as f32;
    }
    let changes = Changes {
        switches: random.chance(0.3),
        releases: random.chance(0.5),
        firm: hand.hold,
    };
    let at_grab = hand.input(period);
    (state.grab(&scene, 1, &at_grab.handle)).expect("may be grabbed");
    let grabbed = Place {
        position: at_grab.handle.position.as_dvec3(),
        orientation: at_grab.handle.orientation.as_dquat().normalize(),
    };
    let mut observer = Observer::new(&scene, &state, &settings, &grabbed).expect("in hand");
    let mut seen = Seen::of(seed, &hand);
    for t in 0..2000 {
        hand.choose(&mut random, t);
        changes.make(&mut random, &mut settings, &mut hand);
        seen.released |= hand.hold != changes.firm;
        let input = hand.input(period);
        observer.look(&state);
        let out = tick(&mut state, &scene, &settings, &input);
        let from = hand.at;
        hand.advance(&out.handle, t, period);
        observer.tick(&state, &from, &hand.at, &out.handle);
        seen.look(&out);
        // A depth is a sum over all charges.
        if t % 20 == 0 {
            let (position, orientation) = frame_of(&out.object);
            let back = base.1.conjugate();
            seen.measure(well, (back * (position - base.0), back * orientation));
        }
    }
    seen.given_j = observer.given_j();
    seen
}

#[test]
fn no_hand_in_a_well_receives_more_than_ten_microjoules_net() {
    let all: Vec<Seen> = (0..300).map(|seed| play(seed, None)).collect();
    let worst = (all.iter().max_by(|a, b| a.given_j.total_cmp(&b.given_j))).unwrap();
    println!("{worst:?}");
    assert!(worst.given_j <= LIMIT_J, "{worst:?}");
    for (what, kind) in [
        ("moving", (|seen: &Seen| seen.moving) as fn(&Seen) -> bool),
        ("counted", |seen| seen.counted),
        ("position", |seen| seen.hold == Hold::Position),
        ("released", |seen| seen.released),
        ("touched", |seen| seen.touched > 100),
        ("in and out", |seen| seen.deepest > 0.9 && seen.shallowest < 0.5),
    ] {
        let count = all.iter().filter(|seen| kind(seen)).count();
        println!("{what}: {count}");
        assert!((25..275).contains(&count), "{what}: {count}");
    }
    assert!(all.iter().filter(|seen| seen.engaged > 0.9).count() > 280);
}

/// The observer sees what the account withholds.
#[test]
fn without_the_account_a_well_delivers_energy() {
    let most = (0..45)
        .map(|seed| play(seed, Some(f32::INFINITY)).given_j)
        .fold(0.0, f64::max);
    println!("{:.1} µJ", 1e6 * most);
    assert!(most > 10.0 * LIMIT_J, "{most}");
}
