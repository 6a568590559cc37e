//! What the window calls: an intent is executed, messages are taken in, and the actions that follow from either.

use mortise_protocol::message::DeviceState;

use super::advance::advance;
use super::intent::{Intent, obstacle};
use super::notes::Severity;
use super::state::Session;
use super::update::take;

impl Session {
    /// Executes an intent, or reports why it is not possible.
    pub fn act(&mut self, intent: Intent) {
        if let Some(reason) = obstacle(self, &intent) {
            self.notes.add(Severity::Warning, reason);
            return;
        }
        if !intent.is_passive() {
            self.tour = None;
        }
        self.watch_moves();
        self.perform(intent);
        self.follow();
    }

    /// Takes in the messages of other threads. Call it before each frame.
    pub fn poll(&mut self) {
        while let Ok(update) = self.inbox.try_recv() {
            if let Some(intent) = take(self, update) {
                self.act(intent);
            }
        }
        self.poll_instruction();
        self.poll_drag();
        self.follow();
    }

    /// Actions that follow from the state: history of moves; upload; next step of a demonstration.
    fn follow(&mut self) {
        self.watch_moves();
        // While the motors are on the parts move in every frame, and no step can be gone to.
        if let (false, Some(document)) = (self.is_armed(), &self.document) {
            self.sequencing.follow(document);
        }
        self.follow_energies();
        self.upload_if_due();
        self.seek_ways();
        advance(self);
    }

    /// Uploads the scene once document and board are present, and no part is being dragged.
    pub(super) fn upload_if_due(&mut self) {
        let ready = (self.document.as_ref()).is_some_and(|d| d.baked.is_some());
        if ready
            && self.moves.dragged().is_none()
            && !self.scene_is_on_board()
            && !self.scene_was_refused()
            && self.device() == Some(DeviceState::Idle)
            && obstacle(self, &Intent::Upload).is_none()
        {
            self.upload(false);
        }
    }
}
