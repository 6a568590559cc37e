//! Random operator models and random targets, measured by the observer outside of the law. Shared with the lab, which runs more of them.
//!
//! A sequence depends on its seed alone. One hand in three is a position source, which follows its path regardless of force; the others are mass,
//! spring and damper in all six degrees of freedom, at a tenth of critical damping and more, lighter and softer than a rig with a hand. Four in ten
//! are at rest; six follow paths of up to 30 mm and 0.4 rad with accelerations up to 4 m/s² and tremor. Four in ten are measured by counting
//! encoders, their speed filtered. Targets are any that the board accepts: all kinds, up to 0.1 m off and in any orientation, caps up to the largest,
//! stiff or soft; new, replaced, refreshed, expired, cleared, eight at once, by both methods of guidance and with changes of the method.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use mortise_haptics::observer::{Observer, Place};
use mortise_haptics::{GuidanceMethod, Input, Settings, State, Twist, Vec3, Wrench, tick};
use mortise_protocol::image::SceneImage;
use mortise_protocol::limits::MAX_TARGETS;
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};

/// Integration steps per tick.
const SUBSTEPS: u32 = 10;
/// Time constant of the speed filter behind counting encoders, s.
const FILTER_S: f64 = 3e-3;
/// Encoder counts: m and rad.
pub const COUNT_M: f64 = 5e-6;
pub const COUNT_RAD: f64 = TAU / 65_536.0;

/// SplitMix64.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Log-uniform.
    pub fn decade(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    pub fn below(&mut self, n: u64) -> u64 {
        self.next() % n
    }

    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::from_array([(); 3].map(|()| self.within(-1.0, 1.0)));
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// Dynamics of the operator model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// Position source: follows its path regardless of force.
    Position,
    /// Mass (kg), spring (N/m), damping (N s/m), and the same for rotation about the handle's origin.
    Impedance { linear: [f64; 3], angular: [f64; 3] },
}

/// Operator model.
#[derive(Clone, Debug)]
pub struct Operator {
    pub hold: Hold,
    /// True placement of the handle.
    pub at: Place,
    velocity: DVec3,
    angular: DVec3,
    from: [DVec3; 2],
    goal: [DVec3; 2],
    begun: u32,
    ticks: u32,
    tremor: (f64, f64),
    /// Start of its paths.
    start: Place,
    pub moving: bool,
    /// Largest distance from the start, m.
    range: f64,
    /// Readings and filtered speeds of counting encoders, if it has them.
    pub readings: Option<(Place, Twist)>,
}

impl Operator {
    pub fn new(random: &mut Random, start: Place, range: f64) -> Self {
        let hold = if random.chance(0.3) {
            Hold::Position
        } else {
            let mass = random.decade(0.05, 0.5);
            let inertia = random.decade(0.5e-4, 5e-4);
            let [k, kr] = [random.decade(20.0, 1500.0), random.decade(0.05, 2.0)];
            // Damping ratio from a tenth to one.
            let ratio = random.decade(0.1, 1.0);
            Hold::Impedance {
                linear: [mass, k, 2.0 * ratio * (k * mass).sqrt()],
                angular: [inertia, kr, 2.0 * ratio * (kr * inertia).sqrt()],
            }
        };
        let moving = random.chance(0.6);
        let tremor = if moving {
            (random.within(0.0, 0.3e-3), random.within(5.0, 12.0))
        } else {
            (0.0, 8.0)
        };
        Self {
            hold,
            at: start,
            velocity: DVec3::ZERO,
            angular: DVec3::ZERO,
            from: [DVec3::ZERO; 2],
            goal: [DVec3::ZERO; 2],
            begun: 0,
            ticks: 0,
            tremor,
            start,
            moving,
            range,
            readings: random.chance(0.4).then_some((start, Twist::ZERO)),
        }
    }

