//! Artefacts in `docs/figures`: how each is made and which sources it depends on; `docs/figures/manifest.json` records the sources of each.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use tinyjson::JsonValue;

use super::sources::{self, Fnv};

/// Folder of artefacts, from the root.
pub const FOLDER: &str = "docs/figures";
/// Manifest of the sources that artefacts were made from, from the root.
pub const MANIFEST: &str = "docs/figures/manifest.json";

/// Files that one command makes.
pub struct Artefact {
    /// Name: a page has the name of its table; other files have this name, or begin with it and `-`.
    pub name: &'static str,
    /// How it is made.
    pub made: Made,
    /// Source files and folders, from the root; of the laboratory and of scenarios only those that measure, the files they use follow
    /// (see [`sources::hash`]).
    sources: &'static [&'static [&'static str]],
}

/// How an artefact is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// A page: `cargo xtask figures NAME`.
    Page { quick: bool },
    /// A sweep: `mortise-lab NAME --out docs/figures`.
    Sweep { quick: bool },
    /// A page with its sweep: `cargo xtask NAME --write`, which installs packages and is therefore started by a person.
    Compared,
    /// By a person at the window.
    ByHand,
}

/// The force law, and the scenes on which it acts. The board's control plane is excluded where only a tick's force and cost are measured: it runs
/// beside the tick.
const LAW: &[&str] = &[
    "protocol/src/image",
    "firmware/haptics/src",
    "host/bake/src",
    "host/brep/src",
];
/// The rest of the closed loop: control plane, rig, recognition and guidance.
const LOOP: &[&str] = &[
    "protocol/src",
    "firmware/mechanism/src",
    "firmware/app/src",
    "firmware/simulation/src",
    "firmware/boards/common/src",
    "firmware/boards/mps2/src",
    "firmware/boards/mps2-an500/src",
    "host/rig/src",
    "host/mating/src",
    "host/guide/src",
    "hil-tests/scenarios",
    "host/app/samples",
];
const CHART: &[&str] = &["host/lab/src/chart", "host/lab/src/table.rs"];
/// A scenario played and measured.
const SCENARIO: &[&str] = &["host/scenario/src/run.rs", "host/scenario/src/scene.rs"];
const TRIAL: &[&str] = &["host/lab/src/clearance.rs"];
const GUIDED: &[&str] = &["host/lab/src/guided.rs", "host/mating/src", "host/guide/src"];
/// A pair of parts, its fit with the way in, and its geometric energy.
const FOLLOWED: &[&str] = &[
    "host/fit/src",
    "host/mating/src",
    "host/guide/src",
    "host/energy/src",
];

/// Every command that writes to `docs/figures`.
pub const ARTEFACTS: &[Artefact] = &[
    Artefact {
        name: "end-to-end",
        made: Made::Page { quick: false },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            TRIAL,
            &[
                "host/lab/src/contact_law.rs",
                "host/lab/src/figures/end_to_end.rs",
                "host/lab/src/figures/link.rs",
                "host/lab/src/figures/parts.rs",
            ],
        ],
    },
    Artefact {
        name: "contact",
        made: Made::Page { quick: true },
        sources: &[
            LAW,
            SCENARIO,
            TRIAL,
            &[
                "host/lab/src/figures/contact",
                "host/lab/src/scene_p.rs",
                "host/scenario/src/probe.rs",
                "host/lab/src/peer.rs",
            ],
        ],
    },
    Artefact {
        name: "constraints",
        made: Made::Page { quick: true },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            TRIAL,
            GUIDED,
            &["host/lab/src/figures/constraints"],
        ],
    },
    Artefact {
        name: "stability",
        made: Made::Page { quick: true },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            TRIAL,
            GUIDED,
            &[
                "host/lab/src/figures/stability",
                "host/lab/src/stability",
                "host/lab/src/endurance",
            ],
        ],
    },
    Artefact {
        name: "promises",
        made: Made::Page { quick: false },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            TRIAL,
            GUIDED,
            &["host/lab/src/figures/promises", "host/app/src/cli"],
        ],
    },
    Artefact {
        name: "plan",
        made: Made::Page { quick: true },
        sources: &[LAW, &["host/lab/src/figures/planning", "host/lab/src/generated"]],
    },
    Artefact {
        name: "assemble",
        made: Made::Page { quick: true },
        sources: &[
            LAW,
            &[
                "host/mating/src",
                "host/task/src",
                "host/words/src",
                "host/lab/src/figures/assemble",
                "host/lab/src/generated",
            ],
        ],
    },
    Artefact {
        name: "guidance",
        made: Made::Page { quick: false },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            FOLLOWED,
            &[
                "host/shapes/src",
                "host/lab/src/figures/guidance",
                "host/lab/src/followed.rs",
            ],
        ],
    },
    Artefact {
        name: "workbench",
        made: Made::Page { quick: false },
        sources: &[
            LAW,
            LOOP,
            SCENARIO,
            &["host/record/src", "host/lab/src/figures/workbench.rs"],
        ],
    },
    Artefact {
        name: "pareto",
        made: Made::Sweep { quick: false },
        sources: &[
            LAW,
            SCENARIO,
            TRIAL,
            CHART,
            &[
                "host/lab/src/pareto.rs",
                "host/lab/src/scene_p.rs",
                "host/scenario/src/probe.rs",
                "host/lab/src/peer.rs",
            ],
        ],
    },
    Artefact {
        name: "clearance",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, CHART],
    },
    Artefact {
        name: "blend",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, GUIDED, CHART, &["host/lab/src/blend.rs"]],
    },
    Artefact {
        name: "energy",
        made: Made::Sweep { quick: false },
        sources: &[
            LAW,
            SCENARIO,
            FOLLOWED,
            CHART,
            &["host/lab/src/energy", "host/lab/src/followed.rs"],
        ],
    },
    Artefact {
        name: "helps",
        made: Made::Sweep { quick: false },
        sources: &[
            LAW,
            SCENARIO,
            FOLLOWED,
            CHART,
            &["host/lab/src/helps.rs", "host/lab/src/followed.rs"],
        ],
    },
    Artefact {
        name: "rate",
        made: Made::Sweep { quick: true },
        sources: &[LAW, SCENARIO, TRIAL, GUIDED, CHART, &["host/lab/src/rate.rs"]],
    },
    Artefact {
        name: "shrink",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, CHART, &["host/lab/src/study"]],
    },
    Artefact {
        name: "feature-size",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, CHART, &["host/lab/src/study"]],
    },
    Artefact {
        name: "hybrid",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, GUIDED, CHART, &["host/lab/src/hybrid.rs"]],
    },
    Artefact {
        name: "stability-maps",
        made: Made::Sweep { quick: false },
        sources: &[LAW, SCENARIO, TRIAL, GUIDED, CHART, &["host/lab/src/stability"]],
    },
    Artefact {
        name: "peers",
        made: Made::Compared,
        sources: &[
            LAW,
            CHART,
            &[
                "host/lab/src/peers",
                "host/lab/src/peer.rs",
                "host/lab/peers",
                "host/lab/src/scene_p.rs",
                "host/scenario/src/probe.rs",
            ],
        ],
    },
    Artefact {
        name: "window",
        made: Made::ByHand,
        sources: &[&["host/app/src/display", "host/app/src/ui", "host/app/src/viewport"]],
    },
];

