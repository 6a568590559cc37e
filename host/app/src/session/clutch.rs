//! The clutch: while it is open the held part stays where it is and the handle moves alone, so that the handle comes back to the middle of its reach; when it closes, the
//! part is held again where both are. The board anchors its coupling at each grab, so that nothing jumps.

use mortise_protocol::message::ToDevice;

use super::state::Session;

/// An action of the operator on the clutch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClutchIntent {
    /// Let the held part stay where it is.
    Open,
    /// Hold it again.
    Close,
    /// Leave it where it is.
    Leave,
}

impl Session {
    /// The part that is held again when the clutch closes, while it is open.
    pub fn clutched(&self) -> Option<usize> {
        self.clutched.filter(|_| self.is_armed())
    }

    /// Why the clutch cannot be used now, as a sentence.
    pub(super) fn no_clutch(&self, intent: ClutchIntent) -> Option<String> {
        match (intent, self.clutched()) {
            (ClutchIntent::Open, Some(_)) => Some("The clutch is open".to_owned()),
            (ClutchIntent::Open, None) if self.grabbed().is_none() => Some("No part is held".to_owned()),
            (ClutchIntent::Open, None) => None,
            (ClutchIntent::Close | ClutchIntent::Leave, None) => Some("The clutch is closed".to_owned()),
            (ClutchIntent::Close | ClutchIntent::Leave, Some(_)) => None,
        }
    }

    pub(super) fn clutch(&mut self, intent: ClutchIntent) {
        match intent {
            ClutchIntent::Open => {
                self.clutched = self.grabbed();
                self.request(ToDevice::Release);
            }
            ClutchIntent::Close => {
                let part = self
                    .clutched()
                    .and_then(|part| self.document.as_ref()?.scene_part(part));
                self.clutched = None;
                if let Some(part) = part {
                    self.request(ToDevice::Grab { part });
                }
            }
            ClutchIntent::Leave => self.clutched = None,
        }
    }
}
