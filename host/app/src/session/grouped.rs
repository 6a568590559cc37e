//! The model with each group as one part: what is baked, recognised and fitted. Pure.
//!
//! Parts keep their numbers. The first part of a group has the joined shape of all of them, the others have an empty one, as parts without a surface have. So a
//! number stands for the same part in the document, in the scene of a board, in targets and in fits; faces of a group alone have numbers of their own
//! ([`Grouped::owner`]).

use std::collections::BTreeSet;
use std::sync::Arc;

use glam::DAffine3;
use mortise_bake::Grabbable;
use mortise_brep::{CadModel, Part, Shape};
use mortise_task::joined::joined;

use super::groups::Groups;
use crate::display::extent::Extent;

/// A model and its groups.
#[derive(Clone, Debug)]
pub struct Grouped {
    /// The groups.
    pub groups: Groups,
    /// Parts of the file that are locked to the ground, each with its group: they are fixed where they are, and cannot be grabbed. `None`: the largest is.
    pub locked: Option<BTreeSet<usize>>,
    /// The model with them; the file's where there is none.
    pub model: Arc<CadModel>,
    /// A bounding sphere of each of its shapes, in the shape's frame.
    pub extents: Vec<Extent>,
    /// The file's model.
    file: Arc<CadModel>,
}

impl Grouped {
    /// The model of a file without groups; `extents` has a bounding sphere of each shape.
    pub fn none(file: Arc<CadModel>, extents: Vec<Extent>) -> Self {
        Self {
            groups: Groups::default(),
            locked: None,
            model: Arc::clone(&file),
            extents,
            file,
        }
    }

    /// The same file and groups with other parts locked to the ground.
    pub fn with_locked(&self, locked: Option<BTreeSet<usize>>) -> Self {
        Self {
            locked,
            ..self.clone()
        }
    }

    /// The same file with other groups. Cost: a copy of the model's geometry, where there is a group.
    pub fn regrouped(&self, groups: Groups) -> Self {
        let regrouped = self.of_groups(groups);
        regrouped.with_locked(self.locked.clone())
    }

    fn of_groups(&self, groups: Groups) -> Self {
        let mut extents = self.extents.clone();
        extents.truncate(self.file.shapes.len());
        if groups.is_empty() {
            return Self::none(Arc::clone(&self.file), extents);
        }
        let mut model = CadModel::clone(&self.file);
        let empty = model.shapes.len();
        model.shapes.push(Shape::default());
        for group in groups.iter() {
            let first = group.first();
            for (part, pose) in group.placed(model.parts[first].placement) {
                model.parts[part].placement = pose;
            }
            let shape = joined(&model, group.parts());
            for &part in group.parts() {
                model.parts[part].shape = empty;
            }
            model.parts[first].shape = model.shapes.len();
            model.parts[first].name.clone_from(&group.name);
            model.shapes.push(shape);
        }
        let added = model.shapes[empty..].iter();
        extents.extend(added.map(|shape| Extent::of_points(shape.mesh.vertices.iter().copied())));
        Self {
            groups,
            locked: None,
            model: Arc::new(model),
            extents,
            file: Arc::clone(&self.file),
        }
    }

    /// The model without the parts that another one stands for, and the number of each of its parts here. Where parts are locked, each name is that of one part.
    pub fn bodies(&self) -> (Arc<CadModel>, Vec<usize>) {
        let (parts, numbers) = self.body_parts();
        if self.groups.is_empty() && self.locked.is_none() {
            return (Arc::clone(&self.model), numbers);
        }
        let mut model = CadModel::clone(&self.model);
        model.parts = parts;
        (Arc::new(model), numbers)
    }

    /// The parts of [`Self::bodies`], and their numbers here. Cost: that of copying names, without geometry.
    fn body_parts(&self) -> (Vec<Part>, Vec<usize>) {
        let stands = |&part: &usize| self.groups.first(part) == part;
        let numbers: Vec<usize> = (0..self.model.parts.len()).filter(stands).collect();
        let mut parts: Vec<Part> = numbers
            .iter()
            .map(|&part| self.model.parts[part].clone())
            .collect();
        if self.locked.is_some() {
            name_apart(&mut parts);
        }
        (parts, numbers)
    }

