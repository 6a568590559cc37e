//! Help texts, in the shape of clap's, so that the tidy check reads ours and the program's alike.

struct Command {
    name: &'static str,
    what: &'static str,
    arguments: &'static str,
    options: &'static [(&'static str, &'static str)],
}

const YES: (&str, &str) = (
    "--yes",
    "Install what is missing without a question (CI=true says the same, and so does a missing terminal)",
);
const NO_INSTALL: (&str, &str) = ("--no-install", "Install nothing: say what is missing and stop");

const COMMANDS: &[Command] = &[
    Command {
        name: "setup",
        what: "Check what is missing on this machine and install only that",
        arguments: "",
        options: &[YES, NO_INSTALL],
    },
    Command {
        name: "demo",
        what: "Run the sample insertion, in a window or with --headless; other arguments go to `mortise demo`",
        arguments: "[ARGUMENTS OF mortise demo]...",
        options: &[
            YES,
            NO_INSTALL,
            ("--headless", "Without a window: print the result"),
            ("--json", "Print the result as one JSON object"),
            (
                "--rig <RIG>",
                "sim, emulated or a serial port; emulated when QEMU is there, else sim",
            ),
        ],
    },
    Command {
        name: "test",
        what: "Everything CI runs, in order; stops at the first failing step",
        arguments: "",
        options: &[
            YES,
            NO_INSTALL,
            ("--list", "Name the steps and stop"),
            ("--only <STEP,...>", "Run these steps alone"),
            ("--from <STEP>", "Start at this step"),
        ],
    },
    Command {
        name: "figures",
        what: "Measure the figures NAME and write them to docs/figures/NAME.md",
        arguments: "[NAME]...",
        options: &[
            ("--quick", "The shorter form that CI runs"),
            ("--check", "Compare what README and docs say with the quick form"),
            (
                "--renew",
                "Make anew what is stale in docs/figures, or NAMEs of it, and say how long each took",
            ),
            (
                "--record",
                "Take NAMEs in docs/figures, made by hand, for what is made now",
            ),
            (
                "--claim",
                "Claim what is measured; else claims are kept, and only those of new rows added",
            ),
        ],
    },
    Command {
        name: "fuzz",
        what: "Random bytes, guided by coverage, for what reads frames, scenes, rigs and STEP files; all of them, or TARGET",
        arguments: "[TARGET]",
        options: &[
            ("--minutes <N>", "How long each runs; 1 by default"),
            ("--json", "Print the result as rows of figures"),
        ],
    },
    Command {
        name: "firmware",
        what: "Build the firmware of every board, or of BOARD, and print its flash and RAM use",
        arguments: "[BOARD]",
        options: &[],
    },
    Command {
        name: "tidy",
        what: "Check that docs name what exists, that files are short, that layers hold and that no modules need each other",
        arguments: "",
        options: &[],
    },
];

/// The text of `cargo xtask --help`.
pub fn overview() -> String {
    let mut text =
        String::from("Set-up, demo, tests, figures\n\nUsage: cargo xtask <COMMAND>\n\nCommands:\n");
    for command in COMMANDS {
        text.push_str(&format!("  {:<9} {}\n", command.name, command.what));
    }
    text.push_str(
        "\nOptions:\n  -h, --help  Print help; `cargo xtask <COMMAND> --help` prints a command's own\n",
    );
    text
}

/// The text of `cargo xtask NAME --help`; `None` if there is no such command.
pub fn of(name: &str) -> Option<String> {
    let command = COMMANDS.iter().find(|command| command.name == name)?;
    let mut text = format!(
        "{}\n\nUsage: cargo xtask {name} [OPTIONS] {}\n",
        command.what, command.arguments
    );
    text.push_str("\nOptions:\n");
    for (option, what) in command.options {
        text.push_str(&format!("      {option:<18} {what}\n"));
    }
    text.push_str("  -h, --help             Print help\n");
    Some(text)
}
