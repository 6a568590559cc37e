//! Files and processes: what the program must not destroy, and what it refuses to read, by the program itself.

use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use super::{Plan, Row};
use crate::LabError;

/// Longest a refusal may take, s.
const REFUSAL_S: f64 = 5.0;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let place = tempfile::tempdir().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })?;
    let text = std::fs::read_to_string(plan.pair).map_err(|source| LabError::Unreadable {
        path: plan.pair.to_owned(),
        source,
    })?;
    let (kept, tried) = outputs(plan.program, place.path(), &text)?;
    out(Row::exactly(
        format!("outputs refused that would have destroyed something, of {tried}"),
        f64::from(kept),
        "outputs",
        f64::from(tried),
    ));
    for (what, text) in [
        ("an assembly of 2²⁴ parts", bomb(&text)),
        ("a coordinate of 1e308", huge(&text)),
    ] {
        let took = refusal(plan.program, place.path(), text)?;
        out(Row::at_most(
            format!("{what} refused in one line after (infinite: not refused)"),
            took,
            "s",
            REFUSAL_S,
        ));
    }
    Ok(())
}

/// How many of the dangerous outputs are refused with everything left as it was, and how many there are.
fn outputs(program: &Path, place: &Path, text: &str) -> Result<(u32, u32), LabError> {
    let write = |name: &str, bytes: &[u8]| {
        let path = place.join(name);
        std::fs::write(&path, bytes).map_err(|source| LabError::Unwritable { path, source })
    };
    write("x.step", text.as_bytes())?;
    write("victim", b"precious")?;
    let mut cases = vec![("x.step", true), ("victim", false)];
    #[cfg(unix)]
    {
        let made = std::os::unix::fs::symlink("victim", place.join("link"))
            .and_then(|()| std::fs::hard_link(place.join("x.step"), place.join("hard.step")));
        made.map_err(|source| LabError::Unwritable {
            path: place.to_owned(),
            source,
        })?;
        cases.extend([("link", true), ("hard.step", true), ("/dev/null", true)]);
    }
    let mut kept = 0;
    for &(name, force) in &cases {
        let mut command = Command::new(program);
        command
            .current_dir(place)
            .args(["bake", "x.step", "--cell", "2", "-o", name]);
        command.args(force.then_some("--force"));
        let output = run(command)?;
        let same = |name: &str, bytes: &[u8]| std::fs::read(place.join(name)).is_ok_and(|now| now == bytes);
        let whole = same("x.step", text.as_bytes()) && same("victim", b"precious");
        kept += u32::from(whole && is_refusal(&output));
    }
    Ok((kept, u32::try_from(cases.len()).unwrap_or(u32::MAX)))
}

/// Seconds until `text` is refused; infinite when it is not within a multiple of the bound.
fn refusal(program: &Path, place: &Path, text: Option<String>) -> Result<f64, LabError> {
    let Some(text) = text else {
        return Ok(f64::INFINITY);
    };
    let path = place.join("refused.step");
    std::fs::write(&path, text).map_err(|source| LabError::Unwritable {
        path: path.clone(),
        source,
    })?;
    let begun = Instant::now();
    let mut command = Command::new(program);
    // Its own limit ends what would not be refused.
    command.args(["inspect", "--timeout", "20"]).arg(&path);
    let output = run(command)?;
    let words = String::from_utf8_lossy(&output.stderr).contains("not read within");
    let took = begun.elapsed();
    Ok(
        if is_refusal(&output) && !words && took < Duration::from_secs(20) {
            took.as_secs_f64()
        } else {
            f64::INFINITY
        },
    )
}

fn run(mut command: Command) -> Result<Output, LabError> {
    command.output().map_err(|source| LabError::Program {
        program: command.get_program().to_string_lossy().into_owned(),
        source,
    })
}

/// Exit code 2 and one line.
fn is_refusal(output: &Output) -> bool {
    output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).lines().count() == 1
}

/// The text with its first coordinate at 1e308.
fn huge(text: &str) -> Option<String> {
    let start = text.find("CARTESIAN_POINT('',(")? + "CARTESIAN_POINT('',(".len();
    let end = start + text[start..].find(',')?;
    Some(format!("{}1.E308{}", &text[..start], &text[end..]))
}

/// The text with its first product placed twice in an assembly, that twice in the next, 24 times over.
fn bomb(text: &str) -> Option<String> {
    let number = |before: &str| -> Option<u64> {
        let at = text.find(before)?;
        let start = text[..at].rfind('#')?;
        text[start + 1..at]
            .trim()
            .trim_end_matches('=')
            .trim()
            .parse()
            .ok()
    };
    let mut child = number("PRODUCT_DEFINITION(")?;
    let mut next = 1 + text
        .lines()
        .filter_map(|line| {
            line.strip_prefix('#')?
                .split(['=', ' '])
                .next()?
                .parse::<u64>()
                .ok()
        })
        .max()?;
    let mut data = String::new();
    for _ in 0..24 {
        let parent = next;
        data += &format!("#{parent}=PRODUCT_DEFINITION('','',$,$);\n");
        for id in [parent + 1, parent + 2] {
            data += &format!("#{id}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#{parent},#{child},$);\n");
        }
        child = parent;
        next += 3;
    }
    let end = text.rfind("ENDSEC;")?;
    Some(format!("{}{data}{}", &text[..end], &text[end..]))
}
