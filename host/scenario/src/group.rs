//! The scene of a group that a hand brings in: the group is one part, held at its common centre of mass, and the parts that it is put onto are where they rest.

use std::ops::ControlFlow;

use glam::DAffine3;
use mortise_bake::{BakeReport, Grabbable, Request, plan};
use mortise_brep::{CadModel, Part};
use mortise_task::insertion::Insertion;
use mortise_task::joined::joined;

use crate::error::ScenarioError;

/// A scene with a group as its first part.
pub(crate) struct GroupScene {
    pub model: CadModel,
    pub image: Vec<u8>,
    pub report: BakeReport,
    /// The group's step in that scene.
    pub insertion: Insertion,
    /// Where each part of it rests, mm.
    pub rests: Vec<DAffine3>,
}

impl GroupScene {
    /// Of a step in which several parts move as one. Cost: a bake.
    ///
    /// # Errors
    /// `Bake`.
    pub fn new(model: &CadModel, insertion: &Insertion, rests: &[DAffine3]) -> Result<Self, ScenarioError> {
        let group = [&[insertion.part], &insertion.with[..]].concat();
        let names: Vec<&str> = group
            .iter()
            .map(|part| model.parts[*part].name.as_str())
            .collect();
        let name = names.join(", ");
        let mut scene = model.clone();
        scene.parts.clear();
        scene.shapes.push(joined(model, &group));
        scene.parts.push(Part {
            name: name.clone(),
            shape: scene.shapes.len() - 1,
            ..model.parts[insertion.part].clone()
        });
        (scene.parts).extend(insertion.onto.iter().map(|part| model.parts[*part].clone()));
        let request = Request {
            grabbable: Grabbable::All,
            ..Request::default()
        };
        let planned = plan(&scene, &request, &|_| ControlFlow::Continue(()))
            .map_err(|source| ScenarioError::Bake { step: name, source })?;
        let first = scene.parts[0].placement;
        let onto = insertion.onto.iter().map(|part| rests[*part]);
        Ok(Self {
            insertion: Insertion {
                part: 0,
                with: Vec::new(),
                onto: (1..scene.parts.len()).collect(),
                way: insertion.way.clone(),
            },
            rests: [first].into_iter().chain(onto).collect(),
            image: planned.image,
            report: planned.plan.report,
            model: scene,
        })
    }
}
