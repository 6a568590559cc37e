//! The links of a described mechanism in any posture, by the kinematics that every board uses ([`Model`]), and the planes in which they are drawn.
//!
//! Lengths are in millimetres in the mechanism's own frame (`docs/rigs.md`), in which the links lie in planes that [`View`]s look at; the world's
//! frame is the one in which parts and handle are shown elsewhere.

use glam::{DQuat, DVec2, DVec3};
use mortise_mechanism::kinematics::{Model, Posture};
use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::{Kinematics, Rig, RigFault};

/// Angles of the joints, rad; those of absent joints are 0.
pub type Angles = [f64; MAX_JOINTS];

/// A plane of the mechanism that is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Along the mechanism's z: its x to the right, its y up.
    Top,
    /// The plane of an arm, which its yaw turns: away from the yaw axis to the right, z up.
    Side,
}

impl View {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Top => "Top",
            Self::Side => "Side",
        }
    }

    /// The direction to the right and the one up.
    fn directions(self, yaw: f64) -> [DVec3; 2] {
        match self {
            Self::Top => [DVec3::X, DVec3::Y],
            Self::Side => [DVec3::new(yaw.cos(), yaw.sin(), 0.0), DVec3::Z],
        }
    }
}

/// The mechanism in one posture, own frame, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// Ends of the links, from the base on.
    pub links: Vec<[DVec3; 2]>,
    /// Where the axes of its joints are, those with a motor first, in their order.
    pub joints: Vec<DVec3>,
    /// The handle; `None` where the links cannot be connected.
    pub handle: Option<DVec3>,
    /// The handle in the world, mm.
    pub in_world: Option<DVec3>,
    /// Share of a force that is rendered here, 0 to 1.
    pub share: f64,
    /// The yaw that turns the side view, rad.
    pub yaw: f64,
}

/// A described mechanism.
#[derive(Clone, Debug)]
pub struct Links {
    model: Model,
    kinematics: Kinematics,
    /// Own frame to world.
    turn: DQuat,
    /// World's origin in the own frame, m.
    origin: DVec3,
    /// Largest distance from the world's origin, mm.
    workspace: f64,
    home: Angles,
    ranges: Vec<[f64; 2]>,
    has_wrist: bool,
}

impl Links {
    /// The links of a description.
    ///
    /// # Errors
    /// See [`Model::new`].
    pub fn new(rig: &Rig) -> Result<Self, RigFault> {
        let mut home = [0.0; MAX_JOINTS];
        for (angle, joint) in home.iter_mut().zip(&rig.joints) {
            *angle = f64::from(joint.home);
        }
        let mount = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
        Ok(Self {
            model: Model::new(rig)?,
            kinematics: rig.kinematics,
            turn: DQuat::from_scaled_axis(mount(rig.mount.turn)),
            origin: mount(rig.mount.origin),
            workspace: 1e3 * f64::from(rig.ceilings.workspace),
            home,
            ranges: (rig.joints.iter())
                .map(|joint| joint.range.map(f64::from))
                .collect(),
            has_wrist: rig.wrist.is_some(),
        })
    }

