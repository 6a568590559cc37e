//! Figures from telemetry: depth, press forces, impulses, energy at the handle.

use glam::{DAffine3, DQuat, DVec3};
use mortise_haptics::{Settings, Twist};
use mortise_protocol::message::{Flags, Telemetry, WirePose, WireWrench};

use crate::port::Port;
use crate::scenario::{Depth, Press};
use crate::scene::{Body, PreparedScene};
use crate::wire::{pose_mm, vector};

/// Largest force commanded from the second tick after the one in which a fault was seen, N. A sample carries the number of finished ticks: its own
/// tick is one less.
pub fn force_after(samples: &[Telemetry], fault_tick: u32) -> f64 {
    (samples.iter())
        .filter(|sample| sample.tick > fault_tick + 2)
        .map(|sample| vector(sample.wrench.force).length())
        .fold(0.0, f64::max)
}

/// Depth of the moving part, mm, the hole's depth, and the distance of the part's centre of mass from the axis.
pub fn depth(scene: &PreparedScene, depth: &Depth, moving: &DAffine3) -> Option<(f64, f64, f64)> {
    let axis = DVec3::from_array(depth.axis).try_normalize()?;
    let fixed = scene.bodies().get(scene.part_named(&depth.fixed)?)?;
    let part = scene.bodies().get(usize::from(scene.part))?;
    let along = |body: &Body, placement: &DAffine3| {
        let vertices = body.surface.shape().mesh.vertices.iter();
        vertices.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &vertex| {
            let t = placement.transform_point3(vertex).dot(axis);
            (low.min(t), high.max(t))
        })
    };
    let (mouth, bottom) = along(fixed, &fixed.placement);
    let (_, tip) = along(part, moving);
    let center = moving.transform_point3(part.surface.shape().center_of_mass);
    let off = center - DVec3::from_array(depth.through_mm);
    Some((tip - mouth, bottom - mouth, (off - off.dot(axis) * axis).length()))
}

/// Share of ticks that left out points: decimated where they did not fit the budget, or contacts beyond the most that are kept, %.
pub fn left_out_percent(samples: &[Telemetry]) -> f64 {
    let mut incomplete = Flags::BUDGET;
    incomplete.insert(Flags::CONTACTS);
    let left_out =
        (samples.iter()).filter(|sample| Flags::from_bits_retain(sample.flags).intersects(incomplete));
    100.0 * left_out.count() as f64 / samples.len().max(1) as f64
}

/// Deepest penetration reported by the board, mm.
pub fn board_deepest(samples: &[Telemetry]) -> f64 {
    let depths = samples.iter().filter_map(|sample| sample.pairs.first());
    depths.map(|pair| 1e3 * f64::from(pair.depth)).fold(0.0, f64::max)
}

/// Means of the handle's reaction and of the hand's force along the press direction over the settled samples, N.
pub fn press(press: &Press, settled: &[Telemetry]) -> Option<(f64, f64)> {
    let direction = DVec3::from_array(press.direction).try_normalize()?;
    let forces: Vec<(f64, f64)> = settled
        .iter()
        .filter_map(|sample| Some((sample.wrench, sample.hand?)))
        .map(|(handle, hand)| {
            (
                -vector(handle.force).dot(direction),
                vector(hand.force).dot(direction),
            )
        })
        .collect();
    if forces.is_empty() {
        return None;
    }
    let count = forces.len() as f64;
    let (handle, hand) = forces
        .iter()
        .fold((0.0, 0.0), |(a, b), &(handle, hand)| (a + handle, b + hand));
    Some((handle / count, hand / count))
}

/// Impulses of the contacts on the object and of the handle on the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impulse {
    /// ∫|contact force| dt, N s.
    pub contact_ns: f64,
    /// Largest contact force, N.
    pub contact_peak_n: f64,
    /// |∫(contact force − force on the handle) dt|, N s: the impulse on the object that does not reach the hand, which is the object's momentum (plus
    /// the reductions by limits and valve).
    pub lost_ns: f64,
}

/// Impulses over samples, each of which represents the time since the previous one.
pub fn impulse(samples: &[Telemetry]) -> Impulse {
    let mut found = Impulse::default();
    let mut lost = DVec3::ZERO;
    for pair in samples.windows(2) {
        let seconds = 1e-3 * f64::from(pair[1].tick.wrapping_sub(pair[0].tick));
        let contact = vector(pair[1].contact.force);
        found.contact_ns += contact.length() * seconds;
        found.contact_peak_n = found.contact_peak_n.max(contact.length());
        lost += (contact + vector(pair[1].guidance.wrench.force) - vector(pair[1].wrench.force)) * seconds;
    }
    found.lost_ns = lost.length();
    found
}

