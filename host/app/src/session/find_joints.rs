//! Finding the joints of a part beside the window's thread, with all parts where they are.

use glam::DAffine3;
use mortise_brep::CadModel;
use mortise_task::mobility::freedoms;
use mortise_task::{Assembly, Moved};

use super::joints::{JointIntent, JointsFound, PartJoints};
use super::outbox::Update;
use super::state::Session;
use super::threads::spawn;

impl Session {
    /// Why an action on joints is not possible now, as a sentence.
    pub(super) fn no_joint_action(&self, intent: &JointIntent) -> Option<String> {
        let Some(document) = &self.document else {
            return Some("No file is open".to_owned());
        };
        let found = self.selected.and_then(|part| self.joints.of(document, part));
        let reason = match intent {
            JointIntent::Find(part) if *part >= document.model.parts.len() => "There is no such part",
            JointIntent::Find(_) if self.joints.search().is_some() => "Joints are being searched",
            JointIntent::Find(_) | JointIntent::Mark(None) => return None,
            _ if found.is_none() => "Find the joints of the selected part first",
            JointIntent::Show(_) if self.is_armed() => "The rig is armed: disarm it first",
            JointIntent::Mark(Some(_)) | JointIntent::Show(_) => return None,
        };
        Some(reason.to_owned())
    }

    pub(super) fn perform_on_joints(&mut self, intent: JointIntent) {
        match intent {
            JointIntent::Find(part) => self.find_joints(part),
            JointIntent::Mark(joint) => self.joints.mark(joint),
            JointIntent::Show(freedom) => self.joints.show(Some(freedom)),
        }
    }

    fn find_joints(&mut self, part: usize) {
        let Some(document) = &self.document else { return };
        let id = self.joints.begin(document.generation, part);
        let parts = document.groups().together(part);
        let mut model = CadModel::clone(&document.model);
        for (part, pose) in model.parts.iter_mut().zip(&document.poses) {
            part.placement = *pose;
        }
        let outbox = self.outbox.clone();
        spawn("mortise-joints", move || {
            let result = search(model, parts);
            outbox.send(Update::Joints(JointsFound { id, result }));
        });
    }
}

/// The joints of parts that move as one. Cost: a sweep against every other part for each direction in which it could move; a second in an assembly of 20 parts.
fn search(model: CadModel, parts: Vec<usize>) -> Result<PartJoints, String> {
    let assembly = Assembly::new(model).map_err(|error| error.to_string())?;
    let others: Vec<usize> = (0..assembly.count())
        .filter(|other| !parts.contains(other))
        .collect();
    let group = Moved {
        parts: &parts,
        by: DAffine3::IDENTITY,
    };
    let found = freedoms(&assembly, &group, &others, &[]);
    Ok(PartJoints::new(&assembly, parts, &found))
}
