//! Energy of a pair of parts as a board takes it: a few hundred charges of the moving part in a coarse lattice of the fixed one's density.
//!
//! Three things differ from [`crate::Pair`], because the published form does not guide where it is needed ([`crate`]):
//!
//! * **Without planes.** The density beside a plane, which does not fade with the distance, is subtracted on either side: flat faces no longer draw each other.
//! * **Strongest places.** Of the places in and around the moving part those with the largest density are kept, near the faces that mate.
//! * **Fitted charges.** The energy is linear in the charges at these places. Instead of the densities there, they are those of least size (ridge regression)
//!   with which displacements to either side of the way cost the same, the energy falls evenly from zero, where the way begins in the open, to its depth at the
//!   fit, and beside the way rises as 1 − 1/√(1 + (d/r)² + (φ·L/r)²), L the extent of where it acts. The way comes from exact surfaces: they place the
//!   minimum, the density gives the functions of which the well is made. Densities as charges, as published, contribute nothing to such a well: what they
//!   are scaled by in the best fit is zero for most pairs.
//!
//! Besides, the baker samples by how much the energy at a displaced pose exceeds its linear model, and states a stiffness that majorises it, for each depth: what
//! the board's implicit step needs.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_protocol::image::{ChargeRecord, Energy, EnergyRecord};
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use crate::density::Density;

/// Charges of an energy, and nodes of its lattice at most: together 31.9 KiB.
const CHARGES: usize = 384;
const NODES: usize = 12_400;
/// Places at which the moving part's density is looked at for its charges, about: several sets, of which one is kept.
const PLACES: [f64; 2] = [6000.0, 4000.0];
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
pub(crate) const ASIDE_MM: f64 = 5.0;
const TURNED_MM: f64 = 3.0;
/// Share of spin about the way in it: of round parts it changes nothing.
const SPIN_SHARE: f64 = 0.3;
/// Poses beside the way at each of its places, and the steps from one place to the next, mm.
const BESIDE: usize = 40;
const PLACE_STEP_MM: f64 = 0.53;
/// Displacements along each axis at which the energy is fitted most closely, over r; in rotation over r/L.
const CLOSE: [f64; 2] = [0.25, 0.6];
/// Weights of the fit: that close displacements to either side cost the same, across the way, in tilt and in spin
/// about the way; what they cost, over that; the energy on the way
/// and farther beside it; and the size of the charges, over the mean of all weights.
const ACROSS_WEIGHT: f64 = 20.0;
const TURNED_WEIGHT: f64 = 40.0;
const SPUN_WEIGHT: f64 = 10.0;
const RISE_SHARE: f64 = 0.3;
const ON_WAY_WEIGHT: f64 = 1.0;
const BESIDE_WEIGHT: f64 = 0.2;
const RIDGE: f64 = 1e-3;
/// Rounds of the fit, places of the way at which each looks for the least energy, the distance from the way that is let be, mm, and the weight of a pose found.
const ROUNDS: usize = 6;
const OFF_PLACES: usize = 40;
const NEAR_MM: f64 = 0.05;
const ROUND_WEIGHT: f64 = 60.0;
/// Arm at which tilts count as displacements, mm, and the first step of the search for a minimum, mm.
const TILT_ARM_MM: f64 = 10.0;
const SEARCH_MM: f64 = 0.5;
/// Lengths in the image are in metres.
pub(crate) const M_PER_MM: f64 = 1e-3;

/// The motion by which the moving part reaches its fit, relative to the fixed part.
pub struct Way<'a> {
    /// Its length from the fit to the open, mm.
    pub length_mm: f64,
    /// Corners of the box, moving part's frame, about which it has charges, mm: that of its mating faces.
    pub mating: [DVec3; 2],
    /// Pose of the moving part in the fixed one's frame (mm) at a travel from the fit, mm; defined beyond the length, too.
    pub pose: &'a (dyn Fn(f64) -> DAffine3 + Sync),
}