    /// Commanded offset and rotation of the handle at a time in ticks.
    fn command(&self, t: f64) -> (DVec3, DVec3) {
        let s = if self.ticks == 0 {
            1.0
        } else {
            ((t - f64::from(self.begun)) / f64::from(self.ticks)).clamp(0.0, 1.0)
        };
        // Ends without a jump of speed or acceleration.
        let s = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
        let [p, r] = [0, 1].map(|i| self.from[i].lerp(self.goal[i], s));
        let ease = (t / 300.0).min(1.0);
        let tremor = ease * ease * self.tremor.0 * (TAU * self.tremor.1 * t * 1e-3).sin();
        (self.start.position + p + DVec3::new(tremor, 0.3 * tremor, 0.0), r)
    }

    /// Starts another path.
    pub fn choose(&mut self, random: &mut Random, t: u32) {
        if !self.moving || t < self.begun + self.ticks {
            return;
        }
        self.from = self.goal;
        self.begun = t;
        self.ticks = random.within(200.0, 1000.0) as u32;
        if random.chance(0.7) {
            self.goal = [
                random.direction() * random.decade(1e-4, self.range),
                random.direction() * random.decade(1e-3, 0.4),
            ];
        }
    }

    pub fn input(&mut self, period: f64) -> Input {
        let exact = Twist {
            linear: self.velocity.as_vec3(),
            angular: self.angular.as_vec3(),
        };
        let (place, twist) = match &mut self.readings {
            None => (self.at, exact),
            Some((place, twist)) => {
                let count = |x: f64| (x / COUNT_M).round() * COUNT_M;
                let position = DVec3::from_array(self.at.position.to_array().map(count));
                // The orientation follows in whole counts about its own axes.
                let off = rotation(place.orientation, self.at.orientation);
                let off = DVec3::from_array(off.to_array().map(|a| (a / COUNT_RAD).round() * COUNT_RAD));
                let orientation = (DQuat::from_scaled_axis(off) * place.orientation).normalize();
                let share = period / (FILTER_S + period);
                let filter = |v: &mut Vec3, to: DVec3| *v += (to.as_vec3() - *v) * share as f32;
                filter(&mut twist.linear, (position - place.position) / period);
                filter(&mut twist.angular, off / period);
                *place = Place {
                    position,
                    orientation,
                };
                (*place, *twist)
            }
        };
        Input {
            handle: place.pose(),
            handle_twist: twist,
            enabled: true,
        }
    }

    pub fn advance(&mut self, wrench: &Wrench, t: u32, period: f64) {
        let h = period / f64::from(SUBSTEPS);
        let (force, torque) = (wrench.force.as_dvec3(), wrench.torque.as_dvec3());
        match self.hold {
            Hold::Position => {
                let (p, r) = self.command(f64::from(t + 1));
                let to = Place {
                    position: p,
                    orientation: DQuat::from_scaled_axis(r) * self.start.orientation,
                };
                // The speed is known at the tick's end, as by any sensor.
                self.velocity = (to.position - self.at.position) / period;
                self.angular = rotation(self.at.orientation, to.orientation) / period;
                self.at = to;
            }
            Hold::Impedance { linear, angular } => {
                for i in 0..SUBSTEPS {
                    let (p, r) = self.command(f64::from(t) + f64::from(i) / f64::from(SUBSTEPS));
                    let [m, k, b] = linear;
                    let pull = (p - self.at.position) * k - self.velocity * b;
                    self.velocity += (force + pull) * (h / m);
                    self.at.position += self.velocity * h;
                    let [m, k, b] = angular;
                    let goal = DQuat::from_scaled_axis(r) * self.start.orientation;
                    let pull = rotation(self.at.orientation, goal) * k - self.angular * b;
                    self.angular += (torque + pull) * (h / m);
                    self.at.orientation =
                        (DQuat::from_scaled_axis(self.angular * h) * self.at.orientation).normalize();
                }
            }
        }
    }
}

fn rotation(from: DQuat, to: DQuat) -> DVec3 {
    let q = to * from.conjugate();
    (if q.w < 0.0 { -q } else { q }).to_scaled_axis()
}

