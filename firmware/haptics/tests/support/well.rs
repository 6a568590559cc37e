//! A geometric energy of simple form, and the same energy in double precision by its definition.
//!
//! The density of the fixed part is eight bells at the corners of a box whose middle is that of a cell of its lattice; the imaginary part is narrower ones.
//! Charges of the moving part lie about the corners of a box of the same size, at random about one corner and mirrored to the others. So by symmetry the
//! energy is least, −1, where the boxes are one.
#![allow(dead_code, reason = "each test file uses its share")]

use std::sync::LazyLock;

use glam::{DQuat, DVec3};
use mortise_haptics::{GuidanceMethod, Pose, Settings};
use mortise_protocol::image::{ChargeRecord, ENERGY_DEPTHS, EnergyRecord};

use super::support::image::{EnergyParts, Image, Writer};
use super::support::solids::Peg;
use super::support::{PEG_HALF, SLAB, exact_hole_and_peg};
use super::trial::Random;

/// Nodes of the lattice along the axes, even, and their distance, m.
const NODES: [usize; 3] = [26, 24, 30];
const STEP_M: f64 = 1e-3;
/// Half of the box with the bells, m, and their half widths.
const BOX_M: DVec3 = DVec3::new(5e-3, 4e-3, 7e-3);
const WIDTH_M: [f64; 2] = [2.0e-3, 1.7e-3];
/// Largest distance of charges from the corners along each axis, m, and the middle of their box in the moving part's frame.
const SPREAD_M: f64 = 1.5e-3;
const MIDDLE_M: DVec3 = DVec3::new(1e-3, -2e-3, 3e-3);
/// Poses about the least within which force and stiffness are sampled, and at which the tests look: m and rad.
pub const ABOUT: [f64; 2] = [6e-3, 0.3];
/// Excess over the majoriser that is none, over the depth: where a charge passes from cell to cell the slope of the interpolation jumps.
pub const SLACK: f64 = 2e-4;

/// A pose: position (m) and orientation.
pub type Frame = (DVec3, DQuat);

/// Pose `child` of the frame `parent` in the latter's parent.
pub fn compose(parent: Frame, child: Frame) -> Frame {
    (parent.0 + parent.1 * child.0, parent.1 * child.1)
}

/// An energy and the place of its least.
#[derive(Clone)]
pub struct Well {
    pub parts: EnergyParts,
    /// Pose of the moving part in the fixed one's frame where the energy is least.
    pub home: Frame,
    /// Largest torque about the centre of mass, over the largest force, m.
    pub arm_m: f64,
}

/// Energy, force and torque about the moving part's origin, in the fixed part's frame, for unit depth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    pub energy: f64,
    pub force: DVec3,
    pub torque: DVec3,
}

impl Well {
    /// A well of part `moving`, least where its frame is `home` off that of part `fixed`, with eight times `octant` charges.
    pub fn new(moving: u16, fixed: u16, home: DVec3, octant: usize) -> Self {
        let center = home + MIDDLE_M;
        let origin = center - DVec3::from_array(NODES.map(|n| 0.5 * (n - 1) as f64 * STEP_M));
        let mut random = Random(17 + octant as u64);
        let charges = (0..8 * octant).scan(DVec3::ZERO, |offset, i| {
            if i % 8 == 0 {
                *offset = BOX_M + DVec3::from_array([0; 3].map(|_| random.within(-SPREAD_M, SPREAD_M)));
            }
            let side = |axis: usize| if i >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let at = MIDDLE_M + *offset * DVec3::new(side(0), side(1), side(2));
            Some(ChargeRecord {
                at: at.as_vec3().to_array(),
                charge: [1.0, 0.4],
            })
        });
        let [width, height, depth] = NODES;
        let nodes = (0..width * height * depth).map(|i| {
            let node = [i % width, i / width % height, i / width / height].map(|n| n as f64);
            let off = (DVec3::from_array(node) * STEP_M + origin - center).abs() - BOX_M;
            let bell = |width: f64| (-0.5 * (off / width).length_squared()).exp();
            [
                (127.0 * bell(WIDTH_M[0])).round() as i8,
                (-90.0 * bell(WIDTH_M[1])).round() as i8,
            ]
        });
        let record = EnergyRecord {
            moving,
            fixed,
            origin: origin.as_vec3().to_array(),
            step: STEP_M as f32,
            size: NODES.map(|n| n as u16),
            largest_force: 1.0,
            way: DVec3::new(0.48, -0.6, 0.64).as_vec3().to_array(),
            ..EnergyRecord::default()
        };
        let mut well = Self {
            parts: EnergyParts {
                record,
                charges: charges.collect(),
                nodes: nodes.collect(),
            },
            home: (home, DQuat::IDENTITY),
            arm_m: 0.0,
        };
        let depth = -well.cost(well.home).energy;
        for charge in &mut well.parts.charges {
            charge.charge = charge.charge.map(|q| (f64::from(q) / depth) as f32);
        }
        well.measure();
        well
    }

