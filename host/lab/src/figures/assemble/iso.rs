//! Round fits of ISO 286-1 in H7 bores, random members of their tolerance zones: what connects them, and the clearance or overlap that is stated, against the
//! diameters that were drawn.

use std::time::Duration;

use fastrand::Rng;
use mortise_task::report::{self, Sense};
use mortise_task::{Assembly, sequence};

use super::assembly_file::refused;
use crate::LabError;
use crate::figures::Row;
use crate::fit::Fit;

/// Largest nominal diameter of a step, mm; IT6 and IT7, the fundamental deviations of g and f (upper, of the shaft) and p (lower), µm.
const STEPS: [(f64, f64, f64, f64, f64, f64); 5] = [
    (6.0, 8.0, 12.0, -4.0, -10.0, 12.0),
    (10.0, 9.0, 15.0, -5.0, -13.0, 15.0),
    (18.0, 11.0, 18.0, -6.0, -16.0, 18.0),
    (30.0, 13.0, 21.0, -7.0, -20.0, 22.0),
    (50.0, 16.0, 25.0, -9.0, -25.0, 26.0),
];
/// Fits drawn of each step and zone.
const EACH: usize = 2;
const SEED: u64 = 286;
/// Difference of a stated gap from the drawn one, µm.
const OFF_UM: f64 = 0.1;
/// Overlap below which a fit is not pressed, µm: that of a contact.
const PRESSED_UM: f64 = 1.0;

/// A fit, and its gap on the radius, µm.
fn drawn(
    random: &mut Rng,
    (nominal, it6, it7, g, f, p): (f64, f64, f64, f64, f64, f64),
    zone: char,
) -> (Fit, f64) {
    let upper = match zone {
        'h' => 0.0,
        'g' => g,
        'f' => f,
        _ => p + it6,
    };
    // The file has nanometres.
    let um = |value: f64| (value * 1e3).round() / 1e3;
    let (hole, shaft) = (um(it7 * random.f64()), um(upper - it6 * random.f64()));
    let fit = Fit {
        width_mm: 2.0 * nominal,
        height_mm: 1.5 * nominal,
        hole_mm: nominal + 1e-3 * hole,
        peg_mm: nominal + 1e-3 * shaft,
        length_mm: 2.0 * nominal,
        engaged_mm: nominal,
    };
    (fit, 0.5 * (hole - shaft))
}

/// Measures the rows.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let mut random = Rng::with_seed(SEED);
    let mut pressed = Tally::default();
    let mut clear = Tally::default();
    for zone in ['h', 'g', 'f', 'p'] {
        for step in STEPS {
            for _ in 0..EACH {
                let (fit, gap_um) = drawn(&mut random, step, zone);
                let tally = if gap_um < -PRESSED_UM {
                    &mut pressed
                } else {
                    &mut clear
                };
                tally.add(&fit, gap_um)?;
            }
        }
    }
    clear.rows("H7/h6, g6 and f7 with random diameters", "inserted", out);
    pressed.rows("H7/p6 with random diameters", "pressed", out);
    Ok(())
}

#[derive(Default)]
struct Tally {
    count: usize,
    apart: usize,
    kinds: Vec<&'static str>,
    off_um: f64,
}

impl Tally {
    fn add(&mut self, fit: &Fit, gap_um: f64) -> Result<(), LabError> {
        let file = fit.file()?;
        let model = mortise_brep::load_step(file.path())?;
        let assembly = Assembly::new(model).map_err(|error| refused(file.path(), &error))?;
        let found = sequence::disassemble(&assembly, &[0, 1], Duration::from_secs(10));
        let report = report::sequence(&assembly, &found, Sense::Assembly);
        self.count += 1;
        self.apart += usize::from(report.verdict == "assembles");
        let connections = report::connections(&assembly);
        let kinds = connections.iter().flat_map(|one| one.kinds.first());
        self.kinds.extend(kinds.map(|kind| kind.kind().name.as_str()));
        // On the way a pressed pair overlaps as it does in place.
        let stated = (report.steps.first()).and_then(|step| match step.overlap_um {
            Some(overlap) if overlap > 0.0 => Some(-overlap),
            _ => step.clearance_um,
        });
        // What is not stated is off by any bound.
        let off_um = stated.map_or(f64::INFINITY, |stated| (stated - gap_um).abs());
        self.off_um = self.off_um.max(off_um);
        Ok(())
    }

    fn rows(&self, what: &str, kind: &str, out: &mut dyn FnMut(Row)) {
        let what = format!("{} fits {what}", self.count);
        out(Row::exactly(
            format!("{what}: go together"),
            self.apart as f64,
            "assemblies",
            self.count as f64,
        ));
        out(Row::exactly(
            format!("{what}: {kind}"),
            self.kinds.iter().filter(|found| **found == kind).count() as f64,
            "assemblies",
            self.count as f64,
        ));
        out(Row::at_most(
            format!("{what}: stated gap beside the drawn one"),
            self.off_um,
            "µm",
            OFF_UM,
        ));
    }
}