/// Largest work done on the object over any interval, mJ. Nothing counts as stored: energy that the springs of contacts and targets return counts as
/// generated.
pub struct ObjectEnergy {
    /// Work of contacts.
    pub contact_mj: f64,
    /// Work of contacts and targets together: through the whole port between the object and its constraints.
    pub constraint_mj: f64,
}

/// Computes [`ObjectEnergy`]. The wrenches of a tick, taken at its end, moved the object to the pose reported with them.
pub fn object_energy(scene: &PreparedScene, samples: &[Telemetry]) -> ObjectEnergy {
    let (mut contacts, mut both) = (Port::default(), Port::default());
    let center = center_of_mass(scene);
    for pair in samples.windows(2) {
        let (Some((_, from)), Some((_, to))) = (&pair[0].object, &pair[1].object) else {
            continue;
        };
        let (start, end) = (pose_mm(from), pose_mm(to));
        let moved = 1e-3 * (end.transform_point3(center) - start.transform_point3(center));
        let turned = turn(&start, &end);
        let near = share_of_first(pair[0].tick, pair[1].tick);
        let work = |get: fn(&Telemetry) -> &WireWrench| {
            let of = |w: &WireWrench| 1e3 * (vector(w.force).dot(moved) + vector(w.torque).dot(turned));
            (1.0 - near) * of(get(&pair[0])) + near * of(get(&pair[1]))
        };
        let by_contacts = work(|sample| &sample.contact);
        contacts.add(by_contacts);
        both.add(by_contacts + work(|sample| &sample.guidance.wrench));
    }
    ObjectEnergy {
        contact_mj: contacts.made(),
        constraint_mj: both.made(),
    }
}

/// Centre of mass of the part in hand, its frame, mm.
fn center_of_mass(scene: &PreparedScene) -> DVec3 {
    let part = scene.bodies().get(usize::from(scene.part));
    part.map_or(DVec3::ZERO, |part| part.surface.shape().center_of_mass)
}

/// Rotation vector from one pose to another, world axes.
pub(crate) fn turn(from: &DAffine3, to: &DAffine3) -> DVec3 {
    let rotation = |pose: &DAffine3| DQuat::from_mat3(&pose.matrix3);
    (rotation(to) * rotation(from).inverse())
        .normalize()
        .to_scaled_axis()
}

/// Share of the interval between two samples in which the first one's held wrench counts: 1 between consecutive ticks, else a half.
fn share_of_first(from_tick: u32, to_tick: u32) -> f64 {
    if to_tick.wrapping_sub(from_tick) == 1 {
        1.0
    } else {
        0.5
    }
}

/// Pose of the handle at the start of a tick, and the wrench held from there on.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// The tick.
    pub tick: u32,
    /// Pose of the handle, world.
    pub handle: WirePose,
    /// Wrench on the handle.
    pub wrench: WireWrench,
    /// The motion that the law received; `None` where it is not known.
    pub twist: Option<Twist>,
}

impl Felt {
    /// From a sample: its pose is that of the encoder readings.
    pub fn reported(sample: &Telemetry) -> Self {
        Self {
            tick: sample.tick,
            handle: sample.handle,
            wrench: sample.wrench,
            twist: None,
        }
    }
}

/// Work of the device on the handle, mJ: the largest over any interval beyond what was stored at its start ([`crate::port`]), and all that passed in
/// either direction. Between consecutive ticks, whose wrench is held from the first to the second, it is as exact as the poses; otherwise it is the
/// trapezoidal sum, blind to what happens between two samples. `felt` has an entry for each of `samples`.
///
/// For the stored energy see `Coupled::stored_mj`.
pub fn energy(
    scene: &PreparedScene,
    settings: &Settings,
    samples: &[Telemetry],
    felt: &[Felt],
) -> (f64, f64) {
    let coupled = Coupled::new(scene, settings, samples);
    let mut port = Port::default();
    for (index, pair) in felt.windows(2).enumerate() {
        let (from, to) = (pose_mm(&pair[0].handle), pose_mm(&pair[1].handle));
        let moved = 1e-3 * (to.translation - from.translation);
        let turned = turn(&from, &to);
        let first = share_of_first(pair[0].tick, pair[1].tick);
        let mean = |get: fn(&WireWrench) -> [f32; 3]| {
            first * vector(get(&pair[0].wrench)) + (1.0 - first) * vector(get(&pair[1].wrench))
        };
        let work = 1e3 * (mean(|w| w.force).dot(moved) + mean(|w| w.torque).dot(turned));
        let before = index.checked_sub(2).and_then(|start| samples.get(start..=index));
        let stored = (coupled.as_ref().zip(before))
            .and_then(|(coupled, before)| coupled.stored_mj(before, &pair[0]))
            .unwrap_or(0.0);
        port.add_beyond(stored, work);
    }
    (port.made(), port.passed())
}

