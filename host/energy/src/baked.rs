//! Energy of a pair of parts as a board takes it: a few hundred charges of the moving part in a coarse lattice of the fixed one's density.
//!
//! Three things differ from [`crate::Pair`], because the published form does not guide where it is needed ([`crate`]):
//!
//! * **Without planes.** The density beside a plane, which does not fade with the distance, is subtracted on either side: flat faces no longer draw each other.
//! * **Strongest places.** Of the places in and around the moving part those with the largest density are kept, near the faces that mate.
//! * **Fitted charges.** The energy is linear in the charges at these places. Instead of the densities there, they are those of least size (ridge regression)
//!   with which on the way of the fit the gradient across it vanishes, the energy falls evenly from zero, where the way begins in the open, to its depth at the
//!   fit, and beside the way rises as 1 − 1/√(1 + (d/r)² + (φ·L/r)²), L the extent of where it acts. The way comes from exact surfaces: they place the
//!   minimum, the density gives the functions of which the well is made. Densities as charges, as published, contribute nothing to such a well: what they
//!   are scaled by in the best fit is zero for most pairs.
//!
//! Besides, the baker samples by how much the energy at a displaced pose exceeds its linear model, and states a stiffness that majorises it, for each depth: what
//! the board's implicit step needs.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_protocol::image::{ChargeRecord, ENERGY_DEPTHS, Energy, EnergyRecord};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use crate::density::Density;

/// Charges of an energy, and nodes of its lattice at most: together 31.9 KiB.
const CHARGES: usize = 384;
const NODES: usize = 12_400;
/// Places at which the moving part's density is looked at for its charges, about.
const PLACES: f64 = 6000.0;
/// Margin about the moving part in which it has charges, mm.
const MARGIN_MM: f64 = 4.0;
/// How far from the mating faces it has charges, mm.
const ABOUT_MM: f64 = 12.0;
/// Turn of the charges' lattice about an axis that is none of the part's.
const TURN_RAD: f64 = 0.297;
const TURN_ABOUT: DVec3 = DVec3::new(1.0, 2.0, 3.0);
/// Travel beyond the way's begin over which the energy rises to zero, mm, and the part of it over which it is fitted.
const BEYOND_MM: f64 = 12.0;
const FITTED_BEYOND_MM: f64 = 8.0;
/// r: displacement across the way at which the energy has risen by 0.3 of its depth there, mm.
const WIDTH_MM: f64 = 1.5;
/// Largest displacement beside the way for which the energy is fitted, mm, and the rotation, as a displacement at the distance L.
const ASIDE_MM: f64 = 5.0;
const TURNED_MM: f64 = 3.0;
/// Poses beside the way at each of its places, and the steps from one place to the next, mm.
const BESIDE: usize = 40;
const PLACE_STEP_MM: f64 = 0.53;
/// Weights of the fit: gradients across the way and of rotation, on the way and times r; energy on the way; energy beside it; and of the charges' changes.
/// With these the minimum is least off the fit over the three sections of `mortise-lab energy`.
const ACROSS_WEIGHT: f64 = 20.0;
const TURNED_WEIGHT: f64 = 40.0;
const ON_WAY_WEIGHT: f64 = 1.0;
const BESIDE_WEIGHT: f64 = 0.2;
const RIDGE: f64 = 1e-3;
/// Poses at which the stiffness is sampled, the largest displacement from each, mm, and rotation, rad; and the excess that is none, over the depth.
const STIFFNESS_POSES: usize = 3000;
const STIFFNESS_MM: f64 = 0.8;
const STIFFNESS_RAD: f64 = 0.03;
const STIFFNESS_SLACK: f64 = 1e-4;

/// Lengths in the image are in metres.
const M_PER_MM: f64 = 1e-3;

/// The motion by which the moving part reaches its fit, relative to the fixed part.
pub struct Way<'a> {
    /// Its length from the fit to the open, mm.
    pub length_mm: f64,
    /// Corners of the box, moving part's frame, about which it has charges, mm: that of its mating faces.
    pub mating: [DVec3; 2],
    /// Pose of the moving part in the fixed one's frame (mm) at a travel from the fit, mm; defined beyond the length, too.
    pub pose: &'a (dyn Fn(f64) -> DAffine3 + Sync),
}

