//! The geometric energy as a board takes it: where its minimum is, its gradient, what it costs and what energy it makes.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use mortise_energy::{BakedEnergy, Density, Kernel, Pair, Placed, bytes, moved};
use mortise_shapes::{Designed, KINDS};

use super::super::{Plan, Row};
use crate::LabError;
use crate::energy::sections::Section;
use crate::followed::{Followed, Help, off};
use crate::guided::{self, SIM};
use crate::parallel::trials;

/// Largest distance of the minimum from the way, mm, and tilt, mrad; also of the lateral minimum above the mouth.
const BIAS_MM: f64 = 0.15;
const BIAS_MRAD: f64 = 15.0;
/// Largest error of gradients, % of the largest.
const GRADIENT_PERCENT: f64 = 1.0;
/// Bytes of a pair.
const BYTES: f64 = 32.0 * 1024.0;
/// Instructions of the energy, and of a tick with it.
const ENERGY_INSTRUCTIONS: f64 = 20_000.0;
pub(super) const TICK_INSTRUCTIONS: f64 = 120_000.0;
/// Energy made, mJ.
const MADE_MJ: f64 = 1.0;
/// Deepest overlap under a careless hand, mm: what is asked of contact under a hand of 1 m/s.
const CARELESS_OVERLAP_MM: f64 = 0.3;
/// Heights above the mouth, mm.
const ABOVE_MM: [f64; 3] = [1.0, 2.0, 5.0];
/// Reach of the grid on which the least energy is sought above the mouth, mm, and the step that ends the search, mm.
const GRID_MM: f64 = 3.0;
const ENOUGH_MM: f64 = 1e-3;
/// How far before the fit the least energy along the way is sought, mm, and at how many places.
const BEFORE_MM: f64 = 5.0;
const BEFORE_PLACES: u32 = 200;
/// Places about the mouth at which it has to draw towards the way: heights above it and distances aside, mm, in so many directions; and the step of the difference.
const BASIN_HEIGHTS_MM: [f64; 5] = [0.0, 0.5, 1.0, 2.5, 4.0];
const BASIN_ASIDE_MM: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
const BASIN_DIRECTIONS: u32 = 16;
const BASIN_STEP_MM: f64 = 0.1;
/// Places along the way at which it has to draw inwards.
const INWARD_PLACES: u32 = 100;
/// Poses at which the gradient is compared, and their distance from the way, mm and rad.
const GRADIENTS: usize = 1000;
const GRADIENTS_QUICK: usize = 100;
const ASIDE_MM: f64 = 4.0;
const TURNED_RAD: f64 = 0.15;
/// Step of the differences, mm, and the rotation for it, rad per mm: a charge 10 mm from the axis then moves by the step.
///
/// A trilinear energy has no truncation within a cell but its mixed terms, a share of step over cell (10⁻⁵). Rounding of a sum of some 400 terms below 1 gives 10⁻¹³
/// over the step. The lower bound is the cell that a charge lies in: the board rounds its place in the lattice (at most 32 cells of 3 mm) to single precision, by up
/// to 10⁻⁶ of a cell or 3·10⁻⁶ mm, so within that of a boundary it takes the slope of the other cell. With ten times that distance as the step, the difference across the
/// boundary has at least nine tenths of the other cell's slope; in rotation so for all charges 10 mm from the axis and beyond, which make most of a torque.
const DIFFERENCE: f64 = 3e-5;
const DIFFERENCE_RAD_PER_MM: f64 = 0.1;
/// The pair whose ticks are counted, the height above its mouth, mm, and how far off the hand is that puts it in, mm and degrees.
const THESIS_PAIR: &str = include_str!("../../../data/pair_d18.75_clear0.02.step");
const THESIS_PAIR_WITH_PLAY: &str = include_str!("../../../../app/samples/pair_d18.75_clear1.00.step");
const HOVER_MM: f64 = 2.0;
const ASIDE_START_MM: f64 = 1.0;
const TURNED_START_DEG: f64 = 2.0;
/// Seconds of careless motion, four changes a second, and of each recording.
const WANDER_S: f64 = 250.0;
const WANDER_QUICK_S: f64 = 10.0;
const RECORDING_S: f64 = 2.5;
/// Lattice of the published form beside ours, mm, as `mortise-lab energy` has it.
const PUBLISHED_MM: [f64; 2] = [2.5, 8.0];

