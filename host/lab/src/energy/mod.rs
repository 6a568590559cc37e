//! The geometric energy of a peg and its hole (Behandish & Ilieş 2015) in six degrees of freedom: figs. 5 and 6 repeated, and where the minimum is.
//!
//! Three sections at exact fit (`sections`), the kernel's weights as in the paper (λ₂/λ₁ = 3), σ = 0.2. The peg's lattice is turned by 17° so that no
//! symmetry hides an error. Energies are given as shares of the well's depth at the fit.
//!
//! Measured besides: how far the minimum is off the fit, seated and half in, with all samples, with the strongest alone, and in the form that a board takes; how
//! wide the well is (the paper's diameter of a constraint: the convex part around the minimum) and that it is the only one; and what the energy does sideways
//! above the mouth, which the paper does not show. Fig. 7, the force over time, is in `felt`.

pub(crate) mod felt;
mod measured;
pub(crate) mod sections;

use glam::{DMat3, DVec3};
use mortise_energy::{Density, Kernel, Pair};

use self::felt::{CASES, PLAY_MM};
use self::measured::{ABOVE_MM, ANGLE_DEG, ASIDE_MM, Measured, POINTS, SHIFT_MM};
use self::sections::{DEPTH, Section};
use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::experiment::{Experiment, Findings, Form, Report};
use crate::guided::SIM;
use crate::parallel::trials;

pub use self::felt::Row;
pub use self::measured::Entry;

/// Steps of the lattices, mm: in full and in the quick form; and how far they extend beyond the solids.
const STEPS_MM: [f64; 2] = [1.5, 2.5];
const MARGIN_MM: f64 = 8.0;
/// Turn of the peg's lattice, degrees, about an axis that is none of the solids'.
const TURN_DEG: f64 = 17.0;
const TURN_ABOUT: DVec3 = DVec3::new(1.0, 2.0, 3.0);
/// Numbers of the strongest samples that are tried alone.
const STRONGEST: [usize; 2] = [4000, 1000];
/// Time of each of the paper's tests, s: in full and in the quick form.
const TEST_S: [f64; 2] = [20.0, 4.0];

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

/// The charts of an energy over translations and over rotations.
fn profiles(of: &Measured<'_>, what: &str) -> [Chart; 2] {
    let axes = [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)];
    let lines = [Line::Trace, Line::DashedTrace, Line::Trace];
    let series = |word: &str, most: f64, at: &dyn Fn(DVec3) -> f64| {
        let curves = axes
            .iter()
            .zip(lines)
            .enumerate()
            .map(|(k, ((axis, way), line))| {
                let name = format!("{word} {axis}");
                curve(&name, Look::nth(k), line, -most, most, |x| at(x * *way))
            });
        curves.collect::<Vec<Series>>()
    };
    [
        chart(
            format!("{what}: translations from the fit"),
            "translation, mm",
            series("along", SHIFT_MM, &|by| of.slid(DEPTH, by)),
        ),
        chart(
            format!("{what}: rotations about the middle of the fit"),
            "rotation, degrees",
            series("about", ANGLE_DEG, &|turn| {
                of.turned(DEPTH, turn * 1f64.to_radians())
            }),
        ),
    ]
}

