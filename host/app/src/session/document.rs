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
use super::grouped::Grouped;
use super::groups::Groups;
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
    /// The parts that move as one, and the model with each group as one part.
    pub grouped: Arc<Grouped>,
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
        let model = Arc::new(model);
        Self {
            generation,
            path,
            title,
            grouped: Arc::new(Grouped::none(Arc::clone(&model), extents.clone())),
            tree: tree(&model, &Groups::default()),
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
            model,
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

    /// Groups the parts anew, as they are; the scene is to be baked again.
    pub fn regroup(&mut self, groups: Groups) {
        self.tree = tree(&self.model, &groups);
        self.grouped = Arc::new(self.grouped.regrouped(groups));
        let mut poses = self.poses.clone();
        self.grouped.groups.gather(&mut poses);
        self.place(poses);
        self.insertion = insertion::find(&self.grouped.model, &self.file_poses());
        self.watch = Watch::of(&self.grouped.model);
        self.baked = None;
    }

    /// The groups of parts that move as one.
    pub fn groups(&self) -> &Groups {
        &self.grouped.groups
    }

    /// Puts a part at a pose, mm, and with it those of its group.
    pub fn put(&mut self, part: usize, pose: DAffine3) {
        self.grouped.groups.put(&mut self.poses, part, pose);
    }

    /// Where all parts are, mm, with this one, and those of its group with it, at a pose.
    pub fn poses_with(&self, part: usize, pose: DAffine3) -> Vec<DAffine3> {
        let mut poses = self.poses.clone();
        self.groups().put(&mut poses, part, pose);
        poses
    }

    /// Bounding sphere of a part, or of the group that it stands for, in its frame, mm.
    pub fn own_extent(&self, part: usize) -> Extent {
        let shape = self.grouped.model.parts.get(part).map(|part| part.shape);
        let extent = shape.and_then(|shape| self.grouped.extents.get(shape));
        extent.copied().unwrap_or_default()
    }

    /// Middle of a part, or of its group, where it is now: the centre of its bounding box, world, mm.
    pub fn middle(&self, part: usize) -> Option<DVec3> {
        let first = self.groups().first(part);
        let center = self.own_extent(first).center;
        Some(self.poses.get(first)?.transform_point3(center))
    }

    /// Enlarges the bounding sphere of all parts to one that is being moved, or its group, so that it stays in sight.
    pub fn extend_to(&mut self, part: usize) {
        let own = self.own_extent(self.groups().first(part));
        if let Some(center) = self.middle(part) {
            let reach = center.distance(self.extent.center) + own.radius;
            self.extent.radius = self.extent.radius.max(reach);
        }
    }

    /// Poses of the parts in the file, those of a group with its first part, mm.
    pub fn file_poses(&self) -> Vec<DAffine3> {
        self.grouped.file_poses()
    }

    /// Whether the scene that is sent to a board has a part elsewhere than the file.
    pub fn is_placed(&self) -> bool {
        self.file_poses() != self.placed
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

    /// Name of what moves with a part: of its group, or its own.
    pub fn moving_name(&self, part: usize) -> &str {
        let group = self.groups().of(part);
        group.map_or_else(|| self.part_name(part), |group| &group.name)
    }

    /// The part of the file to which faces of a part of the scene belong, with their numbers there. Faces of several parts of a group, or unknown ones, keep the
    /// group's numbers, and `None` stands for it.
    pub fn owner(&self, part: usize, faces: &[u32]) -> (Option<usize>, Vec<u32>) {
        let owners: Option<Vec<(usize, u32)>> =
            (faces.iter().map(|&face| self.grouped.owner(part, face))).collect();
        match owners.as_deref() {
            Some([(first, _), others @ ..]) if others.iter().all(|(other, _)| other == first) => {
                let own = owners.iter().flatten().map(|(_, face)| *face);
                (Some(*first), own.collect())
            }
            _ => (None, faces.to_vec()),
        }
    }

    /// Name of what faces of a part of the scene belong to: of a part of the file, or of a group where they belong to several of its parts.
    pub fn owner_name(&self, part: usize, faces: &[u32]) -> &str {
        let (owner, _) = self.owner(part, faces);
        owner.map_or_else(|| self.moving_name(part), |owner| self.part_name(owner))
    }

    /// Whether a part is hidden: neither drawn nor picked.
    pub fn is_hidden(&self, part: usize) -> bool {
        self.hidden.get(part).is_some_and(|hidden| *hidden)
    }

    /// Whether a part, or its group, may be grabbed; `false` until the scene is baked.
    pub fn is_grabbable(&self, part: usize) -> bool {
        let first = self.groups().first(part);
        let reports = self.baked.as_ref().map(|b| b.report.parts.as_slice());
        (reports.unwrap_or_default().iter()).any(|r| r.model_part == first && r.grabbable)
    }

    /// Index in the scene of a part of the model, or of its group; `None` for parts without a surface.
    pub fn scene_part(&self, part: usize) -> Option<u16> {
        let first = self.groups().first(part);
        let reports = &self.baked.as_ref()?.report.parts;
        let index = reports.iter().position(|r| r.model_part == first)?;
        u16::try_from(index).ok()
    }

    /// Index in the model of a part of the scene; of a group, its first part.
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

/// The sum in hexadecimal digits.
pub(super) fn digits(sum: Sha256) -> String {
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
