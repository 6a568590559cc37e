//! Charges with which an energy has its well along a way: a least squares problem, solved again with the poses in which the energy was lower than on the way.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use mortise_protocol::image::ChargeRecord;
use nalgebra::Complex;
use rayon::prelude::*;

use crate::baked::{ASIDE_MM, BakedEnergy, M_PER_MM, Numbers, Way, travels};
use crate::lattice::Lattice;
use crate::minimum::{Displacement, Start};
use crate::normal::Normal;
use crate::pose::moved;

/// A place of the moving part and its density there, less that beside a plane.
pub(crate) type Sample = (DVec3, Complex<f64>);

/// r: displacement across the way at which the energy has risen by 0.3 of its depth there, mm.
const WIDTH_MM: f64 = 1.5;
/// Largest rotation beside the way for which the energy is fitted, as a displacement at the distance L, mm.
const TURNED_MM: f64 = 3.0;
/// Share of spin about the way in it: of round parts it changes nothing.
const SPIN_SHARE: f64 = 0.3;
/// Poses beside the way at each of its places.
const BESIDE: usize = 40;
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
/// Rounds of the fit at most, places of the way at which each looks for the least energy, and the weight of a pose found.
const ROUNDS: usize = 24;
const OFF_PLACES: usize = 80;
const ROUND_WEIGHT: f64 = 160.0;
/// Distances from the way, mm: how finely the least energy is looked for, what is let be, what is good enough for the whole fit, and where else it is looked for
/// across the way, in so many directions.
const FINE_MM: f64 = 5e-3;
const NEAR_MM: f64 = 0.05;
pub(crate) const ENOUGH_MM: f64 = 0.1;
const FAR_MM: [f64; 4] = [1.0, 2.0, 3.0, 4.2];
const FAR_DIRECTIONS: usize = 8;
/// Steps back along the way, mm, and how many.
const BACK_MM: f64 = 0.25;
const BACK_PLACES: usize = 12;

