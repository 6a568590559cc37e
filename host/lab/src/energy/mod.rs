//! The geometric energy of a peg and its hole (Behandish & Ilieş 2015) in six degrees of freedom: figs. 5 and 6 repeated, and where the minimum is.
//!
//! Three sections at exact fit (`sections`), the kernel's weights as in the paper (λ₂/λ₁ = 3), σ = 0.2. The peg's lattice is turned by 17° so that no
//! symmetry hides an error. Energies are given as shares of the well's depth at the fit.
//!
//! Measured besides: how far the minimum is off the fit, seated and half in, with all samples and with the strongest alone, as a board could take; how wide
//! the well is (the paper's diameter of a constraint: the convex part around the minimum); and what the energy does sideways above the mouth, which the
//! paper does not show.

pub(crate) mod sections;

use std::fmt;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use mortise_energy::{Density, Kernel, Pair};
use serde::Serialize;

use self::sections::{DEPTH, Section};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};

/// Steps of the lattices, mm: in full and in the quick form; and how far they extend beyond the solids.
const STEPS_MM: [f64; 2] = [1.5, 2.5];
const MARGIN_MM: f64 = 8.0;
/// Turn of the peg's lattice, degrees, about an axis that is none of the solids'.
const TURN_DEG: f64 = 17.0;
const TURN_ABOUT: DVec3 = DVec3::new(1.0, 2.0, 3.0);
/// Numbers of the strongest samples that are tried alone.
const STRONGEST: [usize; 2] = [4000, 1000];
/// Largest translation and rotation of the charts, mm and degrees, and points of each curve.
const SHIFT_MM: f64 = 20.0;
const ANGLE_DEG: f64 = 60.0;
const POINTS: usize = 81;
/// Heights of the peg's foot above the mouth, mm, and the largest lateral offset there.
const ABOVE_MM: [f64; 3] = [1.0, 2.0, 5.0];
const ASIDE_MM: f64 = 6.0;
/// Reach of the search for a minimum about the fit, mm and degrees.
const SEARCH_MM: f64 = 1.0;
const SEARCH_DEG: f64 = 3.0;

/// What was found of a section with some of the samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Section.
    pub section: &'static str,
    /// Samples of the peg's density.
    pub samples: usize,
    /// How far the peg is in, mm.
    pub depth_mm: f64,
    /// Lateral distance of the minimum from the hole's axis, µm.
    pub axis_bias_um: f64,
    /// Tilt of the minimum, mrad.
    pub tilt_bias_mrad: f64,
    /// Width of the convex part about the minimum, sideways, mm.
    pub basin_mm: f64,
    /// The same of tilts, degrees.
    pub basin_deg: f64,
    /// Energy 3 mm aside of the axis less that on it, over the well's depth, with the foot 1 mm above the mouth: negative pushes aside.
    pub above_1_mm: f64,
    /// The same 2 mm above the mouth.
    pub above_2_mm: f64,
    /// The same 5 mm above the mouth.
    pub above_5_mm: f64,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {} samples, {:.0} mm in: minimum {:.1} µm and {:.2} mrad off, convex over {:.1} mm and {:.1}°; 3 mm aside above the mouth {:+.4}, {:+.4}, {:+.4} of the well",
            self.section,
            self.samples,
            self.depth_mm,
            self.axis_bias_um,
            self.tilt_bias_mrad,
            self.basin_mm,
            self.basin_deg,
            self.above_1_mm,
            self.above_2_mm,
            self.above_5_mm,
        )
    }
}

/// Pose of a peg whose foot is at `foot` and that is turned about it.
fn pose(foot: DVec3, turn: DVec3) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_scaled_axis(turn), foot)
}

/// A pair with what all its energies are compared with.
struct Measured {
    pair: Pair,
    /// Energy at the fit, negative.
    well: f64,
}

impl Measured {
    fn new(pair: Pair) -> Self {
        let well = pair.at(&pose(DVec3::new(0.0, 0.0, -DEPTH), DVec3::ZERO)).energy;
        Self { pair, well }
    }

    /// Energy over the well's depth.
    fn at(&self, foot: DVec3, turn: DVec3) -> f64 {
        -self.pair.at(&pose(foot, turn)).energy / self.well
    }