impl Way<'_> {
    /// Travel from the fit to where the fit of the charges ends, mm.
    fn fitted_mm(&self) -> f64 {
        self.length_mm + FITTED_BEYOND_MM
    }

    /// Depth of the wanted energy at a travel from the fit: 1 there, 0 from [`BEYOND_MM`] beyond the way's begin on.
    fn height(&self, travel_mm: f64) -> f64 {
        let whole = self.length_mm + BEYOND_MM;
        ((whole - travel_mm) / whole).max(0.0)
    }
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
    /// Middle of the charges, moving part's frame, mm.
    pub fn middle(&self) -> DVec3 {
        let places = self
            .charges
            .iter()
            .map(|charge| DVec3::from_array(charge.at.map(f64::from)));
        places.sum::<DVec3>() / (M_PER_MM * self.charges.len().max(1) as f64)
    }

    /// Distance across the way (mm) and tilt (rad) of the least energy near a pose, which stays where it is along the way and in spin about it; by steps along the
    /// coordinates, from half a millimetre down to a micrometre.
    pub fn minimum(&self, pose: &DAffine3) -> (f64, f64) {
        let at = self.lowest(pose, 4);
        (at[0].hypot(at[1]), at[2].hypot(at[3]) / TILT_ARM_MM)
    }

    /// Displacement from a pose to the least energy near it: across the way, and in tilt times [`TILT_ARM_MM`]; of the first `free` of these coordinates.
    fn lowest(&self, pose: &DAffine3, free: usize) -> [f64; 4] {
        let (mut at, mut step) = ([0.0; 4], SEARCH_MM);
        let of = |x: &[f64; 4]| self.at(&self.beside(pose, x), DVec3::ZERO).energy;
        let mut value = of(&at);
        while step > 1e-3 {
            let before = value;
            for k in 0..free {
                for sign in [step, -step] {
                    let mut next = at;
                    next[k] += sign;
                    let there = of(&next);
                    if there < value {
                        (at, value) = (next, there);
                    }
                }
            }
            if value == before {
                step *= 0.5;
            }
        }
        at
    }

    /// A pose displaced as [`Self::lowest`] states it.
    fn beside(&self, pose: &DAffine3, x: &[f64; 4]) -> DAffine3 {
        let (u, v) = DVec3::from_array(self.record.way.map(f64::from)).any_orthonormal_pair();
        let turn = (u * x[2] + v * x[3]) / TILT_ARM_MM;
        moved(
            pose,
            u * x[0] + v * x[1],
            turn,
            pose.transform_point3(self.middle()),
        )
    }

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

/// The energy of a moving part in a fixed one's density along a way, without its stiffness; see [`crate::bake()`].
pub(crate) fn best(moving: &Density, fixed: &Density, way: &Way<'_>) -> Option<BakedEnergy> {
    let zone = zone(moving, way.mating);
    let (record, nodes) = lattice(fixed, zone, way)?;
    let of = |places: f64| {
        let samples = strongest(moving, zone, places);
        let baked = BakedEnergy {
            record,
            charges: Vec::new(),
            nodes: nodes.clone(),
            deviation: 0.0,
        };
        fit(&baked, &samples, way)
    };
    let all = PLACES.into_iter().filter_map(of);
    all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, best)| best)
}

/// A place of the way and the displacement from there to the least energy near it.
type Off = (f64, [f64; 4]);

/// Where the least energy is off the way: over places on it, with tilts free and without.
fn off_way(baked: &BakedEnergy, way: &Way<'_>) -> Vec<Off> {
    let last = way.fitted_mm();
    (0..2 * OFF_PLACES)
        .into_par_iter()
        .map(|i| {
            let travel = last * (i / 2) as f64 / OFF_PLACES as f64;
            (travel, baked.lowest(&(way.pose)(travel), 2 + 2 * (i % 2)))
        })
        .collect()
}

/// Length of such a displacement, mm.
fn distance(x: &[f64; 4]) -> f64 {
    x[0].hypot(x[1]).max(x[2].hypot(x[3]))
}

/// A place of the moving part and its density there, less that beside a plane.
type Sample = (DVec3, Complex<f64>);

/// Corners of the box in which the moving part has charges, its frame, mm.
fn zone(moving: &Density, [low, high]: [DVec3; 2]) -> [DVec3; 2] {
    let [least, most] = moving.extent();
    [
        (low - ABOUT_MM).max(least - MARGIN_MM),
        (high + ABOUT_MM).min(most + MARGIN_MM),
    ]
}