/// An energy, and the cell of each charge.
type At = (f64, Vec<Option<usize>>);

/// A pair with its energy.
struct Subject {
    what: String,
    followed: Followed,
    energy: BakedEnergy,
    section: Option<Section>,
}

impl Subject {
    fn of_section(section: Section) -> Result<Self, LabError> {
        let (followed, energy) = section.followed()?;
        Ok(Self {
            what: format!("{} peg at exact fit", section.name()),
            followed,
            energy,
            section: Some(section),
        })
    }

    fn random(seed: u64) -> Result<Self, LabError> {
        let designed = Designed::random(seed);
        let file = guided::file(&designed.text())?;
        let (followed, energy) = Followed::new(file.path(), ["moving", "fixed"])?.with_energy()?;
        Ok(Self {
            what: designed.kind.to_owned(),
            followed,
            energy,
            section: None,
        })
    }

    fn energy_at(&self, pose: &DAffine3) -> f64 {
        self.energy.at(pose, DVec3::ZERO).energy
    }

    /// The energy in double precision, by weights of the eight nodes about each charge: written apart from what the board computes. And the first node of the cell of
    /// each charge; `None` outside.
    fn exact(&self, pose: &DAffine3) -> At {
        let record = &self.energy.record;
        let size = record.size.map(usize::from);
        let origin = DVec3::from_array(record.origin.map(f64::from));
        let mut sum = 0.0;
        let cells = self.energy.charges.iter().map(|charge| {
            let at = pose.transform_point3(1e3 * DVec3::from_array(charge.at.map(f64::from)));
            let place = (1e-3 * at - origin) / f64::from(record.step);
            let first = place.floor();
            let last = DVec3::from_array(size.map(|n| n as f64 - 2.0));
            if !(first.cmpge(DVec3::ZERO).all() && first.cmple(last).all()) {
                return None;
            }
            let share = place - first;
            let first = first.to_array().map(|x| x as usize);
            let node = |[i, j, k]: [usize; 3]| i + size[0] * (j + size[1] * k);
            for corner in 0..8 {
                let bit = [0, 1, 2].map(|axis| corner >> axis & 1);
                let weight: f64 = (0..3)
                    .map(|k| if bit[k] == 1 { share[k] } else { 1.0 - share[k] })
                    .product();
                let [re, im] =
                    self.energy.nodes[node([0, 1, 2].map(|axis| first[axis] + bit[axis]))].map(f64::from);
                let [q, p] = charge.charge.map(f64::from);
                sum -= weight * (re * q - im * p);
            }
            Some(node(first))
        });
        let cells = cells.collect();
        (sum, cells)
    }

    /// Distance across the way (mm) and tilt (rad) of the least energy near the way, at a travel from the fit.
    fn bias(&self, travel_mm: f64) -> [f64; 2] {
        let (aside, tilt) = self.energy.minimum(&self.followed.place(travel_mm));
        [aside, tilt]
    }

    /// Distance of the least energy sideways from the way above the mouth, mm, by `of`: the best of a grid, refined.
    fn aside(&self, height_mm: f64, of: &dyn Fn(&DAffine3) -> f64) -> f64 {
        let pose = self.followed.place(self.followed.depth_mm() + height_mm);
        let (u, v) = self.followed.outward().any_orthonormal_pair();
        let at = |x: [f64; 2]| of(&(DAffine3::from_translation(u * x[0] + v * x[1]) * pose));
        let (mut best, mut least) = ([0.0; 2], at([0.0; 2]));
        let mut step = GRID_MM / 6.0;
        let mut reach = 6;
        while step > ENOUGH_MM {
            let middle = best;
            for i in -reach..=reach {
                for k in -reach..=reach {
                    let place = [middle[0] + step * f64::from(i), middle[1] + step * f64::from(k)];
                    let there = at(place);
                    if there < least {
                        (best, least) = (place, there);
                    }
                }
            }
            (step, reach) = (0.5 * step, 1);
        }
        best[0].hypot(best[1])
    }