    fn entry(&self, section: Section, depth: f64) -> Entry {
        let foot = DVec3::new(0.0, 0.0, -depth);
        let aside = [DVec3::X, DVec3::Y]
            .map(|axis| least_at(&|by| self.at(foot + by * axis, DVec3::ZERO), SEARCH_MM));
        let middle = DVec3::new(0.0, 0.0, 0.5 * depth);
        // About the middle of what is in the hole.
        let tilted = |axis: DVec3, angle: f64| {
            let turn = angle * axis;
            let moved = foot + middle - DQuat::from_scaled_axis(turn) * middle;
            self.at(moved, turn)
        };
        let tilt =
            [DVec3::X, DVec3::Y].map(|axis| least_at(&|angle| tilted(axis, angle), SEARCH_DEG.to_radians()));
        let [above_1_mm, above_2_mm, above_5_mm] = ABOVE_MM.map(|height| {
            let at = |by: f64| self.at(DVec3::new(by, 0.0, height), DVec3::ZERO);
            at(0.5 * ASIDE_MM) - at(0.0)
        });
        Entry {
            section: section.name(),
            samples: self.pair.samples().len(),
            depth_mm: depth,
            axis_bias_um: 1e3 * aside[0].hypot(aside[1]),
            tilt_bias_mrad: 1e3 * tilt[0].hypot(tilt[1]),
            basin_mm: convex(&|by| self.at(foot + by * DVec3::X, DVec3::ZERO), 0.1, SHIFT_MM),
            basin_deg: convex(
                &|angle| tilted(DVec3::X, angle),
                0.25f64.to_radians(),
                ANGLE_DEG.to_radians(),
            )
            .to_degrees(),
            above_1_mm,
            above_2_mm,
            above_5_mm,
        }
    }
}

/// Place of the least value within `reach` of zero, of a function with one minimum there.
fn least_at(of: &dyn Fn(f64) -> f64, reach: f64) -> f64 {
    const HALVINGS: usize = 40;
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let (mut low, mut high) = (-reach, reach);
    for _ in 0..HALVINGS {
        let inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if of(inner[0]) < of(inner[1]) {
            high = inner[1];
        } else {
            low = inner[0];
        }
    }
    0.5 * (low + high)
}

/// Width of the interval about zero over which second differences with `step` are positive, at most `most` to either side.
fn convex(of: &dyn Fn(f64) -> f64, step: f64, most: f64) -> f64 {
    let side = |sign: f64| {
        let mut at = 0.0;
        while at < most {
            let next = at + step;
            let [a, b, c] = [at, next, next + step].map(|x| of(sign * x));
            if a + c <= 2.0 * b {
                break;
            }
            at = next;
        }
        at
    };
    side(1.0) + side(-1.0)
}

fn curve(name: &str, look: Look, line: Line, from: f64, to: f64, of: impl Fn(f64) -> f64) -> Series {
    let points = (0..POINTS).map(|i| {
        let x = from + (to - from) * i as f64 / (POINTS - 1) as f64;
        Point {
            x,
            y: of(x),
            ..Point::default()
        }
    });
    Series {
        name: name.to_owned(),
        look,
        line,
        points: points.collect(),
    }
}

fn chart(title: String, x: &str, series: Vec<Series>) -> Chart {
    Chart {
        title,
        note: String::new(),
        // The depth is that of the well at the fit.
        x: Axis::new(x).linear(),
        y: Axis::new("energy / depth").linear(),
        series,
    }
}

