//! Contacts of the shared test parts compared with independent results: `expected.json`, written by an independent program, and counts from other
//! systems' exports of the same assemblies.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use mortise_brep::load_step;
use mortise_mating::{Contact, Tolerances, identify};
use serde::Deserialize;

use crate::LabError;

/// Number of patches by (kind, part, part), the names in order.
type Pairs = BTreeMap<(String, String, String), usize>;

/// The motor, whose counts are also known from Iacob et al. 2008.
pub const MOTOR: &str = "05_motor/motor_flat.step";
/// The fixture of many parts.
pub const FIXTURE: &str = "real/o2ac_fixture_diagonal.step";
/// The flat motor in a spelling that the checker's own reader does not recognise.
const MOTOR_SPELT_OTHERWISE: &str = "08_hard/ok_comments_before_equals.step";

/// Assemblies with known numbers of planar and cylindrical pairs, and no other pairs.
pub const COUNTED: [(&str, usize, usize); 5] = [
    (MOTOR, 14, 21),
    ("real/as1-oc-214.stp", 16, 22),
    ("real/chrono_assembly.stp", 1, 1),
    (FIXTURE, 10, 1),
    ("real/dn_flex_assembly.step", 1, 6),
];

/// Result of finding the contacts of one file.
#[derive(Clone, Debug)]
pub struct Checked {
    /// Path below the folder of test parts.
    pub file: String,
    /// Pairs of parts in contact, counted for each kind separately.
    pub contacts: usize,
    /// Difference from the expected contacts; `None` when there is none.
    pub wrong: Option<String>,
}

/// Entry of `expected.json` for one file.
#[derive(Clone, Deserialize)]
struct Expected {
    parts: Vec<String>,
    contacts: Vec<(String, String, String, usize)>,
}

/// Finds the contacts of every file that `expected.json` in `cad` lists and compares them pair by pair.
///
/// # Errors
/// `Unreadable` when the list cannot be read.
pub fn expected(cad: &Path) -> Result<Vec<Checked>, LabError> {
    let path = cad.join("expected.json");
    let unreadable = |source| LabError::Unreadable {
        path: path.clone(),
        source,
    };
    let text = std::fs::read_to_string(&path).map_err(unreadable)?;
    let mut all: BTreeMap<String, Expected> =
        serde_json::from_str(&text).map_err(|error| unreadable(error.into()))?;
    if let Some(motor) = all.get(MOTOR).cloned()
        && let Some(odd) = all.get_mut(MOTOR_SPELT_OTHERWISE)
        && odd.parts.is_empty()
    {
        *odd = motor;
    }
    Ok(all
        .iter()
        .map(|(file, expected)| {
            let (contacts, wrong) = match differs(&cad.join(file), expected) {
                Ok((contacts, wrong)) => (contacts, wrong),
                Err(error) => (0, Some(format!("was refused: {error}"))),
            };
            Checked {
                file: file.clone(),
                contacts,
                wrong,
            }
        })
        .collect())
}

fn differs(path: &Path, expected: &Expected) -> Result<(usize, Option<String>), LabError> {
    let model = load_step(path)?;
    // The checker's names, some of which are not decoded; the parts are in the same order.
    let names: Vec<&str> = (expected.parts.iter())
        .map(|path| path.rsplit('/').next().unwrap_or(path))
        .collect();
    if names.len() != model.parts.len() {
        let wrong = format!("has {} parts, expected {}", model.parts.len(), names.len());
        return Ok((0, Some(wrong)));
    }
    let wanted: Pairs = (expected.contacts.iter())
        .map(|(kind, a, b, count)| ((kind.clone(), a.clone(), b.clone()), *count))
        .collect();
    let found = pairs(&names, &identify(&model, &Tolerances::default()));
    let wrong = (found != wanted).then(|| format!("has {found:?}, expected {wanted:?}"));
    Ok((wanted.len(), wrong))
}

fn pairs(names: &[&str], contacts: &[Contact]) -> Pairs {
    let mut pairs = Pairs::new();
    for contact in contacts {
        let mut of = contact.parts.map(|part| names[part].to_owned());
        of.sort();
        let [a, b] = of;
        *pairs.entry((contact.kind.name().into(), a, b)).or_default() += contact.count;
    }
    pairs
}

/// Number of contacts of an assembly, and the time to find them.
#[derive(Clone, Copy, Debug)]
pub struct Counted {
    /// Parts.
    pub parts: usize,
    /// Planar pairs.
    pub planar: usize,
    /// Cylindrical pairs.
    pub cylindrical: usize,
    /// Pairs of other kinds.
    pub others: usize,
    /// Time to find them, after reading, s.
    pub seconds: f64,
    /// Largest distance of a recognised surface from its spline, mm.
    pub fit_mm: f64,
}

/// Finds the contacts of one file.
///
/// # Errors
/// `Brep`.
pub fn count(path: &Path) -> Result<Counted, LabError> {
    let model = load_step(path)?;
    let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
    let start = Instant::now();
    let contacts = identify(&model, &Tolerances::default());
    let seconds = start.elapsed().as_secs_f64();
    let pairs = pairs(&names, &contacts);
    let of = |kind: &str| pairs.keys().filter(|key| key.0 == kind).count();
    let (planar, cylindrical) = (of("planar"), of("cylindrical"));
    Ok(Counted {
        parts: model.parts.len(),
        planar,
        cylindrical,
        others: pairs.len() - planar - cylindrical,
        seconds,
        fit_mm: contacts.iter().map(|contact| contact.fit_mm).fold(0.0, f64::max),
    })
}
