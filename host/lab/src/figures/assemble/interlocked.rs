//! Assemblies of the repository's own that stay together, made from a seed, and the same with 60 µm more play, which come apart.

use std::f64::consts::FRAC_PI_2;
use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3, dvec2};
use mortise_task::sequence;
use tempfile::NamedTempFile;

use super::checked::{Checked, Overlap};
use super::extraction::overlaps;
use crate::LabError;
use crate::figures::{Plan, Row};
use crate::generated::Bore;
use crate::step_text::StepText;

/// Seeds in the full and in the quick form.
const SEEDS: u64 = 10;
const SEEDS_QUICK: u64 = 3;
/// Excess of a part's width over that of the opening which holds it, mm: least and most.
const HELD_MM: [f64; 2] = [0.02, 0.05];
/// Play that is added in the loosened form, mm.
const LOOSENED_MM: f64 = 0.06;
/// Share of the overlap that must be proved, and what may be missing beside that, mm: the least depth that counts, and how far a polygon is from the opening's rim.
const PROVED: f64 = 0.9;
const MISSING_MM: f64 = 4e-3;
/// Time of a search, s.
const SEARCH_S: u64 = 60;

/// Kinds of assemblies that stay together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Two to four plates on a rivet with a flat head on either side.
    Riveted,
    /// A ball behind the lip of a cup, with a cap on the cup.
    Caged,
    /// Three frames in a chain, which stay for ever.
    Chained,
}

/// The assembly of a kind and a seed.
pub(super) struct Interlocked {
    kind: Kind,
    random: fastrand::Rng,
    /// By how much the part is wider than its opening, mm: negative where it has play.
    excess: f64,
}

impl Interlocked {
    pub fn new(kind: Kind, seed: u64, loosened: bool) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let held = HELD_MM[0] + (HELD_MM[1] - HELD_MM[0]) * random.f64();
        Self {
            kind,
            random,
            excess: if loosened { held - LOOSENED_MM } else { held },
        }
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.f64()
    }

    /// Its STEP file.
    pub fn file(&mut self) -> Result<NamedTempFile, LabError> {
        let mut text = StepText::new();
        match self.kind {
            Kind::Riveted => self.riveted(&mut text),
            Kind::Caged => self.caged(&mut text),
            Kind::Chained => self.chained(&mut text),
        }
        text.file()
    }

    fn riveted(&mut self, text: &mut StepText) {
        let hole = self.between(2.0, 5.0);
        let shank = hole - self.between(0.02, 0.3);
        let thick = self.between(1.5, 4.0);
        let count = self.random.usize(2..=4);
        let plate = plate(text, 3.0 * hole, hole, [0.0, thick]);
        for i in 0..count {
            let at = DVec3::Z * (thick * i as f64);
            text.part(&format!("plate_{i}"), plate, DAffine3::from_translation(at));
        }
        let (low, high) = (-0.02, thick * count as f64 + 0.02);
        let [below, above] = [0; 2].map(|_| self.between(0.8, 2.0));
        let (wide, head) = (1.5 * hole, hole + self.excess);
        let rivet = text.turned(&[
            dvec2(0.0, low - below),
            dvec2(wide, low - below),
            dvec2(wide, low),
            dvec2(shank, low),
            dvec2(shank, high),
            dvec2(head, high),
            dvec2(head, high + above),
            dvec2(0.0, high + above),
        ]);
        text.part("rivet", rivet, DAffine3::IDENTITY);
    }

    fn caged(&mut self, text: &mut StepText) {
        let ball = self.between(3.0, 7.0);
        let (lip, wall) = (ball - self.excess, self.between(1.5, 3.0));
        let inner = ball + self.between(0.05, 0.5);
        let (floor, edge) = (-ball - 0.1, ball + 0.1);
        let outer = inner + wall;
        let cup = text.turned(&[
            dvec2(0.0, floor - wall),
            dvec2(outer, floor - wall),
            dvec2(outer, edge + wall),
            dvec2(lip, edge + wall),
            dvec2(lip, edge),
            dvec2(inner, edge),
            dvec2(inner, floor),
            dvec2(0.0, floor),
        ]);
        text.part("cup", cup, DAffine3::IDENTITY);
        let solid = text.ball(ball);
        text.part("ball", solid, DAffine3::IDENTITY);
        let cap = text.turned(&[
            dvec2(0.0, 0.0),
            dvec2(outer, 0.0),
            dvec2(outer, wall),
            dvec2(0.0, wall),
        ]);
        let above = DVec3::Z * (edge + wall + 0.01);
        text.part("cap", cap, DAffine3::from_translation(above));
    }

    fn chained(&mut self, text: &mut StepText) {
        let bore = self.between(4.0, 8.0);
        let [wide, thick] = [0; 2].map(|_| bore * self.between(0.3, 0.5));
        let mut frame = |bore: f64| plate(text, bore + wide, bore, [-thick / 2.0, thick / 2.0]);
        // The bars of the outer frames have room side by side in the middle one.
        let (outer, middle) = (frame(bore), frame(2.0 * bore));
        let apart = DVec3::X * (2.0 * bore + wide / 2.0);
        let upright = DAffine3::from_rotation_x(FRAC_PI_2);
        text.part("left", outer, DAffine3::IDENTITY);
        text.part("middle", middle, DAffine3::from_translation(apart) * upright);
        text.part("right", outer, DAffine3::from_translation(2.0 * apart));
    }

    /// Whether one of the two parts holds the other, by their names.
    fn holds(&self, pair: [&str; 2]) -> bool {
        match self.kind {
            Kind::Riveted => pair.contains(&"rivet"),
            Kind::Caged => pair.contains(&"ball") && pair.contains(&"cup"),
            Kind::Chained => pair.contains(&"middle"),
        }
    }

    /// Number of parts that stay together.
    fn stay(&self, count: usize) -> usize {
        if self.kind == Kind::Caged { 2 } else { count }
    }
}