/// Parameters and outcome of a sequence.
#[derive(Clone, Debug)]
#[expect(dead_code, reason = "printed")]
pub struct Seen {
    pub seed: u64,
    pub hold: Hold,
    pub moving: bool,
    pub counted: bool,
    pub method: GuidanceMethod,
    /// Energy delivered beyond what the operator supplied, J.
    pub given_j: f64,
    pub passed_j: f64,
    /// Largest force on the handle, N, and its largest change in a tick, N and N m.
    pub peak_n: f64,
    pub step_n: f64,
    pub step_nm: f64,
    /// Number of targets accepted, and the largest engagement.
    pub taken: u32,
    pub engaged: f32,
    /// Ticks in which the object was in contact.
    pub touched: u32,
    pub softened: f32,
}

/// Fixed parameters of the sequences.
#[derive(Clone, Copy)]
pub struct Bench<'a, 'i> {
    pub scene: &'a SceneImage<'i>,
    /// The held part.
    pub part: u16,
    /// The part that targets name.
    pub fixed: u16,
    /// Largest distance that a hand moves, m.
    pub range: f64,
    pub ticks: u32,
    /// Whether any targets are sent.
    pub guided: bool,
}

/// Runs sequence `seed`.
pub fn play(bench: &Bench<'_, '_>, settings: &Settings, seed: u64) -> Seen {
    let Bench {
        scene,
        part,
        fixed,
        range,
        ticks,
        guided,
    } = *bench;
    let mut random = Random(seed);
    let mut settings = *settings;
    let period = f64::from(settings.period_s);
    let mut state = Box::new(State::new());
    let state = &mut *state;
    state.load_scene(scene);
    let placed = state.placement(part).expect("in the scene");
    let start = Place {
        position: placed.position.as_dvec3() + random.direction() * random.within(0.0, 0.02),
        orientation: DQuat::IDENTITY,
    };
    let mut hand = Operator::new(&mut random, start, range);
    settings.guidance.method = if random.chance(0.3) {
        GuidanceMethod::Thesis
    } else {
        GuidanceMethod::Capped
    };
    if hand.readings.is_some() {
        settings.passivity.position_count_m = COUNT_M as f32;
        settings.passivity.angle_count_rad = COUNT_RAD as f32;
    }
    let switches = random.chance(0.1);
    let method = settings.guidance.method;
    let at_grab = hand.input(period);
    state.grab(scene, part, &at_grab.handle).expect("may be grabbed");
    let grabbed = Place {
        position: at_grab.handle.position.as_dvec3(),
        orientation: at_grab.handle.orientation.as_dquat().normalize(),
    };
    let mut observer = Observer::new(scene, state, &settings, &grabbed).expect("in hand");
    let mut known: Vec<ConstraintTarget> = Vec::new();
    let (mut sequence, mut due) = (0u16, random.below(300) as u32);
    let pace = random.decade(10.0, 500.0);
    let mut seen = Seen {
        seed,
        hold: hand.hold,
        moving: hand.moving,
        counted: hand.readings.is_some(),
        method,
        given_j: 0.0,
        passed_j: 0.0,
        peak_n: 0.0,
        step_n: 0.0,
        step_nm: 0.0,
        taken: 0,
        engaged: 0.0,
        touched: 0,
        softened: 0.0,
    };
    let mut last = Wrench::ZERO;
    for t in 0..ticks {
        hand.choose(&mut random, t);
        while t >= due && guided {
            due = t + 1 + (pace * random.within(0.0, 2.0)) as u32;
            // One at a time, or as many as the board holds.
            let many = if random.chance(0.15) { MAX_TARGETS } else { 1 };
            for _ in 0..many {
                let ids = 2 * MAX_TARGETS as u64;
                match random.below(10) {
                    0 => state.clear_target(random.below(ids) as u16),
                    1..=4 if !known.is_empty() => {
                        // A refresh, possibly late or lost.
                        let i = random.below(known.len() as u64) as usize;
                        sequence = sequence.wrapping_add(1);
                        known[i].sequence = sequence;
                        let _ = state.set_target(&known[i]);
                    }
                    _ => {
                        sequence = sequence.wrapping_add(1);
                        let (object, _) = state.object().expect("in hand");
                        // In the frame of the part that the target names.
                        let seen_from = state.placement(fixed).expect("in the scene").inverse();
                        let object = seen_from.compose(object);
                        let object = Place {
                            position: object.position.as_dvec3(),
                            orientation: object.orientation.as_dquat(),
                        };
                        let target = ConstraintTarget {
                            static_part: fixed,
                            ..target(&mut random, &object, sequence, ids)
                        };
                        if state.set_target(&target).is_ok() {
                            seen.taken += 1;
                            known.push(target);
                        }
                    }
                }
            }
        }
        if switches && random.chance(0.003) {
            settings.guidance.method = match random.below(3) {
                0 => GuidanceMethod::Off,
                1 => GuidanceMethod::Capped,
                _ => GuidanceMethod::Thesis,
            };
        }
        let input = hand.input(period);
        observer.look(state);
        let out = tick(state, scene, &settings, &input);
        let from = hand.at;
        hand.advance(&out.handle, t, period);
        observer.tick(state, &from, &hand.at, &out.handle);
        seen.peak_n = seen.peak_n.max(f64::from(out.handle.force.length()));
        seen.step_n = seen
            .step_n
            .max(f64::from((out.handle.force - last.force).length()));
        seen.step_nm = seen
            .step_nm
            .max(f64::from((out.handle.torque - last.torque).length()));
        last = out.handle;
        seen.engaged = seen.engaged.max(out.guidance.engagement);
        seen.touched += u32::from(out.work.contacts > 0);
        seen.softened = seen.softened.max(state.passivity().softened);
    }
    seen.given_j = observer.given_j();
    seen.passed_j = observer.passed_j();
    seen
}