    /// The energy by its definition at a pose of the moving part in the fixed part's frame.
    pub fn cost(&self, pose: Frame) -> Cost {
        let record = &self.parts.record;
        let origin = DVec3::from_array(record.origin.map(f64::from));
        let step = f64::from(record.step);
        let mut cost = Cost::default();
        for charge in &self.parts.charges {
            let arm = pose.1 * DVec3::from_array(charge.at.map(f64::from));
            let place = (pose.0 + arm - origin) / step;
            let first = place.floor();
            let last = DVec3::from_array(NODES.map(|n| (n - 2) as f64));
            if first.cmplt(DVec3::ZERO).any() || first.cmpgt(last).any() {
                continue;
            }
            let [x, y, z] = (place - first).to_array().map(|u| [1.0 - u, u]);
            let index = first.to_array().map(|i| i as usize);
            let [re, im] = charge.charge.map(f64::from);
            for corner in 0..8 {
                let [i, j, k] = [0, 1, 2].map(|axis| corner >> axis & 1);
                let node = index[0] + i + NODES[0] * (index[1] + j + NODES[1] * (index[2] + k));
                let node = self.parts.nodes[node];
                let value = f64::from(node[0]) * re - f64::from(node[1]) * im;
                let sign = |side: usize| 2.0 * side as f64 - 1.0;
                let slope = DVec3::new(
                    sign(i) * y[j] * z[k],
                    x[i] * sign(j) * z[k],
                    x[i] * y[j] * sign(k),
                ) * (value / step);
                cost.energy -= x[i] * y[j] * z[k] * value;
                cost.force += slope;
                cost.torque += arm.cross(slope);
            }
        }
        cost
    }

    /// A pose about the least in the fixed part's frame, within shares of [`ABOUT`].
    pub fn pose_about(&self, random: &mut Random, share: f64) -> Frame {
        moved(
            self.home,
            random.direction() * (ABOUT[0] * share * random.within(0.0, 1.0)),
            random.direction() * (ABOUT[1] * share * random.within(0.0, 1.0)),
        )
    }

    /// States the largest force and majorising stiffness: the largest excess of the energy over its linear model among many displacements of each kind,
    /// times 2 for displacements of several kinds at once.
    fn measure(&mut self) {
        let mut random = Random(3);
        let way = DVec3::from_array(self.parts.record.way.map(f64::from));
        let (mut force, mut torque, mut stiffness) = (0.0f64, 0.0f64, [0.0f64; 3]);
        for _ in 0..4000 {
            let pose = self.pose_about(&mut random, 1.5);
            let here = self.cost(pose);
            force = force.max(here.force.length());
            torque = torque.max(here.torque.length());
            for (family, most) in stiffness.iter_mut().enumerate() {
                let (by, turn) = displacement(&mut random, way, family);
                let there = self.cost(moved(pose, by, turn)).energy;
                let linear = -here.force.dot(by) - here.torque.dot(turn);
                let squared = by.length_squared() + turn.length_squared();
                *most = most.max(2.0 * (there - here.energy - linear - 0.25 * SLACK) / squared);
            }
        }
        let record = &mut self.parts.record;
        let [across, along, turning] = stiffness.map(|k| [(2.0 * k) as f32; ENERGY_DEPTHS]);
        (record.across, record.along, record.turning) = (across, along, turning);
        record.largest_force = force as f32;
        self.arm_m = torque / force;
    }

    /// Excess of the energy at a displaced pose over the majorising model about `pose`.
    pub fn excess(&self, pose: Frame, by: DVec3, turn: DVec3) -> f64 {
        let here = self.cost(pose);
        let (force, torque) = self.pull(by, turn);
        let linear = here.force.dot(by) + here.torque.dot(turn);
        let model = here.energy - linear + 0.5 * (force.dot(by) + torque.dot(turn));
        self.cost(moved(pose, by, turn)).energy - model
    }