    /// How far before the fit the energy is least along the way, mm.
    fn before_the_fit(&self) -> f64 {
        let travels = (0..=BEFORE_PLACES).map(|i| BEFORE_MM * f64::from(i) / f64::from(BEFORE_PLACES));
        let least = travels
            .map(|travel| (self.energy_at(&self.followed.place(travel)), travel))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        least.map_or(BEFORE_MM, |(_, travel)| travel)
    }

    /// Places of [`BASIN_HEIGHTS_MM`], [`BASIN_ASIDE_MM`] and all directions at which the energy falls away from the way.
    fn drawn_away(&self) -> u32 {
        let (u, v) = self.followed.outward().any_orthonormal_pair();
        let mut away = 0;
        for height in BASIN_HEIGHTS_MM {
            let pose = self.followed.place(self.followed.depth_mm() + height);
            for aside in BASIN_ASIDE_MM {
                for i in 0..BASIN_DIRECTIONS {
                    let (sin, cos) = (TAU * f64::from(i) / f64::from(BASIN_DIRECTIONS)).sin_cos();
                    let at = |d: f64| {
                        self.energy_at(&(DAffine3::from_translation((u * cos + v * sin) * d) * pose))
                    };
                    away += u32::from(at(aside + BASIN_STEP_MM) < at(aside - BASIN_STEP_MM));
                }
            }
        }
        away
    }

    /// Steps of the way, from the mouth to the fit, over which the energy does not fall.
    fn held_back(&self) -> u32 {
        let step = self.followed.depth_mm() / f64::from(INWARD_PLACES);
        let energy = |i: u32| self.energy_at(&self.followed.place(step * f64::from(i)));
        (0..INWARD_PLACES)
            .map(|i| u32::from(energy(i + 1) <= energy(i)))
            .sum()
    }

    /// Largest error of the gradient over the largest component, %, against differences.
    fn gradient_error(&self, poses: usize) -> f64 {
        let mut random = fastrand::Rng::with_seed(7);
        let mut signed = || 2.0 * random.f64() - 1.0;
        let (mut error, mut largest) = ([0.0f64; 2], [0.0f64; 2]);
        for _ in 0..poses {
            let travel = (self.followed.depth_mm() + 5.0) * 0.5 * (1.0 + signed());
            let pose = self.followed.place(travel);
            let about = pose.transform_point3(self.followed.center_of_mass());
            let by = DVec3::new(signed(), signed(), signed()) * ASIDE_MM;
            let turn = DVec3::new(signed(), signed(), signed()) * TURNED_RAD;
            let moved = |pose: &DAffine3, by: DVec3, turn: DVec3| moved(pose, by, turn, about);
            let pose = moved(&pose, by, turn);
            let found = self.energy.at(&pose, about);
            let here = self.exact(&pose);
            for axis in DVec3::AXES {
                let at = |by: DVec3, turn: DVec3| self.exact(&moved(&pose, by, turn));
                let slid = [DIFFERENCE, -DIFFERENCE].map(|step| (step, at(axis * step, DVec3::ZERO)));
                let turned = [DIFFERENCE, -DIFFERENCE]
                    .map(|step| step * DIFFERENCE_RAD_PER_MM)
                    .map(|step| (step, at(DVec3::ZERO, axis * step)));
                for (which, (sides, slope)) in [(slid, found.slope), (turned, found.turn)]
                    .into_iter()
                    .enumerate()
                {
                    let slope = slope.dot(axis);
                    error[which] = error[which].max(off_differences(slope, &here, &sides));
                    largest[which] = largest[which].max(slope.abs());
                }
            }
        }
        100.0 * (error[0] / largest[0]).max(error[1] / largest[1])
    }
}