/// An energy that is ready for an image.
#[derive(Clone, Debug)]
pub struct BakedEnergy {
    /// Its record; the numbers of parts, nodes and charges are zero until it is in an image.
    pub record: EnergyRecord,
    /// Charges.
    pub charges: Vec<ChargeRecord>,
    /// Nodes of its lattice, x fastest.
    pub nodes: Vec<[i8; 2]>,
    /// Root mean square deviation from the intended energy beside the way, over the depth.
    pub deviation: f64,
}

/// What a pose costs, over the depth, and its gradient: along x, y, z (1/mm) and about the axes through a point (1/rad).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Energy.
    pub energy: f64,
    /// Its derivatives by translation.
    pub slope: DVec3,
    /// Its derivatives by rotation.
    pub turn: DVec3,
}

impl BakedEnergy {
    /// Energy as the board computes it, before its sums; `about` is the point in the fixed part's frame (mm) that rotations are about.
    pub fn at(&self, pose: &DAffine3, about: DVec3) -> Cost {
        let Some(energy) = Energy::new(&self.record, &self.charges, &self.nodes) else {
            return Cost::default();
        };
        let mut cost = Cost::default();
        for charge in &self.charges {
            let at = DVec3::from_array(charge.at.map(f64::from)) / M_PER_MM;
            let Some((place, value, slope)) = look(&energy, pose, at, charge.charge) else {
                continue;
            };
            cost.energy -= value;
            cost.slope -= slope;
            cost.turn -= (place - about).cross(slope);
        }
        cost
    }
}

/// Place of a charge, Re(ρ·q) there and its gradient, 1/mm.
fn look(energy: &Energy<'_>, pose: &DAffine3, at: DVec3, charge: [f32; 2]) -> Option<(DVec3, f64, DVec3)> {
    let place = pose.transform_point3(at);
    let step = f64::from(energy.record.step);
    let origin = DVec3::from_array(energy.record.origin.map(f64::from));
    let (value, slope) = energy.at(((place * M_PER_MM - origin) / step).as_vec3().to_array(), charge)?;
    let slope = DVec3::from_array(slope.map(f64::from)) * (M_PER_MM / step);
    Some((place, f64::from(value), slope))
}

/// Makes the energy of a moving part in a fixed one's density along a way. `None` where the two have no density for each other: the lattice stays empty.
///
/// Cost: about 5 s on two cores, most of it densities.
pub fn bake(moving: &Density, fixed: &Density, way: &Way<'_>) -> Option<BakedEnergy> {
    let samples = strongest(moving, way.mating);
    let (record, nodes) = lattice(fixed, &samples, way)?;
    let mut baked = BakedEnergy {
        record,
        charges: Vec::new(),
        nodes,
        deviation: 0.0,
    };
    fit(&mut baked, &samples, way)?;
    majorise(&mut baked, way, moving.center_of_mass());
    Some(baked)
}

/// A place of the moving part and its density there, less that beside a plane.
type Sample = (DVec3, Complex<f64>);

fn strongest(moving: &Density, [low, high]: [DVec3; 2]) -> Vec<Sample> {
    let [least, most] = moving.extent();
    let (low, high) = (low - ABOUT_MM, high + ABOUT_MM);
    let (low, high) = (low.max(least - MARGIN_MM), high.min(most + MARGIN_MM));
    let (middle, half) = (low.midpoint(high), 0.5 * (high - low));
    let step = ((high - low).element_product() / PLACES).cbrt();
    let turned = DMat3::from_axis_angle(TURN_ABOUT.normalize(), TURN_RAD);
    let nodes = (half.length() / step).ceil() as i64;
    let places: Vec<DVec3> = (-nodes..=nodes)
        .flat_map(|x| (-nodes..=nodes).flat_map(move |y| (-nodes..=nodes).map(move |z| [x, y, z])))
        // Off the middle, where symmetric solids are.
        .map(|node| {
            turned * (step * (DVec3::from_array(node.map(|n| n as f64)) + DVec3::new(0.31, 0.17, 0.43)))
        })
        .filter(|place| place.abs().cmple(half).all())
        .map(|place| middle + place)
        .collect();
    let mut samples: Vec<Sample> = (places.into_par_iter())
        .map(|place| (place, moving.without_planes(place)))
        .collect();
    samples.sort_by(|a, b| b.1.norm().total_cmp(&a.1.norm()));
    samples.truncate(CHARGES);
    samples
}