/// Any target that the board accepts, with the object at `object`.
fn target(random: &mut Random, object: &Place, sequence: u16, ids: u64) -> ConstraintTarget {
    let kinds = ConstraintKind::ALL;
    let kind = kinds[random.below(kinds.len() as u64) as usize];
    let feature = |point: DVec3, direction: DVec3| Feature {
        point: point.as_vec3().to_array(),
        direction: direction.normalize().as_vec3().to_array(),
    };
    let point = random.direction() * random.within(0.0, 0.03);
    let direction = random.direction();
    let off = random.direction() * random.decade(1e-5, 0.1);
    let tilt = random.direction() * random.decade(1e-3, 3.1);
    let fixed_point = object.orientation * point + object.position + off;
    let turned = DQuat::from_scaled_axis(tilt) * object.orientation;
    let fixed_direction = turned * direction;
    let mut faces = heapless::Vec::new();
    if random.chance(0.5) {
        let _ = faces.push((0, 3));
    }
    ConstraintTarget {
        id: random.below(ids) as u16,
        sequence,
        kind,
        moving: feature(point, direction),
        static_part: 0,
        fixed: feature(fixed_point, fixed_direction),
        stiffness: if random.chance(0.5) {
            1e6
        } else {
            random.decade(1.0, 1e7) as f32
        },
        force_cap: if random.chance(0.1) {
            0.0
        } else {
            random.decade(0.01, 100.0) as f32
        },
        torque_cap: if random.chance(0.1) {
            0.0
        } else {
            random.decade(1e-3, 10.0) as f32
        },
        expiry_ticks: match random.below(4) {
            0 => 60_000,
            1 => 1 + random.below(20) as u16,
            _ => 1 + random.below(600) as u16,
        },
        path: (kind == ConstraintKind::Path).then(|| Path {
            orientation: turned.normalize().as_quat().to_array(),
            turn: match random.below(3) {
                0 => PathTurn::Free,
                1 => PathTurn::Geared(0.0),
                _ => PathTurn::Geared((random.within(-1.0, 1.0) * random.decade(1.0, 1e4)) as f32),
            },
            ends: random.chance(0.5),
        }),
        faces,
    }
}