/// Distance of a slope from the differences to both sides (steps, and energy with cells there). Where every charge stays in its cell, from their mean; else from the
/// nearer one, since at a boundary of cells the slope is that of either side.
fn off_differences(slope: f64, here: &At, sides: &[(f64, At); 2]) -> f64 {
    let [after, before] = sides.each_ref().map(|(step, at)| (at.0 - here.0) / step);
    if sides.iter().all(|(_, at)| at.1 == here.1) {
        (0.5 * (after + before) - slope).abs()
    } else {
        (after - slope).abs().min((before - slope).abs())
    }
}

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let sections = trials(Section::ALL.len(), |index| {
        Subject::of_section(Section::ALL[index])
    })?;
    for subject in &sections {
        subject.rows(plan, out);
        published(subject, out)?;
    }
    // Each kind once, in the quick form the first ones: pairs on which the weights of the fit were chosen, and pairs that were not looked at before.
    let count = if plan.quick { 2 } else { KINDS };
    for (first, which) in [(2, "random"), (30, "other random")] {
        let pairs = trials(count, |index| {
            Subject::random(first * KINDS as u64 + index as u64)
        })?;
        all_of(&pairs, which, plan, out);
    }
    at_rest(out)?;
    cost(out)?;
    let moved = if plan.quick { &sections[..1] } else { &sections[..] };
    for subject in moved {
        careless(subject, plan, out)?;
    }
    Ok(())
}

impl Subject {
    /// Progress on the error stream.
    fn seen(&self) {
        let depth = self.followed.depth_mm();
        let above = ABOVE_MM.map(|height| self.aside(height, &|pose| self.energy_at(pose)));
        let [seated, half] = [0.0, 0.5].map(|share| self.bias(share * depth));
        eprintln!(
            "{}: depth {depth:.1} mm, seated {seated:.3?}, half in {half:.3?}, above {above:.3?}, deviation {:.3}",
            self.what, self.energy.deviation
        );
    }

    fn rows(&self, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) {
        all_of(std::slice::from_ref(self), "", plan, out);
    }
}

/// Rows of pairs: the worst of each. `which` names several.
fn all_of(subjects: &[Subject], which: &str, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) {
    let what = |row: &str| match subjects {
        [subject] => format!("board's energy, {}: {row}", subject.what),
        _ => format!(
            "board's energy, {} {which} pairs of as many kinds: {row}",
            subjects.len()
        ),
    };
    for subject in subjects {
        subject.seen();
    }
    let worst = |of: &dyn Fn(&Subject) -> f64| subjects.iter().map(of).fold(0.0, f64::max);
    for (share, place) in [(0.0, "seated"), (0.5, "half in")] {
        let bias = |subject: &Subject| subject.bias(share * subject.followed.depth_mm());
        let aside = worst(&|subject| bias(subject)[0]);
        out(Row::at_most(
            what(&format!("minimum off the fit, {place}")),
            aside,
            "mm",
            BIAS_MM,
        ));
        let tilt = 1e3 * worst(&|subject| bias(subject)[1]);
        out(Row::at_most(
            what(&format!("minimum tilted, {place}")),
            tilt,
            "mrad",
            BIAS_MRAD,
        ));
    }
    out(Row::at_most(
        what("least energy along the way, before the fit"),
        worst(&Subject::before_the_fit),
        "mm",
        BIAS_MM,
    ));
    let above = worst(&|subject| {
        let of = |pose: &DAffine3| subject.energy_at(pose);
        (ABOVE_MM.into_iter())
            .map(|height| subject.aside(height, &of))
            .fold(0.0, f64::max)
    });
    out(Row::at_most(
        what("least energy sideways off the way, 1 to 5 mm above the mouth"),
        above,
        "mm",
        BIAS_MM,
    ));
    let count = |of: &dyn Fn(&Subject) -> u32| subjects.iter().map(of).map(f64::from).sum::<f64>();
    let looked = BASIN_HEIGHTS_MM.len() * BASIN_ASIDE_MM.len() * BASIN_DIRECTIONS as usize;
    out(Row::exactly(
        what(&format!(
            "drawn away from the way, of {looked} places 1 to 4 mm aside and 0 to 4 mm above the mouth of each"
        )),
        count(&Subject::drawn_away),
        "places",
        0.0,
    ));
    out(Row::exactly(
        what(&format!(
            "not drawn inwards, of {INWARD_PLACES} steps of each way"
        )),
        count(&Subject::held_back),
        "steps",
        0.0,
    ));
    let poses = if plan.quick { GRADIENTS_QUICK } else { GRADIENTS };
    let gradient = worst(&|subject| subject.gradient_error(poses));
    out(Row::at_most(
        what("gradient and torque against differences, of the largest"),
        gradient,
        "%",
        GRADIENT_PERCENT,
    ));
    let size = worst(&|subject| {
        let placed = Placed {
            moving: 0,
            fixed: 1,
            energy: subject.energy.clone(),
        };
        bytes(std::slice::from_ref(&placed)) as f64
    });
    out(Row::at_most(what("bytes"), size, "bytes", BYTES));
}

