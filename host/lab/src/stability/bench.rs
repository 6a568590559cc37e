//! A closed loop on one axis: a handle on a sampled force law, which is the product's own tick with a part in hand.
//!
//! The handle moves along z and does not turn. m·v̇ = F_device(held) + F_hand − b·v − f_c·sign(v), F_hand = k_h·(x_w − x) + b_h·(v_w − v) + push,
//! integrated by fourth-order Runge–Kutta in `SUBSTEPS` steps a tick in double precision; where dry friction can hold the handle, it does. The
//! encoder rounds the position, the speed is its difference quotient, and the force is applied `delay_ticks` late. The work of the device is exact,
//! because its force is held.
//!
//! Generated energy is the largest rise over any interval (`port.rs`). At the handle the coupling's springs and the object's kinetic energy count as
//! stored, as [`mortise_haptics::observer`] defines it. Springs of contacts do not, nor does anything at the object: energy that they return counts
//! as generated.

use glam::DVec3;
use mortise_haptics::observer::{Observer, Place};
use mortise_haptics::{Input, Output, Passivity, Pose, Quat, Settings, State, Twist, Vec3, Wrench, tick};
use mortise_protocol::image::SceneImage;
use mortise_scenario::port::Port;

use super::oracle::Plant;
use super::sensor::{Readout, Sensor, Speed};

/// Integration steps a tick.
const SUBSTEPS: u32 = 4;

/// The loop's fixed parts.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    /// Handle and hand; the hand's spring pulls to the commanded position.
    pub plant: Plant,
    /// Share of `plant.damping` that is the hand's, N s/m.
    pub hand_damping: f64,
    /// f_c, N.
    pub coulomb_n: f64,
    /// The sensor.
    pub sensor: Sensor,
    /// Additional ticks from measuring to applying the force.
    pub delay_ticks: usize,
}

impl Rig {
    /// A handle held by nothing but its own friction, measured exactly.
    pub const fn bare(mass_kg: f64, damping: f64) -> Self {
        Self {
            plant: Plant {
                mass_kg,
                damping,
                stiffness: 0.0,
            },
            hand_damping: 0.0,
            coulomb_n: 0.0,
            sensor: Sensor::EXACT,
            delay_ticks: 0,
        }
    }

    /// The simulated mechanism of the rigs, in a hand of 400 N/m with 4 N s/m.
    pub const fn held() -> Self {
        Self {
            plant: Plant {
                mass_kg: 0.15,
                damping: 1.0 + 4.0,
                stiffness: 400.0,
            },
            hand_damping: 4.0,
            coulomb_n: 0.01,
            sensor: Sensor {
                resolution_m: 5e-6,
                speed: Speed::Filtered { filter_s: 3e-3 },
                share: 1.0,
            },
            delay_ticks: 0,
        }
    }
}

/// Command of the operator model for one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandCommand {
    /// Commanded position of the handle, m.
    pub position: f64,
    /// Commanded speed, m/s.
    pub speed: f64,
    /// Additional force, N.
    pub push: f64,
}

/// State of the closed loop.
pub struct Bench<'a> {
    /// The loop's parts; may be changed between ticks.
    pub rig: Rig,
    /// Settings of the force law.
    pub settings: Settings,
    scene: &'a SceneImage<'a>,
    state: Box<State>,
    /// x, m.
    pub position: f64,
    /// v, m/s.
    pub speed: f64,
    /// Orientation of the handle, which this loop does not change.
    pub orientation: Quat,
    readout: Readout,
    under_way: Vec<f64>,
    /// Observer of the device's work on the handle; `None` only if nothing could be grabbed.
    observer: Option<Observer>,
    /// Work of contacts on the object, J.
    contact: Port,
}

impl<'a> Bench<'a> {
    /// A loop with part `part` in hand where it stands, the handle at z = 0 and at rest.
    ///
    /// # Panics
    /// Never with a scene whose part may be moved, as in all scenes of this crate.
    pub fn new(scene: &'a SceneImage<'a>, part: u16, settings: Settings, rig: Rig) -> Self {
        let mut state = Box::new(State::new());
        state.load_scene(scene);
        let grabbed = state.grab(scene, part, &Pose::IDENTITY);
        debug_assert_eq!(grabbed, Ok(()));
        let observer = Observer::new(scene, &state, &settings, &place(0.0, Quat::IDENTITY));
        Self {
            rig,
            settings,
            scene,
            state,
            position: 0.0,
            speed: 0.0,
            orientation: Quat::IDENTITY,
            readout: Readout::new(&rig.sensor),
            under_way: vec![0.0; rig.delay_ticks],
            observer,
            contact: Port::default(),
        }
    }