    /// The part that has a face of this part's shape here, and the face's number there; `None`: there is no such face.
    pub fn owner(&self, part: usize, face: u32) -> Option<(usize, u32)> {
        let mut own = face as usize;
        for part in self.groups.together(part) {
            let faces = self
                .file
                .shapes
                .get(self.file.parts.get(part)?.shape)?
                .faces
                .len();
            if own < faces {
                return Some((part, own as u32));
            }
            own -= faces;
        }
        None
    }

    /// The parts that may be grabbed, of [`Self::bodies`]: those that are not locked to the ground; where none was chosen, all but the largest, or all where that is a
    /// group.
    pub fn grabbable(&self) -> Grabbable {
        if self.locked.is_some() {
            let (parts, numbers) = self.body_parts();
            let free = numbers
                .iter()
                .zip(&parts)
                .filter(|(part, _)| !self.is_locked(**part));
            return Grabbable::Named(free.map(|(_, part)| part.name.clone()).collect());
        }
        match self.largest().and_then(|part| self.groups.of(part)) {
            Some(_) => Grabbable::All,
            None => Grabbable::AllButLargest,
        }
    }

    /// Whether a part, or one of its group, is locked to the ground.
    pub fn is_locked(&self, part: usize) -> bool {
        let together = self.groups.together(part);
        match &self.locked {
            Some(locked) => together.iter().any(|part| locked.contains(part)),
            None => self.groups.of(part).is_none() && self.largest() == Some(part),
        }
    }

    /// The parts locked to the ground once this one is, or is free.
    pub fn locking(&self, part: usize, locks: bool) -> BTreeSet<usize> {
        let all = 0..self.file.parts.len();
        let mut locked: BTreeSet<usize> = all.filter(|part| self.is_locked(*part)).collect();
        for part in self.groups.together(part) {
            match locks {
                true => locked.insert(part),
                false => locked.remove(&part),
            };
        }
        locked
    }

    /// The part with the largest volume, as it is baked: the first of several.
    fn largest(&self) -> Option<usize> {
        let volume = |part: &usize| {
            let shape = self.model.shapes.get(self.model.parts[*part].shape);
            shape.map_or(0.0, |shape| shape.volume_mm3.abs())
        };
        let parts = (0..self.model.parts.len()).rev();
        parts.max_by(|a, b| volume(a).total_cmp(&volume(b)))
    }

    /// Poses of the parts where the file has them, those of a group with its first part.
    pub fn file_poses(&self) -> Vec<DAffine3> {
        let mut poses: Vec<DAffine3> = self.file.parts.iter().map(|part| part.placement).collect();
        self.groups.gather(&mut poses);
        poses
    }
}

