//! Project files: what a user has done with a model. Versioned JSON; a part is named by its place in the assembly, not by its number.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use serde::{Deserialize, Serialize};

use super::view::{KeptView, rounded};

/// Version of the file. A change that older programs cannot read increments it.
pub const VERSION: u32 = 1;

/// A project.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Project {
    /// Version of the file.
    #[serde(rename = "mortise-project")]
    pub version: u32,
    /// The model.
    pub model: ModelFile,
    /// Parts that differ from the model's file.
    #[serde(default)]
    pub parts: Vec<KeptPart>,
    /// Groups of parts that move as one.
    #[serde(default)]
    pub groups: Vec<KeptGroup>,
    /// Parts that are locked to the ground; `None`: the largest.
    #[serde(default)]
    pub locked: Option<Vec<PartName>>,
    /// Choices of fits.
    #[serde(default)]
    pub fits: Vec<KeptFit>,
    /// Settings that differ from their defaults.
    #[serde(default)]
    pub settings: Settings,
    /// The chosen rig, as the option `--rig` names it.
    #[serde(default)]
    pub rig: Option<String>,
    /// Keys of the signals in the plots; `None`: those of the start.
    #[serde(default)]
    pub signals: Option<Vec<String>>,
    /// How the model is seen.
    #[serde(default)]
    pub view: Option<KeptView>,
}

/// The model of a project.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelFile {
    /// Path of the STEP file; `None`: the sample.
    pub path: Option<PathBuf>,
    /// SHA-256 of its contents, in hexadecimal digits.
    pub sha256: String,
}

/// Name of a part: its subassemblies and its own, and its number among parts of the same.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PartName {
    /// Names of the subassemblies, outermost first.
    #[serde(default)]
    pub within: Vec<String>,
    /// The part's own name.
    pub name: String,
    /// Number among parts of this name in this place, from 0 in the order of the file.
    #[serde(default)]
    pub number: usize,
}

/// What differs from the model's file in a part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptPart {
    /// Which part.
    pub part: PartName,
    /// Where it is, if it was moved.
    #[serde(default)]
    pub placement: Option<Placement>,
    /// Whether it is hidden.
    #[serde(default)]
    pub hidden: bool,
}

/// Parts that move as one, as they are to one another by their placements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptGroup {
    /// Its name.
    pub name: String,
    /// Its parts.
    pub parts: Vec<PartName>,
}

/// A rigid placement, part to world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// Position, mm.
    pub position_mm: [f64; 3],
    /// Quaternion x, y, z, w.
    pub rotation: [f64; 4],
}

/// The user's choice of a fit of two surfaces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptFit {
    /// The moving part.
    pub moving: PartName,
    /// Surface of the moving part, a number within the model of this hash.
    pub moving_surface: usize,
    /// The other part.
    pub fixed: PartName,
    /// Surface of the other part.
    pub fixed_surface: usize,
    /// Kept in the list, with priority.
    #[serde(default)]
    pub pinned: bool,
    /// Kept from guiding.
    #[serde(default)]
    pub off: bool,
}

/// Settings that differ from their defaults.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// Parameters of the board by name, for each rig on which they were set.
    pub parameters: BTreeMap<String, BTreeMap<String, f32>>,
    /// When fits start to guide, by name.
    pub engage: Option<String>,
    /// Largest guidance force, N.
    pub guide_cap_n: Option<f32>,
    /// Contact method.
    pub method: Option<mortise_bake::Method>,
}

impl Settings {
    /// Number of settings that differ from their defaults.
    pub fn count(&self) -> usize {
        let others = [
            self.engage.is_some(),
            self.guide_cap_n.is_some(),
            self.method.is_some(),
        ];
        let parameters: usize = self.parameters.values().map(BTreeMap::len).sum();
        parameters + others.into_iter().filter(|differs| *differs).count()
    }
}

impl Placement {
    /// The placement of a rigid pose, to the billionth of a millimetre; `None` if it is not finite.
    pub fn of(pose: &DAffine3) -> Option<Self> {
        let rotation = DQuat::from_mat3(&pose.matrix3).normalize();
        (pose.is_finite() && rotation.is_finite()).then(|| Self {
            position_mm: pose.translation.to_array().map(|x| rounded(x, 1e9)),
            rotation: rotation.to_array().map(|x| rounded(x, 1e15)),
        })
    }

