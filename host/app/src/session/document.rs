//! A STEP file that has been read and prepared for display.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context as _;
use glam::{DAffine3, DVec3};
use mortise_bake::Baked;
use mortise_brep::{CadModel, LoadOptions, load_step_while};
use sha2::{Digest as _, Sha256};

use super::flashed::Flashed;
use super::insertion::{self, Insertion};
use super::tree::{Branch, tree};
use super::verdict::Watch;
use crate::display::extent::Extent;
use crate::display::mesh::{ShapeMesh, shown};
use crate::kept::project::{PartName, part_names};

/// Colours of parts that have none, sRGB: muted, distinguishable on a dark ground, none of them red (stop) or orange (held part).
const PALETTE: [[u8; 3]; 8] = [
    [150, 163, 178],
    [112, 152, 196],
    [126, 176, 146],
    [170, 146, 196],
    [196, 182, 128],
    [120, 180, 186],
    [188, 150, 166],
    [160, 176, 116],
];

/// The open document.
#[derive(Clone, Debug)]
pub struct Document {
    /// Number of the document; each opened file increments it.
    pub generation: u64,
    /// Path of the file; `None`: the sample.
    pub path: Option<PathBuf>,
    /// File name without folders, for titles.
    pub title: String,
    /// Contents of the file.
    pub model: Arc<CadModel>,
    /// The assembly.
    pub tree: Vec<Branch>,
    /// One mesh for each shape.
    pub meshes: Arc<Vec<ShapeMesh>>,
    /// A bounding sphere of each shape, in the shape's frame.
    pub extents: Vec<Extent>,
    /// Bounding sphere of all parts as opened, or as the last instruction placed them.
    pub extent: Extent,
    /// sRGB of each part.
    pub colors: Vec<[u8; 3]>,
    /// SHA-256 of the files that were read, in hexadecimal digits; empty when it is unknown.
    pub sha256: String,
    /// Name of each part in project files.
    pub names: Vec<PartName>,
    /// Pose of each part in the scene that is sent to a board, mm: the file's, or where a project puts it.
    pub placed: Vec<DAffine3>,
    /// Whether each part is hidden.
    pub hidden: Vec<bool>,
    /// Present pose of each part, mm.
    pub poses: Vec<DAffine3>,
    /// A peg in front of a hole, if the assembly has one.
    pub insertion: Option<Insertion>,
    /// Reports how insertions of the held part end.
    pub watch: Watch,
    /// The scene image, once baked.
    pub baked: Option<Arc<Baked>>,
}