/// Files in `docs/figures` that people write, or that record the reference of other checks.
const WRITTEN: &[&str] = &["sweeps.md", "claims.json", "manifest.json"];

impl Artefact {
    /// The experiment of `mortise-lab`, and the start of its files' names.
    pub fn experiment(&self) -> &'static str {
        self.name.strip_suffix("-maps").unwrap_or(self.name)
    }

    /// The command, as a person types it.
    pub fn command(&self) -> String {
        let option = |quick: bool| if quick { " --quick" } else { "" };
        match self.made {
            Made::Page { quick } => format!("cargo xtask figures {}{}", self.name, option(quick)),
            Made::Sweep { quick } => format!(
                "mortise-lab {}{} --out {FOLDER} --force",
                self.experiment(),
                option(quick)
            ),
            Made::Compared => format!(
                "cargo xtask {} --write, then cargo xtask figures --record {}",
                self.name, self.name
            ),
            Made::ByHand => format!("by hand, then cargo xtask figures --record {}", self.name),
        }
    }

    /// What makes it anew and records it, as a person types it.
    fn renewal(&self) -> String {
        match self.made {
            Made::Page { .. } | Made::Sweep { .. } => format!("cargo xtask figures --renew {}", self.name),
            Made::Compared | Made::ByHand => self.command(),
        }
    }

    fn owns(&self, file: &str) -> bool {
        let is_page = file.strip_suffix(".md") == Some(self.name);
        match self.made {
            Made::Page { .. } => return is_page,
            Made::Compared if is_page => return true,
            _ => {}
        }
        let stem = file.split('.').next().unwrap_or(file);
        let rest = stem.strip_prefix(self.experiment());
        !file.ends_with(".md") && rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
    }

    /// The artefact's current record: hashes of its sources and of its files.
    ///
    /// # Errors
    /// When a source is missing.
    pub fn state(&self, root: &Path) -> Result<State> {
        let places: Vec<&str> = self.sources.iter().copied().flatten().copied().collect();
        let mut hash = Fnv::default();
        for file in files(root)?.iter().filter(|file| self.owns(file)) {
            hash.add(file.as_bytes());
            hash.add(&std::fs::read(root.join(FOLDER).join(file))?);
        }
        Ok(State {
            sources: sources::hash(root, &places)?,
            files: hash.text(),
        })
    }
}

fn files(root: &Path) -> Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(root.join(FOLDER)).with_context(|| format!("reading {FOLDER}"))? {
        found.push(entry?.file_name().to_string_lossy().into_owned());
    }
    found.sort();
    Ok(found)
}

/// Record of an artefact: its sources and files when it was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Hash of its sources.
    pub sources: String,
    /// Hash of its files.
    pub files: String,
}

