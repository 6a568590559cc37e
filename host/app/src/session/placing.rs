//! Parts put to poses by the window: in the document, and in the scene that a board has.

use glam::DAffine3;
use mortise_protocol::message::ToDevice;

use super::document::Document;
use super::moves::PUT_BACK;
use super::state::Session;

impl Session {
    /// Why no part can be put elsewhere now, as a sentence.
    pub(super) fn no_move(&self) -> Option<&'static str> {
        if self.is_armed() {
            Some("Only while the motors are off: disarm first")
        } else if self.replays() {
            Some("A recorded run is shown: close it first")
        } else {
            let uploads = self.connection().is_some_and(|c| c.upload.is_some());
            let drags = self.moves.dragged().is_some();
            match (uploads, drags) {
                (true, _) => Some("Wait until the collision model is on the board"),
                (_, true) => Some("Let go of the part that is being dragged first"),
                _ => None,
            }
        }
    }

    /// Puts every part of the document at a pose, mm, also in the scene that a board has; its motors must be off.
    pub(super) fn place(&mut self, poses: Vec<DAffine3>) {
        let Some(document) = &mut self.document else {
            return;
        };
        let before = document.placed.clone();
        document.place(poses);
        if document.placed == before {
            return;
        }
        self.verdict = None;
        if let Some(connection) = self.connection_mut() {
            connection.scene_of = None;
            connection.refused_scene_of = None;
        }
    }

    /// Before a recording begins: where parts were placed since the upload, the scene is uploaded anew within the recording, which otherwise would begin at
    /// places that no image has.
    pub(super) fn bring_whole_scene(&mut self) {
        let placements = (self.document.as_ref()).and_then(Document::scene_placements);
        if let (Some(placements), Some(connection)) = (placements, self.connection_mut())
            && !connection.resets_to(&placements)
        {
            connection.forget_scene();
        }
    }

    /// Moves every part back to its position in the file.
    pub(super) fn put_back(&mut self) {
        let Some(document) = &mut self.document else {
            return;
        };
        let placements = document.scene_placements();
        if document.is_placed() {
            let poses = document.file_poses();
            self.place(poses);
            self.note_step(PUT_BACK);
        } else if let Some(connection) = self.connection_mut() {
            if placements.is_some_and(|placements| connection.resets_to(&placements)) {
                connection.request(ToDevice::ResetScene);
            } else {
                // Parts were elsewhere when the scene was uploaded.
                connection.scene_of = None;
                self.upload_if_due();
                self.note_step(PUT_BACK);
            }
        } else if let Some(document) = &mut self.document {
            document.reset_poses();
            self.note_step(PUT_BACK);
        }
    }
}
