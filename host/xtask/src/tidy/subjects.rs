//! Subjects of commits are in the imperative: “Add …”, not “Added …”, “Figures: …” or “The …”.
//!
//! The first word must be among [`VERBS`]: the form of an English word alone does not say whether it is a verb. A new verb is added there.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use super::finding::Finding;
use crate::shell;

/// Commits checked, from the newest on, merges left out. Older ones are not all in the imperative, and cannot be changed.
const LAST: &str = "-200";

/// First words of subjects.
const VERBS: &[&str] = &[
    "Accept",
    "Add",
    "Adjust",
    "Adopt",
    "Advance",
    "Align",
    "Allow",
    "Answer",
    "Apply",
    "Ask",
    "Avoid",
    "Bake",
    "Ban",
    "Begin",
    "Bind",
    "Bound",
    "Build",
    "Bump",
    "Cache",
    "Call",
    "Carry",
    "Change",
    "Chart",
    "Check",
    "Choose",
    "Claim",
    "Clarify",
    "Clean",
    "Clear",
    "Close",
    "Collect",
    "Combine",
    "Compare",
    "Compute",
    "Connect",
    "Convert",
    "Copy",
    "Correct",
    "Count",
    "Cover",
    "Create",
    "Cull",
    "Cut",
    "Declare",
    "Define",
    "Delete",
    "Derive",
    "Describe",
    "Detect",
    "Disable",
    "Disconnect",
    "Divide",
    "Document",
    "Draw",
    "Drive",
    "Drop",
    "Enable",
    "End",
    "Ensure",
    "Enumerate",
    "Evaluate",
    "Exclude",
    "Expand",
    "Expect",
    "Explain",
    "Export",
    "Extend",
    "Extract",
    "Fail",
    "Fill",
    "Filter",
    "Find",
    "Fit",
    "Fix",
    "Follow",
    "Format",
    "Generate",
    "Give",
    "Group",
    "Guard",
    "Handle",
    "Hide",
    "Hold",
    "Ignore",
    "Implement",
    "Import",
    "Improve",
    "Include",
    "Increase",
    "Inline",
    "Install",
    "Introduce",
    "Join",
    "Judge",
    "Keep",
    "Lay",
    "Leave",
    "Let",
    "Limit",
    "Link",
    "List",
    "Load",
    "Lock",
    "Look",
    "Lower",
    "Make",
    "Map",
    "Mark",
    "Measure",
    "Mend",
    "Merge",
    "Move",
    "Name",
    "Note",
    "Offer",
    "Open",
    "Order",
    "Parse",
    "Part",
    "Pass",
    "Pin",
    "Place",
    "Plan",
    "Play",
    "Prefer",
    "Prepare",
    "Press",
    "Prevent",
    "Print",
    "Probe",
    "Prove",
    "Provide",
    "Publish",
    "Push",
    "Put",
    "Quote",
    "Raise",
    "Rate",
    "Read",
    "Record",
    "Reduce",
    "Refactor",
    "Refuse",
    "Reject",
    "Release",
    "Remove",
    "Rename",
    "Renew",
    "Reorder",
    "Repair",
    "Repeat",
    "Replace",
    "Report",
    "Require",
    "Reserve",
    "Reset",
    "Resolve",
    "Restore",
    "Restrict",
    "Return",
    "Reuse",
    "Revert",
    "Rewrite",
    "Round",
    "Run",
    "Sample",
    "Save",
    "Say",
    "Scale",
    "Search",
    "See",
    "Send",
    "Separate",
    "Serve",
    "Set",
    "Share",
    "Shorten",
    "Show",
    "Sign",
    "Simplify",
    "Skip",
    "Sort",
    "Speed",
    "Split",
    "Start",
    "State",
    "Step",
    "Stop",
    "Store",
    "Strike",
    "Support",
    "Swap",
    "Switch",
    "Take",
    "Tell",
    "Test",
    "Tidy",
    "Treat",
    "Trim",
    "Try",
    "Turn",
    "Unify",
    "Update",
    "Upgrade",
    "Use",
    "Validate",
    "Verify",
    "Wait",
    "Warn",
    "Widen",
    "Word",
    "Wrap",
    "Write",
];

/// Subjects of the last commits that do not begin with a verb in the imperative. None where the sources come without their history.
///
/// # Errors
/// When git cannot list the commits.
pub fn check(root: &Path) -> Result<Vec<Finding>> {
    if !root.join(".git").exists() || shell::find_program("git").is_none() {
        return Ok(Vec::new());
    }
    let mut log = Command::new("git");
    log.current_dir(root)
        .args(["log", "--no-merges", LAST, "--format=%h %s"]);
    Ok(shell::read(&mut log)?.lines().filter_map(complaint).collect())
}

/// What is wrong with a commit, given as its number and subject.
fn complaint(line: &str) -> Option<Finding> {
    let (number, subject) = line.split_once(' ').unwrap_or((line, ""));
    let first = subject
        .split(' ')
        .next()
        .unwrap_or_default()
        .trim_end_matches(',');
    (!VERBS.contains(&first)).then(|| Finding {
        file: format!("commit {number}").into(),
        line: 0,
        what: format!(
            "\"{first}\" is not among the verbs that begin a subject: write it in the imperative, or add the verb to host/xtask/src/tidy/subjects.rs"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subject_begins_with_a_verb_in_the_imperative() {
        for subject in ["Add a row", "Press, slide and roll bars", "Note why"] {
            assert_eq!(complaint(&format!("0123abc {subject}")), None, "{subject}");
        }
        for subject in [
            "Added a row",
            "Adding a row",
            "Docs: add a row",
            "A row",
            "Figures of contact",
            "add a row",
            "",
        ] {
            let found = complaint(&format!("0123abc {subject}")).expect(subject);
            assert_eq!(found.file, Path::new("commit 0123abc"), "{subject}");
        }
    }

    #[test]
    fn verbs_are_sorted_and_unlike() {
        assert!(VERBS.is_sorted_by(|a, b| a < b));
    }
}