/// Records of all artefacts.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Manifest(pub BTreeMap<String, State>);

impl Manifest {
    /// Reads the manifest; an empty one if there is none yet.
    ///
    /// # Errors
    /// When it is malformed.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(MANIFEST);
        if !path.is_file() {
            return Ok(Self::default());
        }
        Self::parse(&std::fs::read_to_string(&path)?)
            .with_context(|| format!("{MANIFEST} is not as `cargo xtask figures --renew` writes it"))
    }

    fn parse(text: &str) -> Result<Self> {
        type Object = HashMap<String, JsonValue>;
        let value: JsonValue = text.parse().map_err(|error| anyhow::anyhow!("{error}"))?;
        let entries: &Object = value.get().context("no object")?;
        let mut manifest = Self::default();
        for (name, entry) in entries {
            let fields: &Object = entry.get().with_context(|| format!("`{name}` is no object"))?;
            let field = |field: &str| {
                let text = fields.get(field).and_then(|value| value.get::<String>().cloned());
                text.with_context(|| format!("`{name}` has no `{field}`"))
            };
            let state = State {
                sources: field("sources")?,
                files: field("files")?,
            };
            manifest.0.insert(name.clone(), state);
        }
        Ok(manifest)
    }

    /// Writes the manifest.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, root: &Path) -> Result<()> {
        std::fs::write(root.join(MANIFEST), self.text()).with_context(|| format!("writing {MANIFEST}"))
    }

    fn text(&self) -> String {
        let command = |name: &str| {
            let artefact = ARTEFACTS.iter().find(|artefact| artefact.name == name);
            artefact.map_or(String::new(), Artefact::command)
        };
        let lines: Vec<String> = (self.0.iter())
            .map(|(name, State { sources, files })| {
                format!("  \"{name}\": {{\"command\": \"{}\", \"sources\": \"{sources}\", \"files\": \"{files}\"}}", command(name))
            })
            .collect();
        format!("{{\n{}\n}}\n", lines.join(",\n"))
    }
}

/// Why an artefact is stale; `None` when it is current.
///
/// # Errors
/// When a source is missing.
pub fn stale(root: &Path, artefact: &Artefact, manifest: &Manifest) -> Result<Option<&'static str>> {
    let Some(kept) = manifest.0.get(artefact.name) else {
        return Ok(Some("was never recorded"));
    };
    let now = artefact.state(root)?;
    Ok(if now.sources != kept.sources {
        Some("is stale: its sources have changed")
    } else if now.files != kept.files {
        Some("is not what its command wrote")
    } else {
        None
    })
}

/// All problems in `docs/figures`, each with the file it concerns: artefacts that are stale or were never recorded, and files that no command makes.
///
/// # Errors
/// When a file cannot be read.
pub fn complaints(root: &Path) -> Result<Vec<(PathBuf, String)>> {
    let manifest = Manifest::read(root)?;
    let mut found = Vec::new();
    for artefact in ARTEFACTS {
        if let Some(why) = stale(root, artefact, &manifest)? {
            let what = format!(
                "`{}` {why}; `{}` makes it anew",
                artefact.name,
                artefact.renewal()
            );
            found.push((PathBuf::from(MANIFEST), what));
        }
    }
    for file in files(root)? {
        if !WRITTEN.contains(&file.as_str()) && !ARTEFACTS.iter().any(|artefact| artefact.owns(&file)) {
            let what = "no command of host/xtask/src/figures/artefacts.rs makes it".to_owned();
            found.push((Path::new(FOLDER).join(file), what));
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_belongs_to_one_command() {
        let root = crate::shell::root().unwrap();
        for file in files(&root).unwrap() {
            let owners = ARTEFACTS.iter().filter(|artefact| artefact.owns(&file)).count();
            let wanted = usize::from(!WRITTEN.contains(&file.as_str()));
            assert_eq!(owners, wanted, "{file}");
        }
    }

    #[test]
    fn sources_of_every_artefact_exist() {
        let root = crate::shell::root().unwrap();
        for artefact in ARTEFACTS {
            artefact.state(&root).unwrap();
        }
    }

    #[test]
    fn what_changed_since_it_was_recorded_is_stale() {
        let root = crate::shell::root().unwrap();
        let artefact = &ARTEFACTS[0];
        let mut manifest = Manifest::default();
        assert!(stale(&root, artefact, &manifest).unwrap().is_some());
        let state = artefact.state(&root).unwrap();
        manifest.0.insert(artefact.name.into(), state.clone());
        assert_eq!(stale(&root, artefact, &manifest).unwrap(), None);
        for changed in [
            State {
                sources: "0".into(),
                ..state.clone()
            },
            State {
                files: "0".into(),
                ..state
            },
        ] {
            manifest.0.insert(artefact.name.into(), changed);
            assert!(stale(&root, artefact, &manifest).unwrap().is_some());
        }
        assert_eq!(Manifest::parse(&manifest.text()).unwrap(), manifest);
    }
}