/// Travels from the fit to where the fit of the charges ends, mm.
fn travels(way: &Way<'_>) -> Vec<f64> {
    let last = way.length_mm + FITTED_BEYOND_MM;
    let count = (last / PLACE_STEP_MM).ceil().clamp(20.0, 120.0) as usize;
    (0..=count).map(|i| last * i as f64 / count as f64).collect()
}

/// Lattice of the fixed part's density over all that the charges pass.
fn lattice(fixed: &Density, samples: &[Sample], way: &Way<'_>) -> Option<(EnergyRecord, Vec<[i8; 2]>)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for travel in travels(way) {
        let pose = (way.pose)(travel);
        for (at, _) in samples {
            let place = pose.transform_point3(*at);
            (low, high) = (low.min(place), high.max(place));
        }
    }
    let [least, most] = fixed.extent();
    let reach = ASIDE_MM + MARGIN_MM;
    // No farther from the fixed part than its density is of use.
    let low = (low - ASIDE_MM).max(least - BEYOND_MM - reach);
    let high = (high + ASIDE_MM).min(most + BEYOND_MM + reach);
    let extent = high - low;
    if !extent.cmpgt(DVec3::ZERO).all() {
        return None;
    }
    let counts = |step: f64| (extent / step).ceil().to_array().map(|n| n as usize + 1);
    let mut step = (extent.element_product() / NODES as f64).cbrt();
    while counts(step).into_iter().product::<usize>() > NODES {
        step *= 1.005;
    }
    let size = counts(step);
    let [width, height, depth] = size;
    let values: Vec<Complex<f64>> = (0..width * height * depth)
        .into_par_iter()
        .map(|i| {
            let node = [i % width, i / width % height, i / width / height];
            // It falls to zero over the outermost two steps, so that the energy does not jump where a charge leaves the lattice.
            let inside = [0, 1, 2].map(|axis| node[axis].min(size[axis] - 1 - node[axis]));
            let share = 0.5 * inside.into_iter().min().unwrap_or(0) as f64;
            let share = share.min(1.0) * share.min(1.0) * (3.0 - 2.0 * share.min(1.0));
            if share == 0.0 {
                return Complex::ZERO;
            }
            let place = low + step * DVec3::from_array(node.map(|n| n as f64));
            fixed.without_planes(place) * share
        })
        .collect();
    let most = values
        .iter()
        .map(|v| v.re.abs().max(v.im.abs()))
        .fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let unit = |v: f64| (127.0 * v / most).round() as i8;
    let nodes = values.iter().map(|v| [unit(v.re), unit(v.im)]).collect();
    let [inward, outward] = [0.0, way.length_mm].map(|travel| (way.pose)(travel).translation);
    let record = EnergyRecord {
        origin: (low * M_PER_MM).as_vec3().to_array(),
        step: (step * M_PER_MM) as f32,
        size: size.map(|n| n as u16),
        way: (outward - inward)
            .try_normalize()
            .unwrap_or(DVec3::Z)
            .as_vec3()
            .to_array(),
        // Until it is known.
        largest_force: 1.0,
        ..EnergyRecord::default()
    };
    Some((record, nodes))
}

/// Numbers from −1 to 1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// A pose moved by `by` and turned by the rotation vector `turn` about `about`.
fn moved(pose: &DAffine3, by: DVec3, turn: DVec3, about: DVec3) -> DAffine3 {
    DAffine3::from_translation(about + by)
        * DAffine3::from_quat(DQuat::from_scaled_axis(turn))
        * DAffine3::from_translation(-about)
        * *pose
}

/// Terms of an energy of unit charges at a pose: energy and its six derivatives, for the real and the imaginary part of each charge.
fn terms(energy: &Energy<'_>, samples: &[Sample], pose: &DAffine3, about: DVec3) -> Vec<[f64; 7]> {
    let of = |at: DVec3, charge: [f32; 2]| {
        look(energy, pose, at, charge).map_or([0.0; 7], |(place, value, slope)| {
            let turn = (place - about).cross(slope);
            [value, slope.x, slope.y, slope.z, turn.x, turn.y, turn.z].map(|v| -v)
        })
    };
    let parts = [[1.0, 0.0], [0.0, 1.0]];
    (samples.iter())
        .flat_map(|(at, _)| parts.map(|charge| of(*at, charge)))
        .collect()
}

