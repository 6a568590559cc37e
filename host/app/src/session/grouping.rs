//! Parts grouped so that they are grabbed and moved as one, and groups taken apart again.
//!
//! A group is one part of the collision model, so that contact, mass and guidance act on one body and a board needs nothing new. Its other parts follow it in the
//! window. Grouping bakes the scene again; a bake under way of other groups is dropped.

use super::document::Document;
use super::groups::{Group, Groups, name_of};
use super::state::Session;
use super::tree::{assembly_of, tree};

/// An action of the operator on groups.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupIntent {
    /// Group parts, with all of each group that one of them is in.
    Group(Vec<usize>),
    /// Take the group of a part apart.
    Ungroup(usize),
}

impl Session {
    /// Why an action on groups is not possible now, as a sentence.
    pub(super) fn no_grouping(&self, intent: &GroupIntent) -> Option<String> {
        let no = |reason: &str| Some(reason.to_owned());
        let Some(document) = &self.document else {
            return no("No file is open");
        };
        if let Some(reason) = self.no_move().or(self.no_other_bake()) {
            return no(reason);
        }
        let groups = document.groups();
        match intent {
            GroupIntent::Ungroup(part) => match groups.of(*part) {
                None if *part >= document.poses.len() => no("Select a group first"),
                None => Some(format!("{} is in no group", document.part_name(*part))),
                Some(_) => None,
            },
            GroupIntent::Group(parts) => {
                let all = whole(document, parts);
                let open = |part: &&usize| !has_surface(document, **part);
                match all.as_slice() {
                    [] | [_] => no("Select two or more parts first: Ctrl and a click adds one"),
                    [first, ..] if groups.together(*first) == all => {
                        Some(format!("{} is a group already", document.moving_name(*first)))
                    }
                    all if all.len() == document.poses.len() => {
                        no("All parts as one touch nothing: leave one out of the group")
                    }
                    all if leaves_none_free(document, all) => no(
                        "Nothing would be left to grab, because a part of the group is locked to the ground: unlock it first",
                    ),
                    all => (all.iter().find(open)).map(|&part| {
                        let name = document.part_name(part);
                        format!("{name} has no surface that could touch anything: leave it out of the group")
                    }),
                }
            }
        }
    }

    /// Why the open document cannot be baked otherwise now, as a sentence: that would end the reading of another one.
    pub(super) fn no_other_bake(&self) -> Option<&'static str> {
        let open = self.document.as_ref().map(|document| document.generation);
        let reads = self.job.as_ref().is_some_and(|job| Some(job.generation) != open);
        reads.then_some("Wait until the other file is read")
    }

    pub(super) fn perform_on_groups(&mut self, intent: &GroupIntent) {
        let Some(document) = &self.document else { return };
        let mut selected = None;
        let (groups, name) = match intent {
            GroupIntent::Group(parts) => {
                let Some(group) = group_of(document, whole(document, parts)) else {
                    return;
                };
                let name = format!("group {}", group.name);
                selected = Some(group.parts().to_vec());
                (document.groups().with(group), name)
            }
            GroupIntent::Ungroup(part) => {
                let name = format!("ungroup {}", document.moving_name(*part));
                (document.groups().without(*part), name)
            }
        };
        self.regroup(groups);
        if let Some(parts) = selected {
            self.select_these(&parts);
        }
        if let Some(document) = &self.document
            && self.moves.generation == Some(document.generation)
        {
            let groups = document.groups().clone();
            self.moves.steps.regroup(&name, &document.poses, groups);
        }
        self.bake();
    }

    /// Gives the document other groups; returns whether they are others than before, so that the scene is to be baked.
    pub(super) fn regroup(&mut self, groups: Groups) -> bool {
        let Some(document) = &mut self.document else {
            return false;
        };
        if *document.groups() == groups {
            return false;
        }
        let before = document.groups().clone();
        document.regroup(groups);
        let after = document.groups().clone();
        let is_other = |part: usize| before.of(part) != after.of(part);
        // Surfaces of a group have numbers of their own.
        self.fits
            .retain(|id, _| !is_other(id.moving_part) && !is_other(id.fixed_part));
        self.partner = self.partner.filter(|part| !is_other(*part));
        self.drop_fits();
        self.ways.clear();
        self.sequencing.forget();
        self.verdict = None;
        self.held = None;
        true
    }
}

/// These parts and those of their groups, ascending; what does not exist is left out.
fn whole(document: &Document, parts: &[usize]) -> Vec<usize> {
    let exists = |part: &&usize| **part < document.poses.len();
    let together = |part: &usize| document.groups().together(*part);
    let mut all: Vec<usize> = parts.iter().filter(exists).flat_map(together).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Whether parts as a group are locked to the ground, and everything else is.
fn leaves_none_free(document: &Document, group: &[usize]) -> bool {
    let grouped = &document.grouped;
    // Where nothing was chosen, a group that has the largest part may be grabbed.
    grouped.locked.is_some()
        && group.iter().any(|part| grouped.is_locked(*part))
        && (0..document.poses.len()).all(|part| group.contains(&part) || grouped.is_locked(part))
}

/// Whether a part of the file has triangles.
fn has_surface(document: &Document, part: usize) -> bool {
    let model = &document.model;
    let shape = model
        .parts
        .get(part)
        .and_then(|part| model.shapes.get(part.shape));
    shape.is_some_and(|shape| !shape.mesh.triangles.is_empty())
}

/// The group of parts as they are, with the name of the subassembly that consists of them, or of their own names.
pub(super) fn group_of(document: &Document, parts: Vec<usize>) -> Option<Group> {
    let file = tree(&document.model, &Groups::default());
    let name = assembly_of(&file, &parts).map_or_else(
        || {
            let names: Vec<&str> = parts.iter().map(|&part| document.part_name(part)).collect();
            name_of(&names)
        },
        str::to_owned,
    );
    let placements: Vec<_> = document.model.parts.iter().map(|part| part.placement).collect();
    Group::new(name, parts, &document.poses, &placements)
}
