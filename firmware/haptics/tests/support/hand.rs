//! Operator model: a handle in a simulated hand, closed round the force law.

use glam::{DQuat, DVec3};
use mortise_haptics::observer::{Observer, Place};
use mortise_haptics::{Flags, Input, Output, Pose, Quat, Settings, State, Twist, Vec3, tick};
use mortise_protocol::image::SceneImage;

/// Handle with a mass, driven by the hand's spring and damper and a constant push; its orientation follows the hand alone (passive wrist).
///
/// Integrated in steps of a tenth of a tick (symplectic Euler), the device's force held over the tick.
#[derive(Clone, Copy)]
pub struct Hand {
    pub mass_kg: f64,
    pub spring_n_per_m: f64,
    pub damping_n_s_per_m: f64,
    /// Goal position of the hand, m.
    pub goal: [f64; 3],
    /// Constant push, N.
    pub push: [f64; 3],
    pub position: [f64; 3],
    pub velocity: [f64; 3],
    pub orientation: Quat,
    pub angular: Vec3,
}

impl Hand {
    /// Defaults of the design's trial: 0.15 kg, 400 N/m; the arm's damping 5 N s/m.
    pub fn at(position: [f64; 3]) -> Self {
        Self {
            mass_kg: 0.15,
            spring_n_per_m: 400.0,
            damping_n_s_per_m: 5.0,
            goal: position,
            push: [0.0; 3],
            position,
            velocity: [0.0; 3],
            orientation: Quat::IDENTITY,
            angular: Vec3::ZERO,
        }
    }

    pub fn input(&self) -> Input {
        Input {
            handle: self.pose(),
            handle_twist: Twist {
                linear: vec3(self.velocity),
                angular: self.angular,
            },
            enabled: true,
        }
    }

    /// True placement, in double precision.
    pub fn place(&self) -> Place {
        Place {
            position: DVec3::from_array(self.position),
            orientation: DQuat::from_array(self.orientation.to_array().map(f64::from)).normalize(),
        }
    }

    pub fn pose(&self) -> Pose {
        Pose::new(vec3(self.position), self.orientation)
    }

    /// Advances one period under the device's force. Returns the work of the device on the handle, J.
    pub fn advance(&mut self, force: Vec3, period_s: f64) -> f64 {
        let step = period_s / 10.0;
        let force = force.to_array().map(f64::from);
        let mut work = 0.0;
        for _ in 0..10 {
            for (a, force) in force.iter().enumerate() {
                let hand = self.spring_n_per_m * (self.goal[a] - self.position[a])
                    - self.damping_n_s_per_m * self.velocity[a]
                    + self.push[a];
                self.velocity[a] += step * (hand + force) / self.mass_kg;
                self.position[a] += step * self.velocity[a];
                work += force * self.velocity[a] * step;
            }
        }
        work
    }
}

pub fn vec3(v: [f64; 3]) -> Vec3 {
    Vec3::from_array(v.map(|x| x as f32))
}

/// Outcome of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seen {
    pub peak_force_n: f32,
    pub deepest_m: f32,
    pub nodes: u32,
    pub points: u32,
    pub contacts: u16,
    pub candidates: u16,
    pub solves: u8,
    pub unsettled: u32,
    pub solves_sum: u32,
    pub flags: Flags,
    /// Energy delivered to the operator over any interval beyond the energy stored ([`mortise_haptics::observer`]), J, for a part grabbed just before
    /// the run.
    pub made_j: f64,
}

impl Seen {
    pub fn add(&mut self, out: &Output) {
        self.peak_force_n = self.peak_force_n.max(out.handle.force.length());
        if let Some(pair) = out.pairs.first() {
            self.deepest_m = self.deepest_m.max(pair.depth_m);
        }
        self.nodes = self.nodes.max(out.work.nodes);
        self.points = self.points.max(out.work.points);
        self.contacts = self.contacts.max(out.work.contacts);
        self.candidates = self.candidates.max(out.work.candidates);
        self.solves = self.solves.max(out.work.solves);
        self.solves_sum += u32::from(out.work.solves);
        self.unsettled += u32::from(out.work.flags.contains(Flags::UNSETTLED));
        self.flags.insert(out.work.flags);
    }
}

/// Runs `ticks`; `script` steers the hand before each. Returns the last output and the outcome.
pub fn run(
    state: &mut State,
    scene: &SceneImage<'_>,
    settings: &Settings,
    hand: &mut Hand,
    ticks: u32,
    mut script: impl FnMut(u32, &mut Hand, Option<&Output>),
) -> (Output, Seen) {
    let mut seen = Seen::default();
    let mut last: Option<Output> = None;
    let mut observer = Observer::new(scene, state, settings, &hand.place());
    let mut from = hand.place();
    for t in 0..ticks {
        script(t, hand, last.as_ref());
        if let Some(observer) = &mut observer {
            // The wrench of the last tick is held up to here: the script may have rotated the handle.
            if let Some(last) = &last {
                observer.tick(state, &from, &hand.place(), &last.handle);
            }
            observer.look(state);
        }
        from = hand.place();
        let out = tick(state, scene, settings, &hand.input());
        hand.advance(out.handle.force, f64::from(settings.period_s));
        seen.add(&out);
        last = Some(out);
    }
    let last = last.expect("at least one tick");
    if let Some(mut observer) = observer {
        observer.tick(state, &from, &hand.place(), &last.handle);
        seen.made_j = observer.given_j();
    }
    (last, seen)
}