/// Fits the charges.
fn fit(baked: &mut BakedEnergy, samples: &[Sample], way: &Way<'_>) -> Option<()> {
    let energy = Energy::new(&baked.record, &[], &baked.nodes)?;
    let across_of = |way: DVec3| {
        let u = way.any_orthonormal_vector();
        [u, way.cross(u)]
    };
    let across = across_of(DVec3::from_array(baked.record.way.map(f64::from)));
    let rows: Vec<(Vec<f64>, f64)> = (travels(way).into_par_iter().enumerate())
        .flat_map_iter(|(number, travel)| {
            let pose = (way.pose)(travel);
            let on_way = terms(&energy, samples, &pose, DVec3::ZERO);
            // Where the energy acts, and how large it is about there.
            let weights = || {
                (samples.iter().zip(on_way.chunks_exact(2))).map(|((at, q), t)| {
                    let weight = q.norm() * t[0][0].hypot(t[1][0]);
                    (pose.transform_point3(*at), weight)
                })
            };
            let total: f64 = weights().map(|(_, w)| w).sum();
            let middle = weights().map(|(p, w)| p * w).sum::<DVec3>() / total.max(f64::MIN_POSITIVE);
            let spread = weights()
                .map(|(p, w)| p.distance_squared(middle) * w)
                .sum::<f64>();
            let length = (spread / total.max(f64::MIN_POSITIVE)).sqrt().max(WIDTH_MM);
            let height = ((way.length_mm + BEYOND_MM - travel) / (way.length_mm + BEYOND_MM)).max(0.0);
            let about_middle = terms(&energy, samples, &pose, middle);
            let mut rows = Vec::new();
            let column = |of: &dyn Fn(&[f64; 7]) -> f64| about_middle.iter().map(of).collect::<Vec<f64>>();
            for axis in across {
                let gradient = column(&|t| WIDTH_MM * axis.dot(DVec3::new(t[1], t[2], t[3])));
                rows.push((gradient, 0.0, ACROSS_WEIGHT));
            }
            for k in 4..7 {
                rows.push((column(&|t| WIDTH_MM / length * t[k]), 0.0, TURNED_WEIGHT));
            }
            rows.push((column(&|t| t[0]), -height, ON_WAY_WEIGHT));
            let mut numbers = Numbers(number as u64);
            for i in 0..BESIDE {
                let share = 0.05f64.powf(i as f64 / BESIDE as f64);
                let by = (across[0] * numbers.next() + across[1] * numbers.next()) * (ASIDE_MM * share);
                let turn = numbers.vector() * (TURNED_MM / length * share);
                let beside = terms(&energy, samples, &moved(&pose, by, turn, middle), DVec3::ZERO);
                let off = (by.length_squared() + (turn * length).length_squared()) / (WIDTH_MM * WIDTH_MM);
                let row = beside.iter().map(|t| t[0]).collect();
                rows.push((row, -height / (1.0 + off).sqrt(), BESIDE_WEIGHT));
            }
            (rows.into_iter()).map(|(row, value, weight): (Vec<f64>, f64, f64)| {
                (
                    row.into_iter().map(|v| weight * v).collect::<Vec<f64>>(),
                    weight * value,
                )
            })
        })
        .collect();
    let matrix = DMatrix::from_fn(rows.len(), 2 * samples.len(), |i, j| rows[i].0[j]);
    let wanted = DVector::from_fn(rows.len(), |i, _| rows[i].1);
    let mut normal = matrix.tr_mul(&matrix);
    let ridge = RIDGE * normal.trace() / normal.nrows() as f64;
    for i in 0..normal.nrows() {
        normal[(i, i)] += ridge;
    }
    let fitted = normal.cholesky()?.solve(&matrix.tr_mul(&wanted));
    let left = &wanted - &matrix * &fitted;
    // Six rows on the way come first at each place.
    let beside: Vec<f64> = (0..rows.len())
        .filter(|i| i % (BESIDE + 6) >= 6)
        .map(|i| left[i] / BESIDE_WEIGHT)
        .collect();
    baked.deviation = (beside.iter().map(|v| v * v).sum::<f64>() / beside.len() as f64).sqrt();
    baked.charges = (samples.iter().zip(fitted.as_slice().chunks_exact(2)))
        .map(|((at, _), q)| ChargeRecord {
            at: (*at * M_PER_MM).as_vec3().to_array(),
            charge: [q[0] as f32, q[1] as f32],
        })
        .collect();
    // The depth at the fit is 1 to the last digit.
    let depth = -baked.at(&(way.pose)(0.0), DVec3::ZERO).energy;
    if depth <= 0.0 {
        return None;
    }
    for charge in &mut baked.charges {
        charge.charge = charge.charge.map(|q| (f64::from(q) / depth) as f32);
    }
    Some(())
}