/// The charts of an energy over two translations, and aside above the mouth.
fn planes(of: &Measured<'_>, name: &str) -> [Chart; 2] {
    let heights = [0.0, 10.0, 20.0, 30.0, 35.0];
    let score = heights.into_iter().enumerate().map(|(k, out)| {
        let at = |by: f64| of.slid(DEPTH, DVec3::new(by, 0.0, out));
        let name = format!("{out} mm out");
        curve(&name, Look::nth(k), Line::Trace, -SHIFT_MM, SHIFT_MM, at)
    });
    let mouth = ABOVE_MM.into_iter().enumerate().map(|(k, height)| {
        let at = |by: f64| of.at(DVec3::new(by, 0.0, height), DVec3::ZERO);
        let on_axis = at(0.0);
        let name = format!("{height} mm above");
        curve(&name, Look::nth(k), Line::Trace, -ASIDE_MM, ASIDE_MM, |by| {
            at(by) - on_axis
        })
    });
    [
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
const CHARTS: [&str; 8] = [
    "energy-translations",
    "energy-rotations",
    "energy-score",
    "energy-mouth",
    "energy-board-translations",
    "energy-board-rotations",
    "energy-collision",
    "energy-snap",
];

/// What was found of a section: the charts in the order of [`CHARTS`].
struct Found {
    entries: Vec<Entry>,
    rows: Vec<Row>,
    charts: Vec<Chart>,
}

/// Measures a section.
fn measure(section: Section, quick: bool) -> Result<Found, LabError> {
    let step = STEPS_MM[usize::from(quick)];
    let turned = DMat3::from_axis_angle(TURN_ABOUT.normalize(), TURN_DEG.to_radians());
    let [block, peg] = section.shapes()?;
    let [block, peg] = [block, peg].map(|shape| Density::new(&shape, Kernel::default()));
    let all = Pair::new(&block, &peg, [step, MARGIN_MM], turned, 1.0);
    let fewer = STRONGEST.map(|count| all.strongest(count));
    let (followed, energy) = section.round(0.0)?;
    let (loose, _) = section.round(PLAY_MM)?;

    let name = section.name();
    let published = Measured::published(&all);
    let board = Measured::board(&energy, &followed);
    let mut charts: Vec<Chart> = profiles(&published, name).into();
    charts.extend(planes(&published, name));
    charts.extend(profiles(&board, &format!("{name}, the board's form")));
    let mut rows = Vec::new();
    for (test, clearance_mm) in CASES {
        let exact = clearance_mm == 0.0;
        let followed = if exact { &followed } else { &loose };
        let recordings = test.recordings(TEST_S[usize::from(quick)]);
        let felt = felt::play(followed, test, recordings, 1, &SIM)?;
        rows.push(felt.row(name, clearance_mm));
        if exact {
            charts.push(felt.chart(name));
        }
    }
    let all = std::iter::once(published).chain(fewer.iter().map(Measured::published));
    let entries = all
        .chain([board])
        .flat_map(|measured| [DEPTH, 0.5 * DEPTH].map(|depth| measured.entry(section, depth)));
    Ok(Found {
        entries: entries.collect(),
        rows,
        charts,
    })
}

impl Experiment for Energy {
    fn name(&self) -> &'static str {
        "energy"
    }

    fn about(&self) -> &'static str {
        "Measure the geometric energy of pegs and holes after Behandish & Ilieş 2015: its wells, their bias, what it does above the mouth, and the force that is felt"
    }

    fn quick(&self) -> &'static str {
        "a lattice of 2.5 mm, and tests of 4 s"
    }

    fn rows(&self) -> Vec<String> {
        vec!["energy".into(), "energy-felt".into()]
    }

    fn charts(&self) -> Vec<String> {
        CHARTS.map(String::from).into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let found = trials(Section::ALL.len(), |index| {
            measure(Section::ALL[index], form.quick)
        })?;
        let (mut entries, mut rows) = (Vec::new(), Vec::new());
        let mut stacks: [Vec<Chart>; CHARTS.len()] = Default::default();
        for section in found {
            section.entries.iter().for_each(|entry| report(entry));
            section.rows.iter().for_each(|row| report(row));
            entries.extend(section.entries);
            rows.extend(section.rows);
            for (stack, chart) in stacks.iter_mut().zip(section.charts) {
                stack.push(chart);
            }
        }
        let findings = Findings::default()
            .rows("energy", &entries)?
            .rows("energy-felt", &rows)?;
        Ok((CHARTS.into_iter().zip(stacks))
            .fold(findings, |findings, (name, stack)| findings.stack(name, stack)))
    }
}
