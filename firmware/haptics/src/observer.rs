//! Observer outside of the law: energy that the device delivers to the operator beyond what the operator supplied, in double precision.
//!
//! For tests and experiments, not for the tick: the law reads nothing of it. The only internal quantity of the law that it uses is the slip of the
//! coupling ([`State::slip`]): a slip moves the coupling's spring, and the energy of a spring follows from its stretch.
//!
//! # What is measured
//!
//! The port is the handle: the wrench commanded in tick k is held while the handle's true motion to tick k + 1 is Δp and the rotation vector Δφ, so
//! the work of the device on the hand is exactly
//!
//! W_k = F_k·Δp + τ_k·Δφ
//!
//! (for the rotation, with an axis that is constant within the tick). The energy that may return to the hand is the energy stored on the handle's
//! side of the targets:
//!
//! S_k = U(d, θ) + ½·m·v² + ½·ω·I·ω
//!
//! the potential of the coupling's springs, which slip at their limits, measured from the slipped pose, and the kinetic energy of the object, all at
//! the start of tick k. The potential of contacts is excluded and so is a target's: energy that a target stores when it engages was supplied by
//! nobody. A loop is passive with the storage S when for all a < b no more energy leaves the port than the decrease of the stored energy. Here even
//! the energy stored at b is granted to the device, so that guidance may move the part, and
//!
//! E = max over all a < b of Σ_{a ≤ k < b} W_k − S_a
//!
//! is the energy delivered to the operator beyond what the operator supplied: the largest rise over *any* interval, so that a loop that dissipates
//! first cannot spend it later. One pass computes it. With Q, the energy that the operator supplied and may still get back,
//!
//! Q ← min(Q, S_k), Q ← Q − W_k, E = max(−Q), Q = 0 at first
//!
//! by induction: after tick b, −Q is the larger of its previous value plus W_b and of W_b − S_b, which is the maximum over a.

use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use mortise_protocol::image::SceneImage;

use crate::math::pose::{Pose, Wrench};
use crate::settings::Settings;
use crate::state::State;

/// Largest rise of a sum over any interval, beyond the energy stored at the interval's start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rise {
    /// Q.
    credit: f64,
    largest: f64,
}

impl Rise {
    /// Limits the credit to the energy stored now, J: the rest is dissipated.
    pub fn stored(&mut self, energy: f64) {
        self.credit = self.credit.min(energy);
    }

    /// Books work delivered to the operator, J.
    pub fn gave(&mut self, work: f64) {
        self.credit -= work;
        self.largest = self.largest.max(-self.credit);
    }

    /// E, 0 or more.
    pub fn most(&self) -> f64 {
        self.largest
    }
}

/// A placement in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// m.
    pub position: DVec3,
    /// Of unit length.
    pub orientation: DQuat,
}

impl Place {
    /// In single precision, as the law receives it.
    pub fn pose(&self) -> Pose {
        Pose::new(self.position.as_vec3(), self.orientation.as_quat())
    }

    fn of(pose: &Pose) -> Self {
        Self {
            position: double(pose.position),
            orientation: turn(pose.orientation),
        }
    }

    fn compose(&self, child: &Self) -> Self {
        Self {
            position: self.orientation * child.position + self.position,
            orientation: self.orientation * child.orientation,
        }
    }

    fn inverse(&self) -> Self {
        let orientation = self.orientation.conjugate();
        Self {
            position: -(orientation * self.position),
            orientation,
        }
    }
}

/// Observer of one held part; see the module.
#[derive(Clone, Debug)]
pub struct Observer {
    rise: Rise,
    /// The part in the handle's frame.
    offset: Place,
    center_of_mass: DVec3,
    mass: f64,
    /// Inertia over mass, part's frame, m².
    inertia: DMat3,
    settings: Settings,
    /// The object at the tick's start, and its linear and angular velocity.
    object: Place,
    twist: [DVec3; 2],
    /// Sum of |W|, J.
    passed: f64,
}