/// States the largest force, and the stiffness that majorises the energy at each depth: measured from one pose to another one.
fn majorise(baked: &mut BakedEnergy, way: &Way<'_>, center_of_mass: DVec3) {
    let axis = DVec3::from_array(baked.record.way.map(f64::from));
    let last = (ENERGY_DEPTHS - 1) as f64;
    let travels = travels(way);
    let this = &*baked;
    /// Energy at a pose, its largest force, and the excess over the linear model for each family of displacements.
    struct Seen {
        depth: f64,
        force: f64,
        excess: [(DVec3, DVec3, f64); 4],
    }
    let seen: Vec<Seen> = (0..STIFFNESS_POSES)
        .into_par_iter()
        .map(|i| {
            let mut numbers = Numbers(0x5eed_0000 + i as u64);
            let pose = (way.pose)(travels[i % travels.len()]);
            let share = 0.5 + 0.5 * numbers.next();
            let middle = pose.transform_point3(center_of_mass);
            let pose = moved(
                &pose,
                numbers.vector() * (ASIDE_MM * share),
                numbers.vector() * (0.15 * share),
                middle,
            );
            let about = pose.transform_point3(center_of_mass);
            let here = this.at(&pose, about);
            let excess = [0, 1, 2, 3].map(|family| {
                let size = 0.55 + 0.45 * numbers.next();
                let by = numbers.vector().normalize_or_zero() * (STIFFNESS_MM * size);
                let turn = numbers.vector().normalize_or_zero() * (STIFFNESS_RAD * size);
                let (by, turn) = match family {
                    0 => (by - axis * axis.dot(by), DVec3::ZERO),
                    1 => (axis * axis.dot(by), DVec3::ZERO),
                    2 => (DVec3::ZERO, turn),
                    _ => (by, turn),
                };
                let there = this.at(&moved(&pose, by, turn, about), about).energy;
                let linear = here.slope.dot(by) + here.turn.dot(turn);
                (by, turn, 2.0 * (there - here.energy - linear - STIFFNESS_SLACK))
            });
            Seen {
                depth: (-here.energy).clamp(0.0, 1.0) * last,
                force: here.slope.length(),
                excess,
            }
        })
        .collect();
    let mut tables = [[0.0f64; ENERGY_DEPTHS]; 3];
    let around = |depth: f64| [depth.floor() as usize, depth.ceil() as usize];
    for seen in &seen {
        for (family, table) in tables.iter_mut().enumerate() {
            let (by, turn, excess) = seen.excess[family];
            let squared = by.length_squared() + turn.length_squared();
            for entry in around(seen.depth) {
                table[entry] = table[entry].max(excess / squared.max(f64::MIN_POSITIVE));
            }
        }
    }
    // Displacements of both kinds at once need more where translation and rotation are coupled.
    let mut factors = [1.0f64; ENERGY_DEPTHS];
    for seen in &seen {
        let (by, turn, excess) = seen.excess[3];
        let along = axis.dot(by);
        let [below, above] = around(seen.depth);
        let share = seen.depth - below as f64;
        let at = |table: &[f64; ENERGY_DEPTHS]| table[below] + share * (table[above] - table[below]);
        let squared = at(&tables[0]) * (by.length_squared() - along * along)
            + at(&tables[1]) * along * along
            + at(&tables[2]) * turn.length_squared();
        for entry in [below, above] {
            factors[entry] = factors[entry]
                .max(excess / squared.max(f64::MIN_POSITIVE))
                .min(3.0);
        }
    }
    let per_mm2 = 1.0 / (M_PER_MM * M_PER_MM);
    let table = |which: usize, unit: f64| {
        core::array::from_fn(|i| (tables[which][i].max(0.0) * factors[i] * unit) as f32)
    };
    let record = &mut baked.record;
    record.across = table(0, per_mm2);
    record.along = table(1, per_mm2);
    record.turning = table(2, 1.0);
    let force = seen.iter().map(|seen| seen.force).fold(0.0, f64::max);
    record.largest_force = (force / M_PER_MM).max(1.0) as f32;
}