/// A square plate of half the side `half` between two heights, with a round bore in its middle, mm.
fn plate(text: &mut StepText, half: f64, bore: f64, [low, high]: [f64; 2]) -> u64 {
    let outline = [
        dvec2(-half, -half),
        dvec2(half, -half),
        dvec2(half, half),
        dvec2(-half, half),
    ];
    let bore = Bore {
        faces: (0, Some(1)),
        mouth: DVec3::Z * low,
        depth: DVec3::Z * (high - low),
        radius: bore,
    };
    text.prism(&outline, [low, high], &[bore])
}

/// Whether what a search found is true: the parts stay, with the pair and a proof that they overlap by nearly as much as they do on the straight way out.
fn is_true(one: &Interlocked, checked: &Checked, found: &sequence::Sequence) -> bool {
    let assembly = &checked.assembly;
    let [(set, blocked)] = &found.stuck[..] else {
        return false;
    };
    let needed = blocked.overlap_mm.filter(|_| blocked.proof.is_some());
    let near = needed.is_some_and(|mm| match one.kind {
        Kind::Chained => true,
        _ => (PROVED * one.excess - MISSING_MM..=one.excess).contains(&mm),
    });
    !found.timed_out
        && set.len() == one.stay(assembly.count())
        && one.holds(blocked.pair.map(|part| assembly.name(part)))
        && near
}

/// Measures the rows of each kind.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let seeds = if plan.quick { SEEDS_QUICK } else { SEEDS };
    let mut overlap = Overlap::default();
    let mut longest: f64 = 0.0;
    for (kind, what) in [
        (
            Kind::Riveted,
            "plates on a rivet, whose head is 20 to 50 µm too wide",
        ),
        (Kind::Caged, "ball behind a lip, 20 to 50 µm too wide"),
        (Kind::Chained, "three frames in a chain"),
    ] {
        let (mut stay, mut go) = (0, 0);
        for seed in 0..seeds {
            let mut search = |loosened: bool| -> Result<_, LabError> {
                let mut one = Interlocked::new(kind, seed, loosened);
                let checked = Checked::load(one.file()?.path())?;
                let start = Instant::now();
                let all: Vec<usize> = (0..checked.assembly.count()).collect();
                let found = sequence::disassemble(&checked.assembly, &all, Duration::from_secs(SEARCH_S));
                longest = longest.max(start.elapsed().as_secs_f64());
                Ok((one, checked, found))
            };
            let (one, checked, found) = search(false)?;
            if is_true(&one, &checked, &found) {
                stay += 1;
            } else {
                eprintln!("{what}, seed {seed}: {:?}, not {} mm", found.stuck, one.excess);
            }
            if kind != Kind::Chained {
                let (_, checked, found) = search(true)?;
                go += usize::from(found.complete());
                for step in &found.steps {
                    overlap = overlap.and(checked.overlap(&step.group, &step.onto, &step.path));
                }
            }
        }
        let row = |what: String, count: usize| Row::exactly(what, count as f64, "assemblies", seeds as f64);
        out(row(format!("{seeds} × {what}: stay, by a proof"), stay));
        if kind != Kind::Chained {
            out(row(
                format!("{seeds} × {what}, with 60 µm more play: come apart"),
                go,
            ));
        }
    }
    let what = "assemblies that stay together until they have 60 µm more play";
    out(plan.timed(format!("{what}: longest search"), longest, SEARCH_S as f64));
    overlaps(what, overlap, out);
    Ok(())
}

#[cfg(test)]
mod tests {
    use mortise_task::{Assembly, Moved};

    use super::*;

    fn load(one: &mut Interlocked) -> Assembly {
        let file = one.file().unwrap();
        Assembly::new(mortise_brep::load_step(file.path()).unwrap()).unwrap()
    }

    /// On the straight way out the parts meet by the excess, or are free once loosened; in place no frame overlaps another.
    #[test]
    fn the_straight_way_out_lacks_the_excess() {
        for seed in 0..4 {
            for loosened in [false, true] {
                let mut riveted = Interlocked::new(Kind::Riveted, seed, loosened);
                let mut caged = Interlocked::new(Kind::Caged, seed, loosened);
                for (one, out, moving) in [
                    (&mut riveted, DVec3::NEG_Z, "rivet"),
                    (&mut caged, DVec3::Z, "ball"),
                ] {
                    let assembly = load(one);
                    let part = assembly.part(moving).unwrap();
                    let others: Vec<usize> = (0..assembly.count())
                        .filter(|&other| other != part && assembly.name(other) != "cap")
                        .collect();
                    let gap = |i: u32| {
                        let by = DAffine3::from_translation(out * f64::from(i));
                        let moved = Moved { parts: &[part], by };
                        assembly
                            .clearance(&moved, &others, 1e3, true)
                            .unwrap()
                            .gap
                            .distance_mm
                    };
                    let least = (0..=40).map(gap).fold(f64::INFINITY, f64::min);
                    // Lips and plates are thicker than a step.
                    let as_meant = if loosened {
                        least > 5e-3
                    } else {
                        (least + one.excess).abs() < 5e-4
                    };
                    assert!(as_meant, "seed {seed}: {least} mm, not {} mm", -one.excess);
                }
            }
            let chain = load(&mut Interlocked::new(Kind::Chained, seed, false));
            assert_eq!(chain.count(), 3);
            assert!(chain.pressed_mm(0, 1) < 1e-6 && chain.pressed_mm(1, 2) < 1e-6);
        }
    }
}