fn strongest(moving: &Density, [low, high]: [DVec3; 2], places: f64) -> Vec<Sample> {
    let (middle, half) = (low.midpoint(high), 0.5 * (high - low));
    let step = ((high - low).element_product() / places).cbrt();
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
pub(crate) fn travels(way: &Way<'_>) -> Vec<f64> {
    let last = way.fitted_mm();
    let count = (last / PLACE_STEP_MM).ceil().clamp(20.0, 120.0) as usize;
    (0..=count).map(|i| last * i as f64 / count as f64).collect()
}

/// Lattice of the fixed part's density over all that the zone of the charges passes.
fn lattice(fixed: &Density, zone: [DVec3; 2], way: &Way<'_>) -> Option<(EnergyRecord, Vec<[i8; 2]>)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for travel in travels(way) {
        let pose = (way.pose)(travel);
        for corner in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| zone[corner >> axis & 1][axis]);
            let place = pose.transform_point3(DVec3::new(x, y, z));
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
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// A pose moved by `by` and turned by the rotation vector `turn` (rad) about `about`; lengths in the poses' unit.
pub fn moved(pose: &DAffine3, by: DVec3, turn: DVec3, about: DVec3) -> DAffine3 {
    DAffine3::from_translation(about + by)
        * DAffine3::from_quat(DQuat::from_scaled_axis(turn))
        * DAffine3::from_translation(-about)
        * *pose
}

/// Energy of unit charges at a pose, for the real and the imaginary part of each.
fn terms(energy: &Energy<'_>, samples: &[Sample], pose: &DAffine3) -> Vec<f64> {
    let of = |at: DVec3, charge: [f32; 2]| look(energy, pose, at, charge).map_or(0.0, |(_, value, _)| -value);
    (samples.iter())
        .flat_map(|(at, _)| [[1.0, 0.0], [0.0, 1.0]].map(|charge| of(*at, charge)))
        .collect()
}

/// A wanted energy, linear in the charges: coefficients of their real and imaginary parts, its value, and the weight of both.
struct Row {
    terms: Vec<f64>,
    value: f64,
    weight: f64,
}

/// Rows of one place of the way: [`ON_WAY_ROWS`] close to the way, then [`BESIDE`] beside it.
const ON_WAY_ROWS: usize = 1 + 5 * 2 * CLOSE.len();

/// 1 − 1/√(1 + x²): the rise beside the way at x times r.
fn rise(x: f64) -> f64 {
    1.0 - 1.0 / (1.0 + x * x).sqrt()
}

fn rows(energy: &Energy<'_>, samples: &[Sample], way: &Way<'_>, number: usize, travel: f64) -> Vec<Row> {
    let axis = DVec3::from_array(energy.record.way.map(f64::from));
    let (u, v) = axis.any_orthonormal_pair();
    let pose = (way.pose)(travel);
    let on_way = terms(energy, samples, &pose);
    let (middle, length) = extent(samples, &on_way, &pose);
    let height = way.height(travel);
    let off = |by: DVec3, turn: DVec3| terms(energy, samples, &moved(&pose, by, turn, middle));
    let mut rows = Vec::with_capacity(ON_WAY_ROWS + BESIDE);
    let mut push = |terms: Vec<f64>, value: f64, weight: f64| {
        rows.push(Row {
            terms: terms.into_iter().map(|term| weight * term).collect(),
            value: weight * value,
            weight,
        });
    };
    push(on_way.clone(), -height, ON_WAY_WEIGHT);
    let shifts = [u, v].map(|axis| (axis, DVec3::ZERO, ACROSS_WEIGHT));
    let turns = [(u, TURNED_WEIGHT), (v, TURNED_WEIGHT), (axis, SPUN_WEIGHT)]
        .map(|(axis, weight)| (DVec3::ZERO, axis / length, weight));
    for (by, turn, weight) in shifts.into_iter().chain(turns) {
        for share in CLOSE {
            let d = share * WIDTH_MM;
            let [ahead, back] = [d, -d].map(|d| off(by * d, turn * d));
            let pairs = || ahead.iter().zip(&back);
            push(
                pairs().map(|(a, b)| (a - b) / (2.0 * share)).collect(),
                0.0,
                weight,
            );
            let risen = pairs().zip(&on_way).map(|((a, b), on)| 0.5 * (a + b) - on);
            push(risen.collect(), height * rise(share), weight * RISE_SHARE);
        }
    }
    let mut numbers = Numbers(number as u64);
    for i in 0..BESIDE {
        let share = 0.05f64.powf(i as f64 / BESIDE as f64);
        let by = (u * numbers.next() + v * numbers.next()) * (ASIDE_MM * share);
        let turn = u * numbers.next() + v * numbers.next() + axis * (SPIN_SHARE * numbers.next());
        let turn = turn * (TURNED_MM / length * share);
        let far = by.length().hypot((turn * length).length()) / WIDTH_MM;
        push(off(by, turn), height * (rise(far) - 1.0), BESIDE_WEIGHT);
    }
    rows
}

/// Middle of where the energy acts at a pose, fixed part's frame, and L, its root mean square distance from there, mm.
fn extent(samples: &[Sample], on_way: &[f64], pose: &DAffine3) -> (DVec3, f64) {
    let weights = || {
        (samples.iter().zip(on_way.chunks_exact(2)))
            .map(|((at, q), terms)| (pose.transform_point3(*at), q.norm() * terms[0].hypot(terms[1])))
    };
    let total = weights().map(|(_, w)| w).sum::<f64>().max(f64::MIN_POSITIVE);
    let middle = weights().map(|(p, w)| p * w).sum::<DVec3>() / total;
    let squared = weights()
        .map(|(p, w)| p.distance_squared(middle) * w)
        .sum::<f64>()
        / total;
    (middle, squared.sqrt().max(WIDTH_MM))
}

/// Fits the charges, again and again with the poses in which the least energy was found off the way; returns the best energy and how far it is off, mm. `None`
/// where no charges have a well at the fit.
fn fit(baked: &BakedEnergy, samples: &[Sample], way: &Way<'_>) -> Option<(f64, BakedEnergy)> {
    let energy = Energy::new(&baked.record, &[], &baked.nodes)?;
    let count = 2 * samples.len();
    let rows: Vec<Row> = (travels(way).into_par_iter().enumerate())
        .flat_map_iter(|(number, travel)| rows(&energy, samples, way, number, travel))
        .collect();
    let matrix = DMatrix::from_fn(rows.len(), count, |i, j| rows[i].terms[j]);
    let wanted = DVector::from_fn(rows.len(), |i, _| rows[i].value);
    let (mut normal, mut right) = (matrix.tr_mul(&matrix), matrix.tr_mul(&wanted));
    let ridge = RIDGE * normal.trace() / count as f64;
    for i in 0..count {
        normal[(i, i)] += ridge;
    }
    let mut best: Option<(f64, BakedEnergy)> = None;
    for _ in 0..ROUNDS {
        let fitted = normal.clone().cholesky()?.solve(&right);
        let left = &wanted - &matrix * &fitted;
        let beside = (rows.iter().zip(left.iter()).enumerate())
            .filter(|(i, _)| i % (ON_WAY_ROWS + BESIDE) >= ON_WAY_ROWS)
            .map(|(_, (row, left))| (left / row.weight).powi(2));
        let count = beside.clone().count() as f64;
        let Some(now) = with_charges(
            baked,
            samples,
            fitted.as_slice(),
            way,
            (beside.sum::<f64>() / count).sqrt(),
        ) else {
            break;
        };
        let off = off_way(&now, way);
        let worst = off.iter().map(|(_, x)| distance(x)).fold(0.0, f64::max);
        for (travel, x) in off.iter().filter(|(_, x)| distance(x) > NEAR_MM) {
            let pose = (way.pose)(*travel);
            let [on, beside] = [pose, now.beside(&pose, x)].map(|pose| terms(&energy, samples, &pose));
            let row = DVector::from_iterator(
                on.len(),
                beside.iter().zip(&on).map(|(b, a)| ROUND_WEIGHT * (b - a)),
            );
            let height = way.height(*travel);
            let value = ROUND_WEIGHT * height * rise(distance(x) / WIDTH_MM);
            normal.ger(1.0, &row, &row, 1.0);
            right.axpy(value, &row, 1.0);
        }
        if best.as_ref().is_none_or(|(least, _)| worst < *least) {
            best = Some((worst, now));
        }
    }
    best
}

/// The energy with these charges, scaled so that its depth at the fit is 1; `None` where it has no well there.
fn with_charges(
    baked: &BakedEnergy,
    samples: &[Sample],
    fitted: &[f64],
    way: &Way<'_>,
    deviation: f64,
) -> Option<BakedEnergy> {
    let mut baked = BakedEnergy {
        deviation,
        charges: (samples.iter().zip(fitted.chunks_exact(2)))
            .map(|((at, _), q)| ChargeRecord {
                at: (*at * M_PER_MM).as_vec3().to_array(),
                charge: [q[0] as f32, q[1] as f32],
            })
            .collect(),
        ..baked.clone()
    };
    let depth = -baked.at(&(way.pose)(0.0), DVec3::ZERO).energy;
    if depth <= 0.0 {
        return None;
    }
    for charge in &mut baked.charges {
        charge.charge = charge.charge.map(|q| (f64::from(q) / depth) as f32);
    }
    Some(baked)
}