impl Document {
    /// Reads a STEP file. Takes as long as the CAD kernel does, or until `progress` ends it: call it outside the window's thread.
    ///
    /// # Errors
    /// One line: what, where, what to do.
    pub fn read(
        path: &Path,
        generation: u64,
        progress: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> anyhow::Result<Self> {
        let model = load_step_while(path, &LoadOptions::default(), progress)?;
        let title = (path.file_name()).map_or_else(
            || path.display().to_string(),
            |n| n.to_string_lossy().into_owned(),
        );
        let sha256 = sha256_of(&model.files);
        Ok(Self {
            sha256,
            ..Self::of(model, Some(path.to_owned()), title, generation)
        })
    }

    /// Reads the sample that is built into the program.
    ///
    /// # Errors
    /// The sample cannot be written to the folder for temporary files, or not be read.
    pub fn sample(generation: u64, progress: &dyn Fn(f64) -> ControlFlow<()>) -> anyhow::Result<Self> {
        let file = mortise_scenario::sample::File::write().context("the sample could not be unpacked")?;
        let model = load_step_while(file.path(), &LoadOptions::default(), progress)?;
        let title = mortise_scenario::sample::NAME.to_owned();
        Ok(Self {
            sha256: digits(Sha256::new_with_prefix(mortise_scenario::sample::STEP)),
            ..Self::of(model, None, title, generation)
        })
    }

    /// The document of a model.
    pub fn of(model: CadModel, path: Option<PathBuf>, title: String, generation: u64) -> Self {
        let extents: Vec<Extent> = (model.shapes.iter())
            .map(|shape| Extent::of_points(shape.mesh.vertices.iter().copied()))
            .collect();
        let poses: Vec<DAffine3> = model.parts.iter().map(|p| p.placement).collect();
        let insertion = insertion::find(&model, &poses);
        let extent = extent_of(&model, &poses);
        Self {
            generation,
            path,
            title,
            tree: tree(&model),
            meshes: Arc::new(model.shapes.iter().map(ShapeMesh::of).collect()),
            extents,
            extent,
            colors: colors(&model),
            sha256: String::new(),
            names: part_names(&model),
            placed: poses.clone(),
            hidden: vec![false; poses.len()],
            poses,
            insertion,
            watch: Watch::of(&model),
            baked: None,
            model: Arc::new(model),
        }
    }

    /// Moves every part to where the scene on a board has it.
    pub fn reset_poses(&mut self) {
        self.poses.clone_from(&self.placed);
    }

    /// Puts every part at a pose, mm, also in the scene that is sent to a board.
    pub fn place(&mut self, poses: Vec<DAffine3>) {
        if poses.len() == self.placed.len() && poses.iter().all(|pose| pose.is_finite()) {
            self.extent = extent_of(&self.model, &poses);
            self.poses.clone_from(&poses);
            self.placed = poses;
        }
    }

    /// Middle of a part where it is now: the centre of its bounding box, world, mm.
    pub fn middle(&self, part: usize) -> Option<DVec3> {
        let shape = self.model.parts.get(part)?.shape;
        let center = self.extents.get(shape).copied().unwrap_or_default().center;
        Some(self.poses.get(part)?.transform_point3(center))
    }

    /// Enlarges the bounding sphere of all parts to one that is being moved, so that it stays in sight.
    pub fn extend_to(&mut self, part: usize) {
        let shape = self.model.parts.get(part).map(|part| part.shape);
        let own = shape.and_then(|shape| self.extents.get(shape)).copied();
        if let (Some(own), Some(center)) = (own, self.middle(part)) {
            let reach = center.distance(self.extent.center) + own.radius;
            self.extent.radius = self.extent.radius.max(reach);
        }
    }

    /// Poses of the parts in the file, mm.
    pub fn file_poses(&self) -> Vec<DAffine3> {
        self.model.parts.iter().map(|part| part.placement).collect()
    }

    /// Whether the scene that is sent to a board has a part elsewhere than the file.
    pub fn is_placed(&self) -> bool {
        let placements = self.model.parts.iter().map(|part| &part.placement);
        !placements.eq(&self.placed)
    }

    /// Where the parts of the baked scene are placed, in its order, mm; `None` until it is baked.
    pub fn scene_placements(&self) -> Option<Vec<DAffine3>> {
        let parts = self.baked.as_ref()?.report.parts.iter();
        parts
            .map(|part| self.placed.get(part.model_part).copied())
            .collect()
    }

    /// The scene to send to a board, once baked: with the parts where they are placed.
    pub fn scene(&self) -> Option<Arc<Baked>> {
        Flashed::new(self.baked.clone()?, self.scene_placements()?).image()
    }

    /// Name of a part.
    pub fn part_name(&self, part: usize) -> &str {
        self.model.parts.get(part).map_or("?", |p| p.name.as_str())
    }

    /// Whether a part is hidden: neither drawn nor picked.
    pub fn is_hidden(&self, part: usize) -> bool {
        self.hidden.get(part).is_some_and(|hidden| *hidden)
    }

    /// Whether a part may be grabbed; `false` until the scene is baked.
    pub fn is_grabbable(&self, part: usize) -> bool {
        let reports = self.baked.as_ref().map(|b| b.report.parts.as_slice());
        (reports.unwrap_or_default().iter()).any(|r| r.model_part == part && r.grabbable)
    }

    /// Index in the scene of a part of the model; `None` for parts without a surface.
    pub fn scene_part(&self, part: usize) -> Option<u16> {
        let reports = &self.baked.as_ref()?.report.parts;
        let index = reports.iter().position(|r| r.model_part == part)?;
        u16::try_from(index).ok()
    }

    /// Index in the model of a part of the scene.
    pub fn model_part(&self, scene_part: u16) -> Option<usize> {
        let reports = &self.baked.as_ref()?.report.parts;
        reports.get(usize::from(scene_part)).map(|r| r.model_part)
    }
}

/// SHA-256 of the contents of files, one after the other; empty when one cannot be read any more.
fn sha256_of(files: &[PathBuf]) -> String {
    let mut sum = Sha256::new();
    for path in files {
        let Ok(bytes) = std::fs::read(path) else {
            return String::new();
        };
        sum.update(bytes);
    }
    digits(sum)
}

fn digits(sum: Sha256) -> String {
    sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Bounding sphere of all parts at their present poses.
fn extent_of(model: &CadModel, poses: &[DAffine3]) -> Extent {
    Extent::of_points(model.parts.iter().zip(poses).flat_map(|(part, pose)| {
        (model.shapes.get(part.shape))
            .map(|shape| shape.mesh.vertices.as_slice())
            .unwrap_or_default()
            .iter()
            .map(|&v| pose.transform_point3(v))
    }))
}

fn colors(model: &CadModel) -> Vec<[u8; 3]> {
    let own = |color: [f32; 3]| {
        let [r, g, b, _] = shown(color);
        [r, g, b]
    };
    (model.parts.iter().enumerate())
        .map(|(index, part)| part.color.map_or(PALETTE[index % PALETTE.len()], own))
        .collect()
}
