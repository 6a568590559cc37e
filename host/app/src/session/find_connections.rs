//! Finding the connections of the parts beside the window's thread, with all parts where they are.

use mortise_brep::CadModel;
use mortise_task::Assembly;

use super::connections::{ConnectionsFound, Graph};
use super::outbox::Update;
use super::state::Session;
use super::threads::spawn;

/// An action of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConnectionsIntent {
    /// Find which parts are connected where they are.
    Find,
    /// Cancel the search under way.
    Cancel,
}

impl Session {
    /// Why an action on connections is not possible now, as a sentence.
    pub(super) fn no_connections_action(&self, intent: ConnectionsIntent) -> Option<String> {
        let searches = self.connections.since().is_some();
        let reason = match (&self.document, intent) {
            (None, _) => "No file is open",
            (_, ConnectionsIntent::Cancel) if !searches => "No search is under way",
            (_, ConnectionsIntent::Cancel) => return None,
            (_, ConnectionsIntent::Find) if searches => "The search is under way",
            (Some(document), _) if document.model.parts.len() < 2 => "One part is no assembly",
            _ => return None,
        };
        Some(reason.to_owned())
    }

    pub(super) fn perform_on_connections(&mut self, intent: ConnectionsIntent) {
        match intent {
            ConnectionsIntent::Find => self.find_connections(),
            ConnectionsIntent::Cancel => self.connections.cancel(),
        }
    }

    fn find_connections(&mut self) {
        let Some(document) = &self.document else { return };
        let id = self.connections.begin(document.generation);
        let mut model = CadModel::clone(&document.model);
        for (part, pose) in model.parts.iter_mut().zip(&document.poses) {
            part.placement = *pose;
        }
        let outbox = self.outbox.clone();
        spawn("mortise-connections", move || {
            let result = search(model);
            outbox.send(Update::Connections(ConnectionsFound { id, result }));
        });
    }
}

/// The connections of a model. Cost: the contacts of all pairs, and each shaft beside each bore; a second in an assembly of 100 parts.
fn search(model: CadModel) -> Result<Graph, String> {
    let assembly = Assembly::new(model).map_err(|error| error.to_string())?;
    Ok(Graph::new(&assembly))
}
