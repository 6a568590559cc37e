//! Why no energy draws the held or selected part, in words. Pure.

use std::sync::Arc;

use mortise_bake::Baked;
use mortise_protocol::parameter::ParameterId;

use super::document::Document;
use super::energies::{Made, Pairing, Unmade};
use super::state::Session;

impl Session {
    /// Why no energy draws the held or selected part to the fit that is shown, as a sentence; `None` where one does, or would once the part is held.
    pub fn why_not_drawn(&self) -> Option<String> {
        let Some(document) = &self.document else {
            return Some("No file is open".to_owned());
        };
        let Some(part) = self.fit_subject() else {
            return Some("Select a part: its energy is made for the fit that is shown".to_owned());
        };
        let name = document.moving_name(part);
        let Some(scene) = &document.baked else {
            return Some("The collision model is not baked yet".to_owned());
        };
        if !document.is_grabbable(part) {
            return Some(format!(
                "{name} is locked to the ground: select a part that can be held"
            ));
        }
        let wanted = self.drawing_fit().map(|(of, _)| of);
        let is_wanted = |made: &&Arc<Made>| wanted.is_none_or(|of| made.of == of);
        let Some(made) = self.energies.chosen(part).filter(is_wanted) else {
            return Some(self.why_not_made(document, part, wanted));
        };
        if !self.scene_energies().iter().any(|there| Arc::ptr_eq(there, made)) {
            return Some(self.why_not_attached(part, scene));
        }
        let why = match self.connection() {
            None => "Connect a rig to be drawn",
            Some(connection) if connection.upload.is_some() => "The scene with the energy is being uploaded",
            Some(_) if !self.scene_is_on_board() => {
                "The board's scene is without the energy: upload the model"
            }
            Some(_) if self.parameters[ParameterId::GeometricForce as usize] <= 0.0 => {
                "The force of the energy is 0 N: raise it"
            }
            Some(_) => return None,
        };
        Some(why.to_owned())
    }

    /// Why the energy of the fit that is shown is not there.
    fn why_not_made(&self, document: &Document, part: usize, wanted: Option<Pairing>) -> String {
        let name = document.moving_name(part);
        let fitting = self.fitting.as_ref().filter(|fitting| fitting.moving == part);
        let (Some(of), Some(fitting)) = (wanted, fitting) else {
            return match (fitting, self.no_search()) {
                (None, Some(why)) => why,
                (None, None) => format!("Find the fits of {name} first (M)"),
                (Some(fitting), _) if fitting.search.is_some() => {
                    format!("The fits of {name} are being searched")
                }
                (Some(fitting), _) if fitting.offers.is_empty() => {
                    format!("No fit of {name} is known, so that nothing draws it")
                }
                (Some(_), _) => "No way in to this fit is known: show another one (N)".to_owned(),
            };
        };
        let other = document.moving_name(of.against);
        match self.energies.unmade(&of) {
            Some(Unmade::Cancelled) => "The energy of the fit that is shown was cancelled".to_owned(),
            Some(Unmade::Impossible) => {
                format!("{name} and {other} have no energy in this fit: show another one (N)")
            }
            None if self.energy_under_way().is_some() => {
                format!("The energy of fit {} is being made", fitting.chosen + 1)
            }
            None => "Another energy is being ended first, which takes some seconds".to_owned(),
        }
    }

    /// Why the energy of a part, which is made, is not in the scene.
    fn why_not_attached(&self, part: usize, scene: &Arc<Baked>) -> String {
        match (self.energies.no_room(part, scene), self.no_move()) {
            (Some(why), _) => why.to_owned(),
            (None, Some(_)) if self.is_armed() => {
                "The energy is made: disarm, and it gets to the board".to_owned()
            }
            (None, Some(why)) => why.to_owned(),
            (None, None) => "The energy gets to the scene after the demonstration".to_owned(),
        }
    }
}