    /// The pose, part to world, mm; `None` if it is none.
    pub fn pose(&self) -> Option<DAffine3> {
        let rotation = DQuat::from_array(self.rotation);
        let position = DVec3::from_array(self.position_mm);
        // Far beyond any assembly, and safe in single precision.
        let possible = position.is_finite() && position.length() < 1e9 && rotation.is_finite();
        let length = rotation.length();
        (possible && (0.5..2.0).contains(&length))
            .then(|| DAffine3::from_rotation_translation(rotation.normalize(), position))
    }
}

impl Project {
    /// Reads the contents of a file.
    ///
    /// # Errors
    /// One line without the file's name: what is wrong, and what to do.
    pub fn from_json(bytes: &[u8]) -> anyhow::Result<Self> {
        #[derive(Deserialize)]
        struct Head {
            #[serde(rename = "mortise-project")]
            version: u32,
        }
        let head: Head = serde_json::from_slice(bytes)
            .context("it is not a project file of Mortise, or damaged; open the STEP file instead")?;
        ensure!(
            head.version <= VERSION,
            "it is of a newer version of this program (file version {}, known: {VERSION}); use that one",
            head.version
        );
        let mut read: Self = serde_json::from_slice(bytes)
            .context("the project file is damaged; open the STEP file instead")?;
        read.view = read.view.filter(KeptView::is_sound);
        for part in &read.parts {
            let sound = part.placement.is_none_or(|placement| placement.pose().is_some());
            ensure!(
                sound,
                "the project file is damaged: the placement of {} is none; open the STEP file instead",
                part.part.name
            );
        }
        Ok(read)
    }