/// The part in hand, for its stored energy.
pub(crate) struct Coupled<'a> {
    settings: &'a Settings,
    /// Centre of mass, m, in the handle's frame when the part was grabbed, and in its own frame.
    lever: DVec3,
    pub(crate) center: DVec3,
}

impl<'a> Coupled<'a> {
    /// `None` where no sample has a part in hand.
    pub(crate) fn new(scene: &PreparedScene, settings: &'a Settings, samples: &[Telemetry]) -> Option<Self> {
        let grabbed = samples.iter().find(|sample| sample.object.is_some())?;
        let center = 1e-3 * center_of_mass(scene);
        let (_, object) = grabbed.object.as_ref()?;
        Some(Self {
            settings,
            lever: meters(&grabbed.handle)
                .inverse()
                .transform_point3(meters(object).transform_point3(center)),
            center,
        })
    }

    /// Energy stored when the last of three consecutive ticks, `felt`, begins, mJ; `None` where it is not known.
    ///
    /// S = ½·k·d² + ½·k_R·θ² + ½·m·v²: the coupling's springs and the motion of the object's centre of mass. Stretch and angle are computed from the
    /// law's wrench, which is the wrench that moved the handle except for the encoder probes, because the slip of the part in the hand is not
    /// reported. With F, τ the wrench on the object at its centre of mass, V, Ω the motion of its place in the hand as the law received it, and v',
    /// ω' that of the object at the tick's end (differences of its poses), the law has
    ///
    /// F = k·d + (b + h·k)·(V − v'), and τ likewise,
    ///
    /// with d from the encoders' readings, to which their rounding is added. The omitted terms make the energy delivered too large: the energy of
    /// rotation, and the stretch that does not show in a wrench beyond the coupling's limits or reduced after the coupling.
    pub(crate) fn stored_mj(&self, samples: &[Telemetry], felt: &Felt) -> Option<f64> {
        let [a, b, c] = samples else {
            return None;
        };
        if b.tick.wrapping_sub(a.tick) != 1 || c.tick.wrapping_sub(b.tick) != 1 {
            return None;
        }
        let [before, at, after] = [&a.object, &b.object, &c.object].map(|object| object.as_ref());
        let [before, at, after] = [before?, at?, after?].map(|(_, pose)| meters(pose));
        let reported = felt.twist?;
        let s = &self.settings.coupling;
        let [h, m, k, b, k_r, b_r] = [
            self.settings.period_s,
            self.settings.object.mass_kg,
            s.k_t_n_per_m,
            s.b_t,
            s.k_r,
            s.b_r,
        ]
        .map(f64::from);
        let center = |object: &DAffine3| object.transform_point3(self.center);
        // A spring of zero stiffness stores no energy.
        let inverse = |stiffness: f64| if stiffness > 0.0 { stiffness.recip() } else { 0.0 };
        let read = meters(&c.handle);
        let lever = read.transform_vector3(self.lever);
        let truly = meters(&felt.handle);
        let force = -vector(c.wrench.force);
        let torque = -vector(c.wrench.torque) - lever.cross(force);
        let turning = reported.angular.as_dvec3();
        let place = reported.linear.as_dvec3() + turning.cross(lever);
        let linear = place - (center(&after) - center(&at)) / h;
        let angular = turning - turn(&at, &after) / h;
        let d = (force - (b + h * k) * linear) * inverse(k) + truly.transform_point3(self.lever)
            - read.transform_point3(self.lever);
        let angle = (torque - (b_r + h * k_r) * angular) * inverse(k_r) + turn(&read, &truly);
        let speed = (center(&at) - center(&before)) / h;
        let stored =
            0.5 * (k * d.length_squared() + k_r * angle.length_squared() + m * speed.length_squared());
        Some(1e3 * stored)
    }
}

/// A wire pose in metres.
pub(crate) fn meters(pose: &WirePose) -> DAffine3 {
    let mut pose = pose_mm(pose);
    pose.translation *= 1e-3;
    pose
}
