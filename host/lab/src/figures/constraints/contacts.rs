//! Recognition of touching faces: the contacts of the shared parts, and the time to find them.

use crate::figures::{Plan, Row};
use crate::{LabError, contacts, corpus};

const ABSENT: &str = "the shared parts are not there; set MORTISE_SHARED to their folder";
/// Rows that need the shared parts.
const ROWS: usize = 2 + contacts::COUNTED.len();

/// Every row about contacts.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let Some(cad) = corpus::folder() else {
        out(Row::skipped(
            format!("contacts of the shared parts and of assemblies by others: {ROWS} rows"),
            ABSENT,
        ));
        return Ok(());
    };
    let checked = contacts::expected(&cad)?;
    for one in &checked {
        if let Some(wrong) = &one.wrong {
            eprintln!("{} {wrong}", one.file);
        }
    }
    let right = |of: &dyn Fn(&contacts::Checked) -> bool| {
        let all: Vec<_> = checked.iter().filter(|one| of(one)).collect();
        let right = all.iter().filter(|one| one.wrong.is_none()).count();
        (right as f64, all.len() as f64)
    };
    let (files, all) = right(&|_| true);
    let found: usize = checked.iter().map(|one| one.contacts).sum();
    out(Row::exactly(
        format!(
            "contacts of every file that reads, {found} in all, the air-gap motor among them: as expected pair by pair"
        ),
        files,
        "files",
        all,
    ));
    let (none, all) = right(&|one| one.contacts == 0);
    out(Row::exactly(
        "no contact in the exploded motor and all other files whose parts are apart",
        none,
        "files",
        all,
    ));
    for (file, planar, cylindrical) in contacts::COUNTED {
        let found = contacts::count(&cad.join(file))?;
        out(Row::same(
            format!(
                "{file}, {} parts: contacts (recognised surfaces within {:.1e} mm)",
                found.parts, found.fit_mm
            ),
            &kinds(found.planar, found.cylindrical, found.others),
            &kinds(planar, cylindrical, 0),
        ));
        let most = match file {
            contacts::MOTOR => 1.0,
            contacts::FIXTURE => 3.0,
            _ => continue,
        };
        let what = format!("{file}: time for them after reading");
        out(if plan.quick {
            // A time has a bound only where a person runs it, not in a test that other programs may slow down.
            Row::reported(what, found.seconds, "s").varies()
        } else {
            Row::at_most(what, found.seconds, "s", most).varies()
        });
    }
    Ok(())
}

fn kinds(planar: usize, cylindrical: usize, others: usize) -> String {
    format!("{planar} planar, {cylindrical} cylindrical, {others} others")
}
