//! Places at which an energy does not rise as it has to: off the way, back along it, and beside its mouth.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::baked::{BakedEnergy, M_PER_MM, WIDTH_MM, Way, rise};
use crate::lattice::Lattice;
use crate::minimum::Start;

/// Places of the way near which the least energy is looked for, how finely, mm, and the distance from the way that is no fault, mm.
const PLACES: usize = 80;
const FINE_MM: f64 = 1e-3;
const NEAR_MM: f64 = 0.05;
/// Steps back along the way, mm, and the share of the wanted rise that is enough there.
const BACK_MM: f64 = 0.25;
const BACK_SHARE: f64 = 0.5;
/// Where the part comes from: from a little within the mouth to the open, mm beyond the way's begin, at so many places and in so many directions; distances aside,
/// in steps of so many mm; and the share of the wanted rise that is enough there.
const MOUTH_MM: [f64; 2] = [-1.2, 6.0];
const MOUTH_PLACES: usize = 16;
const DIRECTIONS: usize = 16;
const ASIDE_MM: f64 = 0.5;
const ASIDE_STEPS: usize = 9;
const ASIDE_SHARE: f64 = 0.4;
/// How far a fault may move the minimum, mm, in an energy that is good enough.
pub(crate) const ENOUGH_MM: f64 = 0.1;
/// Weights in the fit; near the way it is that over the depth there, down to the least one, so that a shallow minimum is as near as a deep one.
const NEAR_WEIGHT: f64 = 170.0;
const LEAST_HEIGHT: f64 = 0.25;
const BACK_WEIGHT: f64 = 120.0;
const ASIDE_WEIGHT: f64 = 100.0;

/// Two poses, from the first of which the energy does not rise to the second as it has to.
pub(crate) struct Fault {
    pub(crate) from: DAffine3,
    pub(crate) to: DAffine3,
    /// The wanted rise.
    pub(crate) rise: f64,
    pub(crate) weight: f64,
    /// How far off the way it moves the minimum, mm; [`ENOUGH_MM`] where the energy rises, but too little.
    pub(crate) off_mm: f64,
}

/// The faults of an energy. `phase`, from 0 to 1, shifts the places of the way within their steps: minima vary from one place to the next.
pub(crate) fn faults(lattice: &Lattice, baked: &BakedEnergy, way: &Way<'_>, phase: f64) -> Vec<Fault> {
    let felt = Felt::new(lattice, baked, way);
    // The fit itself in every round.
    let near = (0..2 * (PLACES + 1)).into_par_iter().flat_map_iter(|i| {
        let place = match i / 2 {
            0 => 0.0,
            n => (n - 1) as f64 + phase,
        };
        felt.near(place, i % 2 == 1)
    });
    let steps = (way.fitted_mm() / BACK_MM).floor() as usize;
    let back = (0..steps).into_par_iter().filter_map(|step| felt.back(step));
    let aside = (0..MOUTH_PLACES * DIRECTIONS)
        .into_par_iter()
        .flat_map_iter(|i| felt.aside(i / DIRECTIONS, i % DIRECTIONS));
    near.chain(back).chain(aside).collect()
}

/// An energy as the moving part feels it.
struct Felt<'a> {
    lattice: &'a Lattice,
    charges: Vec<(DVec3, [f32; 2])>,
    way: &'a Way<'a>,
    /// Middle of the charges, moving part's frame, mm.
    middle: DVec3,
}

impl<'a> Felt<'a> {
    fn new(lattice: &'a Lattice, baked: &BakedEnergy, way: &'a Way<'a>) -> Self {
        let charges = baked.charges.iter().map(|charge| {
            let at = DVec3::from_array(charge.at.map(f64::from)) / M_PER_MM;
            (at, charge.charge)
        });
        Self {
            lattice,
            charges: charges.collect(),
            way,
            middle: baked.middle(),
        }
    }

    fn energy(&self, pose: &DAffine3) -> f64 {
        let of = |(at, [q, p]): &(DVec3, [f32; 2])| {
            let [re, im] = self.lattice.at(pose.transform_point3(*at));
            f64::from(p * im - q * re)
        };
        self.charges.iter().map(of).sum()
    }

    /// A place of the way, with displacements from there.
    fn start(&self, travel: f64) -> Start {
        let on = (self.way.pose)(travel);
        Start::new(on, self.way.outward, on.transform_point3(self.middle))
    }

    /// A least energy off the way near one of its places, across it or with `tilt`; and the pose opposite, which else would be the next.
    fn near(&self, place: f64, tilt: bool) -> impl Iterator<Item = Fault> {
        let travel = self.way.fitted_mm() * place / PLACES as f64;
        let (start, height) = (self.start(travel), self.way.height(travel));
        let energy = |pose: &DAffine3| self.energy(pose);
        let x = if tilt {
            start.lowest(energy, FINE_MM)
        } else {
            start.lowest_across(energy, FINE_MM)
        };
        let off_mm = x[0].hypot(x[1]).max(x[2].hypot(x[3]));
        let from = (self.way.pose)(travel);
        let sides = [x, x.map(|x| -x)].map(|x| Fault {
            from,
            to: start.displaced(&x),
            rise: height * rise(off_mm / WIDTH_MM),
            weight: NEAR_WEIGHT / height.max(LEAST_HEIGHT),
            off_mm,
        });
        sides.into_iter().filter(move |_| off_mm > NEAR_MM)
    }

    /// Too little rise over a step back along the way.
    fn back(&self, step: usize) -> Option<Fault> {
        let [from, to] = [step, step + 1].map(|step| BACK_MM * step as f64);
        let rise = self.way.height(from) - self.way.height(to);
        self.fault(
            [from, to].map(|travel| (self.way.pose)(travel)),
            rise,
            BACK_SHARE,
            BACK_MM,
            BACK_WEIGHT,
        )
    }

    /// Too little rise over steps aside at a place about the mouth, in one direction.
    fn aside(&self, place: usize, direction: usize) -> impl Iterator<Item = Fault> + '_ {
        let [within, open] = MOUTH_MM;
        let beyond = within + (open - within) * place as f64 / (MOUTH_PLACES - 1) as f64;
        let travel = (self.way.length_mm + beyond).max(0.0);
        let (start, height) = (self.start(travel), self.way.height(travel));
        let (sin, cos) = (TAU * direction as f64 / DIRECTIONS as f64).sin_cos();
        (1..ASIDE_STEPS).filter_map(move |step| {
            let distances = [step, step + 1].map(|step| ASIDE_MM * step as f64);
            let poses = distances.map(|d| start.displaced(&[d * cos, d * sin, 0.0, 0.0]));
            let [near, far] = distances.map(|d| height * rise(d / WIDTH_MM));
            self.fault(poses, far - near, ASIDE_SHARE, ASIDE_MM, ASIDE_WEIGHT)
        })
    }

    fn fault(
        &self,
        [from, to]: [DAffine3; 2],
        rise: f64,
        share: f64,
        step_mm: f64,
        weight: f64,
    ) -> Option<Fault> {
        let found = self.energy(&to) - self.energy(&from);
        (found < share * rise).then_some(Fault {
            from,
            to,
            rise,
            weight,
            off_mm: if found < 0.0 { step_mm } else { ENOUGH_MM },
        })
    }
}