    /// Largest energy delivered to the handle over any interval beyond what was stored at its start, J: generated energy. `NaN` if nothing is in
    /// hand.
    pub fn handle_made_j(&self) -> f64 {
        self.observer.as_ref().map_or(f64::NAN, Observer::given_j)
    }

    /// All work that passed through the handle in either direction, J.
    pub fn handle_passed_j(&self) -> f64 {
        self.observer.as_ref().map_or(f64::NAN, Observer::passed_j)
    }

    /// Largest work of contacts on the object over any interval, J.
    pub fn contact_made_j(&self) -> f64 {
        self.contact.made()
    }

    /// Passivity figures of the coupling.
    pub fn passivity(&self) -> Passivity {
        self.state.passivity()
    }

    /// Runs one tick, and the period after it.
    pub fn step(&mut self, command: &HandCommand) -> Output {
        let period = f64::from(self.settings.period_s);
        let sensor = self.rig.sensor;
        let (read, speed) = self.readout.read(&sensor, self.position, period);
        let along = |z: f64| Vec3::new(0.0, 0.0, z as f32);
        let input = Input {
            handle: Pose::new(along(read), self.orientation),
            handle_twist: Twist {
                linear: along(speed),
                angular: Vec3::ZERO,
            },
            enabled: true,
        };
        if let Some(observer) = &mut self.observer {
            observer.look(&self.state);
        }
        let out = tick(&mut self.state, self.scene, &self.settings, &input);
        let object = out.object_twist;
        let pushed = out.contact.force.dot(object.linear) + out.contact.torque.dot(object.angular);
        self.contact.add(f64::from(pushed) * period);
        self.under_way.push(f64::from(out.handle.force.z));
        let force = self.under_way.remove(0);
        let from = place(self.position, self.orientation);
        self.advance(force, command, period);
        if let Some(observer) = &mut self.observer {
            // The handle moves along z alone: no other component of the wrench does work.
            let held = Wrench {
                force: Vec3::new(0.0, 0.0, force as f32),
                torque: Vec3::ZERO,
            };
            observer.tick(&self.state, &from, &place(self.position, self.orientation), &held);
        }
        out
    }

    /// Moves the handle for a period under the device's force.
    fn advance(&mut self, force: f64, command: &HandCommand, period: f64) {
        let Rig {
            plant,
            hand_damping,
            coulomb_n,
            ..
        } = self.rig;
        let h = period / f64::from(SUBSTEPS);
        for i in 0..SUBSTEPS {
            // The commanded position moves on within the tick, as a hand does.
            let commanded = |t: f64| command.position + command.speed * (f64::from(i) * h + t);
            let smooth = |t: f64, x: f64, v: f64| {
                force + command.push + plant.stiffness * (commanded(t) - x) + hand_damping * command.speed
                    - plant.damping * v
            };
            let (x, v) = (self.position, self.speed);
            let load = smooth(0.0, x, v);
            if v == 0.0 && load.abs() <= coulomb_n {
                continue;
            }
            let against = coulomb_n * if v == 0.0 { load.signum() } else { v.signum() };
            let rate = |t: f64, x: f64, v: f64| (v, (smooth(t, x, v) - against) / plant.mass_kg);
            let a = rate(0.0, x, v);
            let b = rate(0.5 * h, x + 0.5 * h * a.0, v + 0.5 * h * a.1);
            let c = rate(0.5 * h, x + 0.5 * h * b.0, v + 0.5 * h * b.1);
            let d = rate(h, x + h * c.0, v + h * c.1);
            self.position += h / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            self.speed += h / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
            // Dry friction stops the handle; the next step starts from rest.
            if coulomb_n > 0.0 && v != 0.0 && self.speed.signum() != v.signum() {
                self.speed = 0.0;
            }
        }
    }
}

fn place(z: f64, orientation: Quat) -> Place {
    Place {
        position: DVec3::new(0.0, 0.0, z),
        orientation: orientation.as_dquat().normalize(),
    }
}