/// The charts of a section: over translations, over rotations, over two translations, and aside above the mouth.
fn charts(of: &Measured, section: Section) -> [Chart; 4] {
    let fit = DVec3::new(0.0, 0.0, -DEPTH);
    let middle = DVec3::new(0.0, 0.0, 0.5 * DEPTH);
    let axes = [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)];
    let lines = [Line::Trace, Line::DashedTrace, Line::Trace];
    let name = section.name();
    let translations = axes.iter().enumerate().map(|(k, (axis, way))| {
        curve(
            &format!("along {axis}"),
            Look::nth(k),
            lines[k],
            -SHIFT_MM,
            SHIFT_MM,
            |by| of.at(fit + by * *way, DVec3::ZERO),
        )
    });
    let rotations = axes.iter().enumerate().map(|(k, (axis, way))| {
        curve(
            &format!("about {axis}"),
            Look::nth(k),
            lines[k],
            -ANGLE_DEG,
            ANGLE_DEG,
            |degrees| {
                let turn = degrees.to_radians() * *way;
                of.at(fit + middle - DQuat::from_scaled_axis(turn) * middle, turn)
            },
        )
    });
    let score = [0.0, 10.0, 20.0, 30.0, 35.0]
        .into_iter()
        .enumerate()
        .map(|(k, out)| {
            curve(
                &format!("{out} mm out"),
                Look::nth(k),
                Line::Trace,
                -SHIFT_MM,
                SHIFT_MM,
                |by| of.at(fit + DVec3::new(by, 0.0, out), DVec3::ZERO),
            )
        });
    let mouth = ABOVE_MM.into_iter().enumerate().map(|(k, height)| {
        let on_axis = of.at(DVec3::new(0.0, 0.0, height), DVec3::ZERO);
        curve(
            &format!("{height} mm above"),
            Look::nth(k),
            Line::Trace,
            -ASIDE_MM,
            ASIDE_MM,
            |by| of.at(DVec3::new(by, 0.0, height), DVec3::ZERO) - on_axis,
        )
    });
    [
        chart(
            format!("{name}: translations from the fit"),
            "translation, mm",
            translations.collect(),
        ),
        chart(
            format!("{name}: rotations about the middle of the fit"),
            "rotation, degrees",
            rotations.collect(),
        ),
        chart(
            format!("{name}: along x, drawn out along z"),
            "translation along x, mm",
            score.collect(),
        ),
        chart(
            format!("{name}: aside above the mouth, less than on the axis"),
            "translation along x, mm",
            mouth.collect(),
        ),
    ]
}

/// The experiment `energy`.
pub struct Energy;

/// Names of the charts.
const CHARTS: [&str; 4] = [
    "energy-translations",
    "energy-rotations",
    "energy-score",
    "energy-mouth",
];

impl Experiment for Energy {
    fn name(&self) -> &'static str {
        "energy"
    }

    fn about(&self) -> &'static str {
        "Measure the geometric energy of pegs and holes after Behandish & Ilieş 2015: its wells, their bias, and what it does above the mouth"
    }

    fn quick(&self) -> &'static str {
        "a lattice of 2.5 mm"
    }

    fn rows(&self) -> Vec<String> {
        vec!["energy".into()]
    }

    fn charts(&self) -> Vec<String> {
        CHARTS.map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let step = STEPS_MM[usize::from(form.quick)];
        let turned = DMat3::from_axis_angle(TURN_ABOUT.normalize(), TURN_DEG.to_radians());
        let mut entries: Vec<Entry> = Vec::new();
        let mut stacks: [Vec<Chart>; 4] = Default::default();
        for section in Section::ALL {
            let [block, peg] = section.shapes()?;
            let [block, peg] = [block, peg].map(|shape| Density::new(&shape, Kernel::default()));
            let all = Pair::new(&block, &peg, [step, MARGIN_MM], turned, 1.0);
            let fewer = STRONGEST.map(|count| all.strongest(count));
            let all = Measured::new(all);
            for (stack, chart) in stacks.iter_mut().zip(charts(&all, section)) {
                stack.push(chart);
            }
            for measured in std::iter::once(all).chain(fewer.map(Measured::new)) {
                for depth in [DEPTH, 0.5 * DEPTH] {
                    let entry = measured.entry(section, depth);
                    report(&entry);
                    entries.push(entry);
                }
            }
        }
        let findings = Findings::default().rows("energy", &entries)?;
        Ok((CHARTS.into_iter().zip(stacks))
            .fold(findings, |findings, (name, stack)| findings.stack(name, stack)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_value_and_the_convex_part_of_a_known_function() {
        let of = |x: f64| -(-(x - 0.25) * (x - 0.25)).exp();
        assert!((least_at(&of, 1.0) - 0.25).abs() < 1e-6);
        // Convex between its inflections, 1/√2 to either side of the minimum.
        let width = convex(&of, 1e-3, 10.0);
        assert!((width - 2.0f64.sqrt()).abs() < 5e-3, "{width}");
    }
}