    /// Force and torque of the majorising stiffness, for unit depth, fixed part's frame.
    pub fn pull(&self, by: DVec3, turn: DVec3) -> (DVec3, DVec3) {
        let record = &self.parts.record;
        let way = DVec3::from_array(record.way.map(f64::from));
        let [across, along, turning] =
            [record.across, record.along, record.turning].map(|row| f64::from(row[0]));
        (
            by * across + way * ((along - across) * way.dot(by)),
            turn * turning,
        )
    }
}

/// A displacement across the way, along it, of rotation, or (3) of all kinds: up to 1 mm and 0.05 rad.
pub fn displacement(random: &mut Random, way: DVec3, family: usize) -> (DVec3, DVec3) {
    let by = random.direction() * random.decade(0.1e-3, 1e-3);
    let turn = random.direction() * random.decade(5e-3, 0.05);
    match family {
        0 => (by - way * way.dot(by), DVec3::ZERO),
        1 => (way * way.dot(by), DVec3::ZERO),
        2 => (DVec3::ZERO, turn),
        _ => (by, turn),
    }
}

/// A pose moved by `by` and turned about its own origin.
pub fn moved(pose: Frame, by: DVec3, turn: DVec3) -> Frame {
    (pose.0 + by, (DQuat::from_scaled_axis(turn) * pose.1).normalize())
}

/// Pose of the fixed part (0) of [`open_scene`]: aligned with nothing.
pub fn fixed() -> Frame {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    (
        DVec3::new(0.012, -0.02, 0.031),
        turn.as_quat().as_dquat().normalize(),
    )
}

/// Place of the pegs' origins in the fixed part's frame, m: 7 mm and more above it.
pub const HOME: [DVec3; 2] = [DVec3::new(2e-3, 5e-3, 37e-3), DVec3::new(0.0, 0.1, 40e-3)];

/// A slab and two pegs that touch nothing.
pub fn open_scene() -> Image {
    let mut w = Writer::new(1e-3);
    let slab = w.shape(&SLAB);
    let peg = w.shape(&Peg {
        radius: 8e-3,
        half_length: PEG_HALF,
        around: 16,
        rings: 2,
    });
    let (position, orientation) = fixed();
    let quat = orientation.as_quat().to_array();
    w.part(slab, false, position.as_vec3().to_array(), quat);
    for home in HOME {
        let (place, _) = compose(fixed(), (home, DQuat::IDENTITY));
        w.part(peg, true, place.as_vec3().to_array(), quat);
    }
    w.finish()
}

pub static OPEN: LazyLock<Image> = LazyLock::new(open_scene);
/// The peg 10 mm in its hole with 1 mm of clearance.
pub static HOLE: LazyLock<Image> = LazyLock::new(|| exact_hole_and_peg(1e-3, 10e-3));
/// Sums of four ticks, and of two.
pub static LARGE: LazyLock<Well> = LazyLock::new(|| Well::new(1, 0, HOME[0], 38));
pub static SMALL: LazyLock<Well> =
    LazyLock::new(|| Well::new(1, 0, HOME[0] + DVec3::new(1e-3, 2e-3, -1e-3), 24));

/// The image with the energies of these wells.
pub fn with(image: &Image, wells: &[&Well]) -> Image {
    let parts: Vec<_> = wells.iter().map(|well| well.parts.clone()).collect();
    image.with_energies(&parts)
}

/// Default settings with the energies as guidance.
pub fn energy_settings() -> Settings {
    let mut settings = Settings::default();
    settings.guidance.method = GuidanceMethod::Energy;
    settings
}

/// A pose in double precision.
pub fn frame_of(pose: &Pose) -> Frame {
    (pose.position.as_dvec3(), pose.orientation.as_dquat().normalize())
}

/// A pose in single precision, as the law receives it.
pub fn pose_of(frame: Frame) -> Pose {
    Pose::new(frame.0.as_vec3(), frame.1.as_quat())
}

/// Pose in the fixed part's frame.
pub fn in_fixed(world: Frame) -> Frame {
    let back = fixed().1.conjugate();
    (back * (world.0 - fixed().0), back * world.1)
}