impl Observer {
    /// Observer of a part that was grabbed by the handle at `handle` just now; `None` when none is held.
    pub fn new(scene: &SceneImage<'_>, state: &State, settings: &Settings, handle: &Place) -> Option<Self> {
        let part = usize::from(state.grabbed()?);
        let (object, _) = state.object()?;
        let record = scene.shape_of_part(part).record;
        let of_object = &settings.object;
        let [xx, yy, zz, xy, xz, yz] = record.inertia.map(|i| f64::from(i) / f64::from(record.volume));
        let inertia = DMat3::from_cols(
            DVec3::new(xx, xy, xz),
            DVec3::new(xy, yy, yz),
            DVec3::new(xz, yz, zz),
        );
        // Bounded as in the law: scaled down to its upper bound, the lower one added.
        let largest = [inertia.x_axis, inertia.y_axis, inertia.z_axis]
            .map(|row| row.abs().element_sum())
            .into_iter()
            .fold(0.0, f64::max);
        let squared = |radius: f32| f64::from(radius) * f64::from(radius);
        let (lower, upper) = (
            squared(of_object.gyration_min_m),
            squared(of_object.gyration_max_m),
        );
        Some(Self {
            rise: Rise::default(),
            offset: handle.inverse().compose(&Place::of(&object)),
            center_of_mass: double(Vec3::from_array(record.center_of_mass)),
            mass: f64::from(of_object.mass_kg),
            inertia: inertia * (upper / largest).min(1.0) + DMat3::from_diagonal(DVec3::splat(lower)),
            settings: *settings,
            object: Place::of(&object),
            twist: [DVec3::ZERO; 2],
            passed: 0.0,
        })
    }

    /// Records, before a tick, where the object is and how it moves.
    pub fn look(&mut self, state: &State) {
        if let Some((pose, twist)) = state.object() {
            self.object = Place::of(&pose);
            self.twist = [double(twist.linear), double(twist.angular)];
        }
    }

    /// Books a tick after it: `state` is the result, the handle was truly at `from`, and the `wrench` is held while it moves to `to`.
    pub fn tick(&mut self, state: &State, from: &Place, to: &Place, wrench: &Wrench) {
        let stored = self.stored(state, from);
        self.rise.stored(stored);
        let moved = to.position - from.position;
        let turned = rotation_vector(from.orientation, to.orientation);
        let work = double(wrench.force).dot(moved) + double(wrench.torque).dot(turned);
        self.passed += work.abs();
        self.rise.gave(work);
    }

    /// E, J.
    pub fn given_j(&self) -> f64 {
        self.rise.most()
    }

    /// All work that passed in either direction, J.
    pub fn passed_j(&self) -> f64 {
        self.passed
    }

    /// S, J.
    fn stored(&self, state: &State, handle: &Place) -> f64 {
        let slip = state.slip();
        let place = handle.compose(&self.offset);
        let center = |at: &Place| at.orientation * self.center_of_mass + at.position;
        let stretch = center(&place) - center(&self.object) - handle.orientation * double(slip.linear);
        let angle = rotation_vector(self.object.orientation, place.orientation)
            - handle.orientation * double(slip.angular);
        let c = &self.settings.coupling;
        let spring = |k: f32, max: f32, stretch: DVec3| {
            let (k, max, d) = (f64::from(k), f64::from(max), stretch.length());
            if k * d > max {
                max * (d - 0.5 * max / k)
            } else {
                0.5 * k * d * d
            }
        };
        let [v, w] = self.twist;
        let body = self.object.orientation.conjugate() * w;
        let moving = 0.5 * self.mass * (v.length_squared() + body.dot(self.inertia * body));
        let open = 1.0 - f64::from(state.passivity().softened);
        open * (spring(c.k_t_n_per_m, c.force_max_n, stretch) + spring(c.k_r, c.torque_max_nm, angle))
            + moving
    }
}

fn double(v: Vec3) -> DVec3 {
    v.as_dvec3()
}

fn turn(q: Quat) -> DQuat {
    q.as_dquat().normalize()
}

/// Rotation vector from `from` to `to`, world axes, rad.
fn rotation_vector(from: DQuat, to: DQuat) -> DVec3 {
    let q = to * from.conjugate();
    let q = if q.w < 0.0 { -q } else { q };
    let (axis, sine) = (DVec3::new(q.x, q.y, q.z), DVec3::new(q.x, q.y, q.z).length());
    if sine > 0.0 {
        axis * (2.0 * libm::atan2(sine, q.w) / sine)
    } else {
        DVec3::ZERO
    }
}