    /// Planes in which it is drawn.
    pub fn views(&self) -> &'static [View] {
        match self.kinematics {
            Kinematics::Paddle { .. } | Kinematics::Pantograph { .. } => &[View::Top],
            Kinematics::SerialArm { .. } => &[View::Side, View::Top],
        }
    }

    /// Smallest and largest angle of each joint, rad.
    pub fn ranges(&self) -> &[[f64; 2]] {
        &self.ranges
    }

    /// The pose in which counting starts.
    pub fn home(&self) -> Angles {
        self.home
    }

    /// Whether three axes without motors carry the handle.
    pub fn has_wrist(&self) -> bool {
        self.has_wrist
    }

    /// Angles within the joints' ranges, near these.
    pub fn clamp(&self, mut angles: Angles) -> Angles {
        for (angle, [from, to]) in angles.iter_mut().zip(&self.ranges) {
            *angle = angle.clamp(*from, *to);
        }
        angles
    }

    /// The posture at these angles, in the world, m; `None` where the links cannot be connected.
    pub fn posture(&self, angles: Angles) -> Option<Posture> {
        self.model.posture(angles.map(|angle| angle as f32), [0.0; 3])
    }

    /// The handle in the world, mm; `None` where the links cannot be connected.
    pub fn handle_in_world(&self, angles: Angles) -> Option<DVec3> {
        Some(1e3 * self.posture(angles)?.position.as_dvec3())
    }

    /// The handle in the own frame, mm.
    pub fn handle(&self, angles: Angles) -> Option<DVec3> {
        let world = self.posture(angles)?.position.as_dvec3();
        Some(1e3 * (self.turn.inverse() * world + self.origin))
    }

    /// The links in a posture. What the model does not give, the ends of the links before the handle, are the lengths of `docs/rigs.md` turned by the
    /// joints' angles.
    pub fn skeleton(&self, angles: Angles) -> Skeleton {
        let handle = self.handle(angles);
        let mm = |length: f32| 1e3 * f64::from(length);
        let flat = |angle: f64| DVec3::new(angle.cos(), angle.sin(), 0.0);
        let (mut links, joints, yaw) = match self.kinematics {
            Kinematics::Paddle { .. } => (Vec::new(), vec![DVec3::ZERO], 0.0),
            Kinematics::Pantograph { base, proximal, .. } => {
                let motors = [-0.5, 0.5].map(|side| DVec3::X * side * mm(base));
                let elbows = [0, 1].map(|side| motors[side] + mm(proximal[side]) * flat(angles[side]));
                let links = [0, 1].map(|side| [motors[side], elbows[side]]);
                (
                    links.to_vec(),
                    vec![motors[0], motors[1], elbows[0], elbows[1]],
                    0.0,
                )
            }
            Kinematics::SerialArm {
                base_height, upper, ..
            } => {
                let shoulder = DVec3::Z * mm(base_height);
                let (sin, cos) = angles[1].sin_cos();
                let elbow = shoulder + mm(upper) * (flat(angles[0]) * sin + DVec3::Z * cos);
                let links = vec![[DVec3::ZERO, shoulder], [shoulder, elbow]];
                (links, vec![DVec3::ZERO, shoulder, elbow], angles[0])
            }
        };
        let ends: &[DVec3] = match self.kinematics {
            Kinematics::Paddle { .. } => &joints,
            Kinematics::Pantograph { .. } | Kinematics::SerialArm { .. } => &joints[2..],
        };
        if let Some(handle) = handle {
            links.extend(ends.iter().map(|&end| [end, handle]));
        }
        Skeleton {
            links,
            joints,
            handle,
            in_world: self.handle_in_world(angles),
            share: self
                .posture(angles)
                .map_or(0.0, |posture| f64::from(posture.share())),
            yaw,
        }
    }

    /// A direction of the world in the own frame.
    pub fn to_own(&self, direction: DVec3) -> DVec3 {
        self.turn.inverse() * direction
    }

    /// A point of the own frame in a view, with the yaw of the arm, mm.
    pub fn seen(&self, view: View, yaw: f64, point: DVec3) -> DVec2 {
        let [right, up] = view.directions(yaw);
        DVec2::new(right.dot(point), up.dot(point))
    }

    /// The world's origin and the ends of its axes, a millimetre away, in a view, mm.
    pub fn world_axes(&self, view: View, yaw: f64) -> (DVec2, [DVec2; 3]) {
        let back = self.turn.inverse();
        let axes = DVec3::AXES.map(|axis| self.seen(view, yaw, back * axis));
        (self.seen(view, yaw, 1e3 * self.origin), axes)
    }

    /// Where the sphere of the workspace about the world's origin cuts the plane of a view through the handle: centre and radius, mm. `None`: nowhere.
    pub fn workspace(&self, view: View, skeleton: &Skeleton) -> Option<(DVec2, f64)> {
        let [right, up] = view.directions(skeleton.yaw);
        let away = (skeleton.handle? - 1e3 * self.origin).dot(right.cross(up));
        let square = self.workspace * self.workspace - away * away;
        let centre = self.seen(view, skeleton.yaw, 1e3 * self.origin);
        (square > 0.0).then(|| (centre, square.sqrt()))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use mortise_rig::{EXAMPLES, parse_rig};
    use proptest::prelude::*;

    use super::*;

    pub fn example(number: usize) -> Rig {
        let (name, text) = EXAMPLES[number];
        parse_rig(text, name).expect(name)
    }

    /// A pantograph whose ranges go beyond where its links reach each other: its elbows come 240 mm apart, its outer links are 180 mm.
    pub fn loose() -> Rig {
        let mut rig = example(1);
        if let Kinematics::Pantograph { base, .. } = &mut rig.kinematics {
            *base = 0.1;
        }
        rig
    }

    /// Angles at these shares of the ranges.
    pub fn within(mechanism: &Links, shares: [f64; 3]) -> Angles {
        let mut angles = [0.0; MAX_JOINTS];
        for ((angle, [from, to]), share) in angles.iter_mut().zip(mechanism.ranges()).zip(shares) {
            *angle = from + share * (to - from);
        }
        angles
    }

    fn lengths(rig: &Rig) -> Vec<f64> {
        let lengths = match rig.kinematics {
            Kinematics::Paddle { radius } => vec![radius],
            Kinematics::Pantograph { proximal, distal, .. } => [proximal, distal].concat(),
            Kinematics::SerialArm {
                base_height,
                upper,
                lower,
            } => vec![base_height, upper, lower],
        };
        lengths
            .into_iter()
            .map(|length| 1e3 * f64::from(length))
            .collect()
    }

    proptest! {
        /// Drawn links have their described lengths in every posture, wherever the mechanism is mounted: the handle is the model's, the other ends are drawn.
        #[test]
        fn links_keep_their_lengths(
            number in 0..EXAMPLES.len(), shares in prop::array::uniform3(0.0..1.0f64), turn in prop::array::uniform3(-1.5..1.5f32),
        ) {
            let mut rig = example(number);
            rig.mount.turn = turn;
            let mechanism = Links::new(&rig).expect("a mechanism");
            let skeleton = mechanism.skeleton(within(&mechanism, shares));
            let drawn = skeleton.links.iter().map(|[a, b]| a.distance(*b));
            let expected = lengths(&rig);
            prop_assert!(skeleton.handle.is_none() || skeleton.links.len() == expected.len());
            for (drawn, expected) in drawn.zip(expected) {
                // The model computes in single precision.
                prop_assert!((drawn - expected).abs() < 2e-3, "{drawn} {expected}");
            }
            // The plane of the side view holds the whole arm.
            for view in mechanism.views() {
                let [right, up] = view.directions(skeleton.yaw);
                let normal = right.cross(up);
                for [a, b] in &skeleton.links {
                    prop_assert!(*view == View::Top || normal.dot(*a).abs().max(normal.dot(*b).abs()) < 2e-3);
                }
            }
        }

        /// The drawn circle has the handle inside exactly if it is within the workspace.
        #[test]
        fn the_workspace_is_cut_where_the_handle_is(
            number in 0..EXAMPLES.len(), shares in prop::array::uniform3(0.0..1.0f64),
        ) {
            let rig = example(number);
            let mechanism = Links::new(&rig).expect("a mechanism");
            let skeleton = mechanism.skeleton(within(&mechanism, shares));
            let Some((own, world)) = skeleton.handle.zip(skeleton.in_world) else { return Ok(()) };
            let beyond = world.length() - 1e3 * f64::from(rig.ceilings.workspace);
            for view in mechanism.views() {
                let seen = mechanism.seen(*view, skeleton.yaw, own);
                let inside = mechanism.workspace(*view, &skeleton).is_some_and(|(centre, radius)| seen.distance(centre) < radius);
                prop_assert!(inside == (beyond < 0.0) || beyond.abs() < 0.01);
            }
        }
    }
}