/// What the published form does above the mouth of a section.
fn published(subject: &Subject, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(section) = subject.section else {
        return Ok(());
    };
    let [block, peg] = section.shapes()?;
    let [block, peg] = [block, peg].map(|shape| Density::new(&shape, Kernel::default()));
    let pair = Pair::new(&block, &peg, PUBLISHED_MM, glam::DMat3::IDENTITY, 1.0);
    let of = |pose: &DAffine3| pair.at(pose).energy;
    let aside = (ABOVE_MM.into_iter())
        .map(|height| subject.aside(height, &of))
        .fold(0.0, f64::max);
    out(Row::reported(
        format!(
            "published energy, {}: least energy sideways off the way, 1 to 5 mm above the mouth",
            subject.what
        ),
        aside,
        "mm",
    ));
    Ok(())
}

/// Instructions of the energy by itself on the emulated board: a part with play, so that nothing touches it, at rest on its way.
fn at_rest(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = guided::file(THESIS_PAIR_WITH_PLAY)?;
    let (followed, _) = Followed::new(file.path(), ["peg", "block"])?.with_energy()?;
    let rig = guided::emulated();
    let depth = followed.depth_mm();
    for (height_mm, place) in [
        (HOVER_MM, "2 mm above the mouth"),
        (-0.5 * depth, "half in"),
        (-depth, "seated"),
    ] {
        let [without, with] = [Help::Nothing, Help::Energy].map(|help| followed.hover(height_mm, help, &rig));
        out(Row::at_most(
            format!(
                "board's energy, thesis pair at 1 mm, emulated, at rest {place}: median of the instructions of a tick, more than without it"
            ),
            with? - without?,
            "instructions",
            ENERGY_INSTRUCTIONS,
        ));
    }
    Ok(())
}

/// Ticks of the emulated board while a hand puts a part in.
fn cost(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let file = guided::file(THESIS_PAIR)?;
    let (followed, _) = Followed::new(file.path(), ["peg", "block"])?.with_energy()?;
    let rig = guided::emulated();
    let what = |row: &str| format!("board's energy, thesis pair at 20 µm, emulated: {row}");
    let start = off(&mut fastrand::Rng::with_seed(3), ASIDE_START_MM, TURNED_START_DEG);
    let seen = followed.insert(&start, Help::Energy, &rig)?;
    out(Row::at_most(
        what("instructions in the longest tick while it is put in"),
        seen.instructions,
        "instructions",
        TICK_INSTRUCTIONS,
    ));
    out(Row::exactly(
        what("missed ticks"),
        f64::from(seen.missed),
        "ticks",
        0.0,
    ));
    Ok(())
}