    /// The contents of a file.
    pub fn to_json(&self) -> String {
        // Numbers and text only: this cannot fail.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

/// A path as projects name it: absolute, and as well as a file of text can where it is no text.
pub fn absolute(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    path.to_string_lossy().into_owned().into()
}

/// Names of a model's parts, in its order. No two are the same.
pub fn part_names(model: &CadModel) -> Vec<PartName> {
    let mut numbers: BTreeMap<(&[String], &str), usize> = BTreeMap::new();
    (model.parts.iter())
        .map(|part| {
            let number = numbers.entry((&part.path, &part.name)).or_default();
            *number += 1;
            PartName {
                within: part.path.clone(),
                name: part.name.clone(),
                number: *number - 1,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::view::{KeptAcross, KeptSection};
    use super::*;

    fn name(name: &str, number: usize) -> PartName {
        PartName {
            within: vec!["gearbox".into()],
            name: name.into(),
            number,
        }
    }

    fn some() -> Project {
        let pose =
            DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.7), DVec3::new(1.5, -2.0, 80.25));
        Project {
            version: VERSION,
            model: ModelFile {
                path: Some("/parts/gear box.step".into()),
                sha256: "ab".repeat(32),
            },
            parts: vec![
                KeptPart {
                    part: name("peg", 1),
                    placement: Placement::of(&pose),
                    hidden: false,
                },
                KeptPart {
                    part: name("cover", 0),
                    placement: None,
                    hidden: true,
                },
            ],
            groups: vec![KeptGroup {
                name: "peg, cover".into(),
                parts: vec![name("peg", 1), name("cover", 0)],
            }],
            locked: Some(vec![name("cover", 0)]),
            fits: vec![KeptFit {
                moving: name("peg", 1),
                moving_surface: 3,
                fixed: name("cover", 0),
                fixed_surface: 12,
                pinned: true,
                off: false,
            }],
            settings: Settings {
                parameters: BTreeMap::from([("sim".into(), BTreeMap::from([("ForceLimit".into(), 3.5)]))]),
                engage: Some("near".into()),
                guide_cap_n: Some(2.0),
                method: Some(mortise_bake::Method::Occupancy),
            },
            rig: Some("sim".into()),
            signals: Some(vec!["points".into()]),
            view: Some(KeptView {
                target_mm: [1.0, -2.5, 3.25],
                distance_mm: 120.0,
                yaw_rad: -0.9,
                pitch_rad: 0.4,
                orthographic: true,
                see_through: true,
                section: Some(KeptSection {
                    across: KeptAcross::Face {
                        point_mm: [0.0, 0.0, 12.5],
                        normal: [0.0, 0.6, -0.8],
                    },
                    offset_mm: 0.5,
                    flipped: true,
                }),
            }),
        }
    }

    #[test]
    fn a_project_comes_back() {
        let back = Project::from_json(some().to_json().as_bytes()).expect("its own");
        assert_eq!(back, some());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let newer = some()
            .to_json()
            .replace("\"mortise-project\": 1", "\"mortise-project\": 7");
        let no_pose = some().to_json().replace("80.25", "1e300");
        for (bytes, words) in [
            (&b"ISO-10303-21;"[..], "not a project file"),
            (b"{}", "not a project file"),
            (newer.as_bytes(), "newer version"),
            (br#"{"mortise-project": 1}"#, "damaged"),
            (no_pose.as_bytes(), "placement of peg"),
        ] {
            let error = Project::from_json(bytes).expect_err("wrong").to_string();
            assert!(error.contains(words) && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn a_file_from_before_there_were_groups_and_locked_parts_has_none() {
        let mut value = serde_json::to_value(some()).expect("JSON");
        for added in ["groups", "locked"] {
            value.as_object_mut().expect("an object").remove(added);
        }
        let read = Project::from_json(value.to_string().as_bytes()).expect("readable");
        assert_eq!(
            read,
            Project {
                groups: Vec::new(),
                locked: None,
                ..some()
            }
        );
    }

    #[test]
    fn parts_of_the_same_name_are_numbered() {
        let part = |path: &[&str], name: &str| mortise_brep::Part {
            name: name.into(),
            path: path.iter().map(|s| (*s).to_owned()).collect(),
            shape: 0,
            placement: DAffine3::IDENTITY,
            color: None,
        };
        let model = CadModel {
            parts: vec![part(&["a"], "pin"), part(&["b"], "pin"), part(&["a"], "pin")],
            ..CadModel::default()
        };
        let numbers: Vec<usize> = part_names(&model).iter().map(|name| name.number).collect();
        assert_eq!(numbers, [0, 0, 1]);
    }

    /// A value somewhere in a JSON text replaced by another.
    fn replaced(value: &mut serde_json::Value, at: &mut usize, by: &serde_json::Value) {
        if *at == 0 {
            *value = by.clone();
        }
        *at = at.wrapping_sub(1);
        match value {
            serde_json::Value::Array(items) => items.iter_mut().for_each(|v| replaced(v, at, by)),
            serde_json::Value::Object(fields) => fields.values_mut().for_each(|v| replaced(v, at, by)),
            _ => {}
        }
    }

    fn values() -> impl Strategy<Value = serde_json::Value> {
        use serde_json::json;
        prop_oneof![
            Just(json!(null)),
            Just(json!([])),
            Just(json!({})),
            Just(json!("")),
            any::<bool>().prop_map(|v| json!(v)),
            any::<i64>().prop_map(|v| json!(v)),
            any::<f64>().prop_map(|v| json!(v)),
            ".{0,12}".prop_map(|v| json!(v)),
        ]
    }

    fn poses() -> impl Strategy<Value = DAffine3> {
        let numbers = || prop::array::uniform3(-1.0..1.0f64);
        (numbers(), numbers(), 0..7).prop_map(|(at, turn, decade)| {
            let turn = DQuat::from_scaled_axis(3.0 * DVec3::from(turn));
            DAffine3::from_rotation_translation(turn, DVec3::from(at) * 10f64.powi(decade))
        })
    }

    fn names() -> impl Strategy<Value = PartName> {
        let within = prop::collection::vec(".{0,8}", 0..3);
        (within, ".{0,12}", 0..20usize).prop_map(|(within, name, number)| PartName { within, name, number })
    }

    fn parts() -> impl Strategy<Value = KeptPart> {
        let placement = prop::option::of(poses()).prop_map(|pose| pose.and_then(|pose| Placement::of(&pose)));
        (names(), placement, any::<bool>()).prop_map(|(part, placement, hidden)| KeptPart {
            part,
            placement,
            hidden,
        })
    }

    fn groups() -> impl Strategy<Value = KeptGroup> {
        let parts = prop::collection::vec(names(), 0..4);
        (".{0,12}", parts).prop_map(|(name, parts)| KeptGroup { name, parts })
    }

    fn fits() -> impl Strategy<Value = KeptFit> {
        let choice = (any::<bool>(), any::<bool>());
        (names(), 0..999usize, names(), 0..999usize, choice).prop_map(
            |(moving, moving_surface, fixed, fixed_surface, (pinned, off))| KeptFit {
                moving,
                moving_surface,
                fixed,
                fixed_surface,
                pinned,
                off,
            },
        )
    }

    fn settings() -> impl Strategy<Value = Settings> {
        let parameters = prop::collection::btree_map(".{0,12}", -1e6..1e6f32, 0..5);
        let parameters = prop::collection::btree_map(".{0,12}", parameters, 0..3);
        let engage = prop::option::of(".{0,8}");
        let method = prop::option::of(Just(mortise_bake::Method::Occupancy));
        (parameters, engage, prop::option::of(0.0..9.0f32), method).prop_map(
            |(parameters, engage, guide_cap_n, method)| Settings {
                parameters,
                engage,
                guide_cap_n,
                method,
            },
        )
    }

    fn views() -> impl Strategy<Value = KeptView> {
        let across = prop_oneof![
            Just(KeptAcross::X),
            poses().prop_map(|pose| KeptAcross::Face {
                point_mm: pose.translation.to_array(),
                normal: pose.matrix3.z_axis.to_array(),
            }),
        ];
        let section = (across, -1e6..1e6f64, any::<bool>());
        let section = section.prop_map(|(across, offset_mm, flipped)| KeptSection {
            across,
            offset_mm,
            flipped,
        });
        let angles = (-4.0..4.0f64, -1.5..1.5f64);
        (
            poses(),
            1e-3..1e6f64,
            angles,
            any::<(bool, bool)>(),
            prop::option::of(section),
        )
            .prop_map(
                |(pose, distance_mm, (yaw_rad, pitch_rad), (orthographic, see_through), section)| {
                    let view = KeptView {
                        target_mm: pose.translation.to_array(),
                        distance_mm,
                        yaw_rad,
                        pitch_rad,
                        orthographic,
                        see_through,
                        section,
                    };
                    view.rounded()
                },
            )
    }

    fn projects() -> impl Strategy<Value = Project> {
        let path = prop::option::of("/.{0,20}").prop_map(|path| path.map(PathBuf::from));
        let model = (path, "[0-9a-f]{64}").prop_map(|(path, sha256)| ModelFile { path, sha256 });
        let parts = prop::collection::vec(parts(), 0..5);
        let fits = prop::collection::vec(fits(), 0..4);
        let groups = prop::collection::vec(groups(), 0..3);
        let locked = prop::option::of(prop::collection::vec(names(), 0..3));
        let chosen = (groups, locked, fits);
        let rig = prop::option::of(".{0,12}");
        let signals = prop::option::of(prop::collection::vec(".{0,8}", 0..4));
        let view = prop::option::of(views());
        (model, parts, chosen, settings(), rig, signals, view).prop_map(
            |(model, parts, (groups, locked, fits), settings, rig, signals, view)| Project {
                version: VERSION,
                model,
                parts,
                groups,
                locked,
                fits,
                settings,
                rig,
                signals,
                view,
            },
        )
    }

    proptest! {
        #[test]
        fn a_damaged_project_is_refused_or_sound(at in 0..60usize, by in values()) {
            let mut value = serde_json::to_value(some()).expect("JSON");
            replaced(&mut value, &mut { at }, &by);
            if let Ok(read) = Project::from_json(value.to_string().as_bytes()) {
                let poses = read.parts.iter().filter_map(|part| part.placement);
                prop_assert!(poses.clone().all(|placement| placement.pose().is_some_and(|p| p.is_finite())));
            }
        }

        #[test]
        fn damaged_bytes_do_not_panic(at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<bool>()) {
            let mut bytes = some().to_json().into_bytes();
            let at = at.index(bytes.len());
            bytes[at] = byte;
            if cut {
                bytes.truncate(at);
            }
            if let Err(error) = Project::from_json(&bytes) {
                let text = format!("{error:#}");
                prop_assert!(!text.contains('\n'), "{}", text);
            }
        }

        #[test]
        fn any_project_is_read_as_it_was_written(project in projects()) {
            let back = Project::from_json(project.to_json().as_bytes()).expect("its own");
            prop_assert_eq!(back, project);
        }

        #[test]
        fn a_placement_is_that_of_the_pose(pose in poses()) {
            let placement = Placement::of(&pose).expect("rigid");
            prop_assert!(placement.pose().expect("sound").abs_diff_eq(pose, 1e-8));
        }
    }
}