/// Gives parts of the same name different ones.
fn name_apart(parts: &mut [Part]) {
    let mut taken: BTreeSet<String> = parts.iter().map(|part| part.name.clone()).collect();
    for index in 1..parts.len() {
        let (before, rest) = parts.split_at_mut(index);
        let part = &mut rest[0];
        if before.iter().all(|other| other.name != part.name) {
            continue;
        }
        let numbered = (2..).map(|number| format!("{} ({number})", part.name));
        let mut free = numbered.filter(|name| !taken.contains(name));
        if let Some(name) = free.next() {
            taken.insert(name.clone());
            part.name = name;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::session::groups::Group;

    /// The sample with a second peg, and the two pegs in a group.
    fn grouped() -> Grouped {
        let file = mortise_scenario::sample::File::write().expect("a folder for temporary files");
        let mut model = mortise_brep::load_step(file.path()).expect("the sample");
        let mut other = model.parts[1].clone();
        other.name = "other peg".into();
        other.placement.translation += 30.0 * DVec3::X;
        model.parts.push(other);
        let poses: Vec<DAffine3> = model.parts.iter().map(|part| part.placement).collect();
        let group = Group::new("pegs".into(), vec![2, 1], &poses, &poses).expect("two parts");
        let shapes = model.shapes.iter();
        let extents = shapes.map(|shape| Extent::of_points(shape.mesh.vertices.iter().copied()));
        let extents = extents.collect();
        let none = Grouped::none(Arc::new(model), extents);
        none.regrouped(Groups::default().with(group))
    }

    #[test]
    fn a_group_is_one_part_of_the_model_and_the_others_keep_their_numbers() {
        let grouped = grouped();
        let model = &grouped.model;
        let shape = |part: usize| &model.shapes[model.parts[part].shape];
        let peg = &grouped.file.shapes[grouped.file.parts[1].shape];
        assert_eq!(model.parts.len(), 3);
        assert_eq!(model.parts[1].name, "pegs");
        assert_eq!(shape(1).faces.len(), 2 * peg.faces.len());
        assert!((shape(1).volume_mm3 - 2.0 * peg.volume_mm3).abs() < 1e-6 * peg.volume_mm3);
        assert!(shape(2).faces.is_empty() && shape(2).mesh.triangles.is_empty());
        let middle = grouped.extents[model.parts[1].shape].center;
        // The triangles of a cylinder end a little before its sides.
        assert!((middle.x - 15.0).abs() < 0.05, "{middle}");
        let (bodies, numbers) = grouped.bodies();
        assert_eq!((numbers, bodies.parts.len()), (vec![0, 1], 2));
        let faces = peg.faces.len() as u32;
        assert_eq!(grouped.owner(1, 0), Some((1, 0)));
        assert_eq!(grouped.owner(1, faces + 1), Some((2, 1)));
        assert_eq!(grouped.owner(1, 2 * faces), None);
        assert_eq!(grouped.owner(0, 3), Some((0, 3)));
        assert_eq!(grouped.owner(9, 0), None);
    }

    #[test]
    fn the_largest_part_is_fixed_unless_it_is_a_group() {
        let pegs = grouped();
        assert_eq!(pegs.grabbable(), Grabbable::AllButLargest);
        let poses = pegs.file_poses();
        let group = Group::new("both".into(), vec![0, 1], &poses, &poses).expect("two parts");
        let both = pegs.regrouped(Groups::default().with(group));
        assert_eq!(both.grabbable(), Grabbable::All);
        let none = both.regrouped(Groups::default());
        assert!(Arc::ptr_eq(&none.model, &none.file));
        assert_eq!(none.extents.len(), none.file.shapes.len());
    }
    #[test]
    fn any_part_or_group_is_locked_and_parts_of_one_name_are_distinguished() {
        let named = |names: &[&str]| Grabbable::Named(names.iter().map(|name| (*name).to_owned()).collect());
        let pegs = grouped();
        assert!(pegs.is_locked(0) && !pegs.is_locked(1));
        // A group is locked whole, and comes free whole.
        let pegs = pegs.with_locked(Some(pegs.locking(2, true)));
        assert!([0, 1, 2].iter().all(|part| pegs.is_locked(*part)));
        let pegs = pegs.with_locked(Some(pegs.locking(0, false)));
        assert_eq!(pegs.grabbable(), named(&["block"]));
        let pegs = pegs.with_locked(Some(pegs.locking(1, false)));
        assert_eq!(pegs.grabbable(), named(&["block", "pegs"]));
        // What is locked stays so under other groups, and one of several parts of a name can be.
        let mut none = pegs
            .with_locked(Some(pegs.locking(0, true)))
            .regrouped(Groups::default());
        Arc::make_mut(&mut none.model).parts[2].name = "peg".into();
        assert_eq!(none.grabbable(), named(&["peg", "peg (2)"]));
        let one = none.with_locked(Some(none.locking(1, true)));
        assert_eq!(one.grabbable(), named(&["peg (2)"]));
        assert_eq!(one.bodies().0.parts[1].name, "peg");
    }
}