/// Energy made and overlap while a careless hand goes in and out.
fn careless(subject: &Subject, plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let seconds = if plan.quick { WANDER_QUICK_S } else { WANDER_S };
    let count = (seconds / RECORDING_S).round() as usize;
    let seen = trials(count, |index| {
        let mut random = fastrand::Rng::with_seed(index as u64);
        let recording = subject.followed.wander(&mut random, RECORDING_S, &SIM)?;
        let at_part = (subject.followed).made_by_energy_mj(&subject.energy, &recording.samples);
        let outcome = recording.outcome;
        Ok([
            outcome.energy_given_mj,
            at_part,
            outcome.penetration_mm,
            f64::from(outcome.missed_ticks),
        ])
    })?;
    let worst = |k: usize| seen.iter().map(|seen| seen[k]).fold(0.0, f64::max);
    let motions = (4.0 * RECORDING_S * count as f64).round() as usize;
    let what = |row: &str| {
        format!(
            "board's energy, {}, {motions} random motions: {row}",
            subject.what
        )
    };
    out(Row::at_most(
        what("energy made at the handle"),
        worst(0),
        "mJ",
        MADE_MJ,
    ));
    out(Row::at_most(
        what("energy made at the part"),
        worst(1),
        "mJ",
        MADE_MJ,
    ));
    out(Row::at_most(
        what("deepest overlap by the exact surfaces"),
        worst(2),
        "mm",
        CARELESS_OVERLAP_MM,
    ));
    out(Row::exactly(what("missed ticks"), worst(3), "ticks", 0.0));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A difference across a boundary of cells is not blamed on the slope, and one within a cell is.
    #[test]
    fn sides_count_apart_only_across_a_boundary() {
        let at = |energy: f64, cell: usize| (energy, vec![Some(cell)]);
        // A slope of 1 before the boundary and 3 after it.
        let across = [(0.1, at(0.3, 2)), (-0.1, at(-0.1, 1))];
        for (slope, off) in [(1.0, 0.0), (3.0, 0.0), (2.0, 1.0)] {
            assert!((off_differences(slope, &at(0.0, 1), &across) - off).abs() < 1e-12);
        }
        let within = across.map(|(step, (energy, _))| (step, at(energy, 1)));
        for (slope, off) in [(1.0, 1.0), (3.0, 1.0), (2.0, 0.0)] {
            assert!((off_differences(slope, &at(0.0, 1), &within) - off).abs() < 1e-12);
        }
    }

    /// All sections keep the bound in all poses of the full form.
    #[test]
    #[cfg_attr(debug_assertions, ignore = "bakes energies, minutes without optimisation")]
    fn the_sections_gradients_are_those_of_differences() {
        for section in Section::ALL {
            let subject = Subject::of_section(section).expect("has an energy");
            let error = subject.gradient_error(GRADIENTS);
            eprintln!("{section:?}: {error:.6} %");
            assert!(error < GRADIENT_PERCENT, "{section:?}: {error} %");
        }
    }

    /// Prisms with many sides, whose search runs out of its budget in most ticks: with points of edges decimated, such recordings overlapped by millimetres.
    #[test]
    #[cfg_attr(debug_assertions, ignore = "bakes energies, minutes without optimisation")]
    fn careless_motion_puts_no_prism_into_the_walls() {
        for section in [Section::Circular, Section::Combined] {
            let subject = Subject::of_section(section).expect("has an energy");
            // Others than those of the page.
            for seed in 1000..1008 {
                let mut random = fastrand::Rng::with_seed(seed);
                let recording = (subject.followed).wander(&mut random, RECORDING_S, &SIM);
                let outcome = recording.expect("is played").outcome;
                let (overlap, made) = (outcome.penetration_mm, outcome.energy_given_mj);
                eprintln!("{section:?} {seed}: {overlap:.3} mm, {made:.4} mJ");
                assert!(
                    overlap < 0.4 && made < 0.01,
                    "{section:?} {seed}: {overlap} mm, {made} mJ"
                );
            }
        }
    }
}
