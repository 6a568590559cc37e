//! Random scenes: one moving part above one to three fixed ones, all in random orientations, in one of the two kinds of field. It starts clear of
//! them: a part that starts inside another is pushed out faster than a handle may move.

use std::ops::ControlFlow;

use fastrand::Rng;
use glam::{DAffine3, DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable, Method, PointshellKind, bake};
use mortise_brep::{CadModel, Part, load_step};
use mortise_scenario::ScenarioError;

use crate::LabError;

/// Files the shapes come from.
const FILES: &[(&str, &str)] = &[
    (
        "pair_d18.75_clear0.02.step",
        include_str!("../../data/pair_d18.75_clear0.02.step"),
    ),
    (
        "bolt_with_stop.step",
        include_str!("../../data/bolt_with_stop.step"),
    ),
    ("scene_p.step", include_str!("../../data/scene_p.step")),
];
/// Name of the moving part.
const MOVING: &str = "moving";
/// Bytes of an image: small enough for many uploads in an hour.
const IMAGE_BYTES: std::ops::Range<u64> = 12_000..48_000;
/// Largest distance of a fixed part's own origin from the world's, mm.
const SPREAD_MM: f64 = 40.0;

/// Height of the moving part's start above the others, mm.
const CLEAR_MM: f64 = 2.0;

/// A baked scene.
pub(super) struct Scene {
    pub(super) image: Vec<u8>,
    /// Part to grab.
    pub(super) part: u16,
    /// Where the hand takes hold, world, m.
    pub(super) grip: [f32; 3],
}

/// The stock of shapes.
pub(super) struct Scenes {
    stock: CadModel,
}

impl Scenes {
    /// Reads all shape files.
    pub(super) fn load() -> Result<Self, LabError> {
        let folder = tempfile::tempdir().map_err(|source| LabError::Unwritable {
            path: std::env::temp_dir(),
            source,
        })?;
        let mut stock: Option<CadModel> = None;
        for (name, text) in FILES {
            let path = folder.path().join(name);
            std::fs::write(&path, text).map_err(|source| LabError::Unwritable {
                path: path.clone(),
                source,
            })?;
            let model = load_step(&path)?;
            match &mut stock {
                None => stock = Some(model),
                Some(stock) => stock.shapes.extend(model.shapes),
            }
        }
        stock.map(|stock| Self { stock }).ok_or_else(|| LabError::Input {
            name: "endurance".into(),
            what: "there are no shapes to make scenes of".into(),
        })
    }

    /// Highest or lowest point of a part, mm.
    fn extent(&self, part: &Part, choose: fn(f64, f64) -> f64) -> f64 {
        let vertices = &self.stock.shapes[part.shape].mesh.vertices;
        let heights = vertices
            .iter()
            .map(|&vertex| part.placement.transform_point3(vertex).z);
        heights.reduce(choose).unwrap_or(0.0)
    }

    /// A random scene.
    pub(super) fn make(&mut self, random: &mut Rng) -> Result<Scene, LabError> {
        let fixed = random.usize(1..=3);
        let mut parts = Vec::new();
        for number in 0..=fixed {
            let mut signed = || 2.0 * random.f64() - 1.0;
            let spread = DVec3::new(signed(), signed(), signed()) * SPREAD_MM;
            let turn =
                DQuat::from_scaled_axis(DVec3::new(signed(), signed(), signed()) * std::f64::consts::PI);
            parts.push(Part {
                name: if number == 0 {
                    MOVING.to_owned()
                } else {
                    format!("fixed {number}")
                },
                path: Vec::new(),
                shape: random.usize(0..self.stock.shapes.len()),
                placement: DAffine3::from_rotation_translation(turn, spread),
                color: None,
            });
        }
        let top = |part: &Part| self.extent(part, f64::max);
        let table = parts[1..].iter().map(top).fold(f64::NEG_INFINITY, f64::max);
        let lift = table + CLEAR_MM - self.extent(&parts[0], f64::min);
        parts[0].placement.translation.z += lift;
        self.stock.parts = parts;
        let classic = random.u8(0..4) == 0;
        let options = BakeOptions {
            method: if classic {
                Method::Occupancy
            } else {
                Method::DistanceField
            },
            shell: if classic {
                PointshellKind::Classic {
                    voxel_mm: None,
                    shrink_percent: 0.0,
                }
            } else {
                PointshellKind::ErrorBounded
            },
            grabbable: Grabbable::Named(vec![MOVING.to_owned()]),
            image_limit_bytes: random.u64(IMAGE_BYTES),
            ..BakeOptions::default()
        };
        let baked = bake(&self.stock, &options, &|_| ControlFlow::Continue(())).map_err(|source| {
            ScenarioError::Bake {
                step: "a random scene".into(),
                source,
            }
        })?;
        let part = (baked.report.parts.iter().position(|part| part.name == MOVING)).ok_or_else(|| {
            LabError::Input {
                name: "a random scene".into(),
                what: "the part to move has no surface".into(),
            }
        })?;
        let grip = 1e-3 * self.stock.parts[0].placement.translation;
        Ok(Scene {
            image: baked.image,
            part: part as u16,
            grip: grip.as_vec3().to_array(),
        })
    }
}
