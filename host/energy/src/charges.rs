//! Charges with which an energy has its well along a way: a least squares problem, solved again with the places at which the energy did not rise as it has to.

use glam::{DAffine3, DVec3};
use mortise_protocol::image::ChargeRecord;
use nalgebra::Complex;
use rayon::prelude::*;

use crate::baked::{ASIDE_MM, BakedEnergy, M_PER_MM, Numbers, WIDTH_MM, Way, rise, travels};
use crate::faults::{ENOUGH_MM, faults};
use crate::lattice::Lattice;
use crate::normal::Normal;
use crate::pose::moved;

/// A place of the moving part and its density there, less that beside a plane.
pub(crate) type Sample = (DVec3, Complex<f64>);

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
/// Rounds of the fit at most, and so many good ones in turn end it: each looks at other places of the way.
const ROUNDS: usize = 60;
const GOOD_ROUNDS: u32 = 3;
/// Golden section: shifts of the places that no round repeats.
const PHASE: f64 = 0.618_034;

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

fn rows(lattice: &Lattice, samples: &[Sample], way: &Way<'_>, number: usize, travel: f64) -> Vec<Row> {
    let axis = way.outward;
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

/// Fits the charges, again and again with the faults of the energy before; returns the best energy and how far its minima are off the way, mm. `None` where no
/// charges have a well at the fit.
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
    let mut good = 0;
    for round in 0..ROUNDS {
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
        let faults = faults(&lattice, &now, way, (PHASE * round as f64).fract());
        let worst = faults.iter().map(|fault| fault.off_mm).fold(0.0, f64::max);
        let found: Vec<(Vec<f64>, f64)> = (faults.par_iter())
            .map(|fault| {
                let [from, to] = [&fault.from, &fault.to].map(|pose| terms(&lattice, samples, pose));
                let rise = to.iter().zip(&from).map(|(to, from)| fault.weight * (to - from));
                (rise.collect(), fault.weight * fault.rise)
            })
            .collect();
        normal.add(found.iter().map(|(terms, value)| (&terms[..], *value)));
        let is_good = worst < ENOUGH_MM;
        // Of good ones the last, which was fitted at the most places.
        if is_good || best.as_ref().is_none_or(|(least, _)| worst <= *least) {
            best = Some((worst, now));
        }
        good = if is_good { good + 1 } else { 0 };
        if good == GOOD_ROUNDS {
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