/// Density of the fixed part at the places of charges at a pose, for the real and the imaginary part of each: the energy of unit charges.
fn terms(lattice: &Lattice, samples: &[Sample], pose: &DAffine3) -> Vec<f64> {
    (samples.iter())
        .flat_map(|(at, _)| {
            let [re, im] = lattice.at(pose.transform_point3(*at)).map(f64::from);
            // Re(ρ·q), with the energy's sign.
            [-re, im]
        })
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

fn rows(lattice: &Lattice, samples: &[Sample], way: &Way<'_>, number: usize, travel: f64) -> Vec<Row> {
    let axis = way.outward();
    let (u, v) = axis.any_orthonormal_pair();
    let pose = (way.pose)(travel);
    let on_way = terms(lattice, samples, &pose);
    let (middle, length) = extent(samples, &on_way, &pose);
    let height = way.height(travel);
    let off = |by: DVec3, turn: DVec3| terms(lattice, samples, &moved(&pose, by, turn, middle));
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

/// Fits the charges, again and again with the poses in which an energy was found that is lower than on the way; returns the best energy and how far its
/// minima are off the way, mm. `None` where no charges have a well at the fit.
pub(crate) fn fit(baked: &BakedEnergy, samples: &[Sample], way: &Way<'_>) -> Option<(f64, BakedEnergy)> {
    let lattice = Lattice::new(&baked.record, &baked.nodes);
    let count = 2 * samples.len();
    let rows: Vec<Row> = (travels(way).into_par_iter().enumerate())
        .flat_map_iter(|(number, travel)| rows(&lattice, samples, way, number, travel))
        .collect();
    let mut normal = Normal::new(count);
    normal.add(rows.iter().map(|row| (&row.terms[..], row.value)));
    normal.add_ridge(RIDGE * normal.trace() / count as f64);
    let mut best: Option<(f64, BakedEnergy)> = None;
    for _ in 0..ROUNDS {
        let fitted = normal.solve()?;
        let Some(now) = with_charges(
            baked,
            samples,
            fitted.as_slice(),
            way,
            deviation(&rows, fitted.as_slice()),
        ) else {
            break;
        };
        let off = off_way(&lattice, &now, way);
        let worst = off.iter().map(|off| off.distance).fold(0.0, f64::max);
        let found: Vec<(Vec<f64>, f64)> = (off.par_iter().filter(|off| off.distance > NEAR_MM))
            .map(|off| {
                let [on, beside] = [&off.on, &off.beside].map(|pose| terms(&lattice, samples, pose));
                let row = beside.iter().zip(&on).map(|(b, a)| ROUND_WEIGHT * (b - a));
                (row.collect(), ROUND_WEIGHT * off.wanted)
            })
            .collect();
        normal.add(found.iter().map(|(terms, value)| (&terms[..], *value)));
        if best.as_ref().is_none_or(|(least, _)| worst < *least) {
            best = Some((worst, now));
        }
        if worst < ENOUGH_MM {
            break;
        }
    }
    best
}

/// Root mean square deviation of the fitted energy from the wanted one, beside the way.
fn deviation(rows: &[Row], fitted: &[f64]) -> f64 {
    let beside = (rows.iter().enumerate())
        .filter(|(i, _)| i % (ON_WAY_ROWS + BESIDE) >= ON_WAY_ROWS)
        .map(|(_, row)| {
            let found: f64 = row
                .terms
                .iter()
                .zip(fitted)
                .map(|(term, charge)| term * charge)
                .sum();
            ((row.value - found) / row.weight).powi(2)
        });
    let count = beside.clone().count() as f64;
    (beside.sum::<f64>() / count).sqrt()
}

/// A pose with less energy than one on the way.
struct Off {
    on: DAffine3,
    beside: DAffine3,
    /// From one to the other, mm.
    distance: f64,
    /// How much more energy than on the way is wanted there.
    wanted: f64,
}

/// Where the energy is least about places of the way: near it with tilts free and without, the lowest of some places farther across, and of some back towards
/// the open.
fn off_way(lattice: &Lattice, baked: &BakedEnergy, way: &Way<'_>) -> Vec<Off> {
    let charges = baked.charges.iter().map(|charge| {
        let at = DVec3::from_array(charge.at.map(f64::from)) / M_PER_MM;
        (at, charge.charge)
    });
    let charges: Vec<(DVec3, [f32; 2])> = charges.collect();
    let energy = |pose: &DAffine3| -> f64 {
        let of = |(at, [q, p]): &(DVec3, [f32; 2])| {
            let [re, im] = lattice.at(pose.transform_point3(*at));
            f64::from(p * im - q * re)
        };
        charges.iter().map(of).sum()
    };
    let (axis, middle, last) = (way.outward(), baked.middle(), way.fitted_mm());
    let far: Vec<Displacement> = (FAR_MM.into_iter())
        .flat_map(|far| (0..FAR_DIRECTIONS).map(move |i| (far, TAU * i as f64 / FAR_DIRECTIONS as f64)))
        .map(|(far, angle)| [far * angle.cos(), far * angle.sin(), 0.0, 0.0])
        .collect();
    (0..4 * OFF_PLACES)
        .into_par_iter()
        .filter_map(|i| {
            let travel = last * (i / 4) as f64 / OFF_PLACES as f64;
            let (on, height) = ((way.pose)(travel), way.height(travel));
            let start = Start::new(on, axis, on.transform_point3(middle));
            let lower = |least: f64| (least < energy(&on)).then_some(());
            let x = match i % 4 {
                0 => start.lowest(energy, 2, FINE_MM),
                1 => start.lowest(energy, 4, FINE_MM),
                2 => {
                    let places = far.iter().map(|x| (energy(&start.displaced(x)), *x));
                    let (least, x) = places.min_by(|a, b| a.0.total_cmp(&b.0))?;
                    lower(least)?;
                    x
                }
                _ => {
                    let places = (1..=BACK_PLACES).map(|k| travel + BACK_MM * k as f64);
                    let (least, back) = (places.map(|back| (energy(&(way.pose)(back)), back)))
                        .min_by(|a, b| a.0.total_cmp(&b.0))?;
                    lower(least)?;
                    return Some(Off {
                        on,
                        beside: (way.pose)(back),
                        distance: back - travel,
                        wanted: height - way.height(back),
                    });
                }
            };
            let distance = x[0].hypot(x[1]).max(x[2].hypot(x[3]));
            Some(Off {
                on,
                beside: start.displaced(&x),
                distance,
                wanted: height * rise(distance / WIDTH_MM),
            })
        })
        .collect()
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
