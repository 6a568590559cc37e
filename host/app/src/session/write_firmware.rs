//! Writing firmware to a board through a debug probe, beside the window's thread.

use mortise_flash::{Firmware, Prober};

use super::flashing::{FlashIntent, FlashUpdate};
use super::intent::Intent;
use super::notes::Severity;
use super::outbox::{Outbox, Update};
use super::purpose::Purpose;
use super::state::Session;
use super::threads::{Cancel, spawn};

impl Session {
    /// Why an action is not possible now, as a sentence.
    pub(super) fn no_flashing(&self, intent: &FlashIntent) -> Option<String> {
        let writing = self.flashing.writing.is_some();
        let reason = match intent {
            FlashIntent::End if writing => return None,
            FlashIntent::End => "No firmware is being written",
            _ if writing => "Firmware is being written",
            FlashIntent::Browse | FlashIntent::Choose(_) => return None,
            FlashIntent::Write if self.is_armed() => "The rig is armed: disarm it first",
            FlashIntent::Write => match &self.flashing.firmware {
                Some(Ok(_)) => return None,
                Some(Err(_)) => "Choose another file first",
                None => "Choose the file of the firmware first",
            },
        };
        Some(reason.to_owned())
    }

    pub(super) fn perform_flashing(&mut self, intent: FlashIntent) {
        match intent {
            FlashIntent::Browse => self.ask_for_path(Purpose::OpenFirmware),
            FlashIntent::Choose(path) => self.flashing.choose(&path),
            FlashIntent::Write => self.write_firmware(),
            FlashIntent::End => {
                if let Some((_, cancel)) = &self.flashing.writing {
                    cancel.set();
                }
            }
        }
    }

    fn write_firmware(&mut self) {
        let Some(Ok(firmware)) = self.flashing.firmware.clone() else {
            return;
        };
        // The board restarts: its link ends first, in order.
        if (self.connection()).is_some_and(|connection| !connection.capabilities.simulated) {
            self.act(Intent::Disconnect);
        }
        let cancel = Cancel::default();
        self.flashing.writing = Some(("Looking for the debug probe".to_owned(), cancel.clone()));
        let (outbox, prober) = (self.outbox.clone(), self.flashing.prober.clone());
        spawn("mortise-flash", move || {
            let result = write(&outbox, prober, &firmware, &cancel);
            outbox.send(Update::Flashing(FlashUpdate::Ended(result)));
        });
    }

    pub(super) fn flashed(&mut self, update: FlashUpdate) {
        match update {
            FlashUpdate::Line(line) => {
                if let Some((said, _)) = &mut self.flashing.writing {
                    *said = line;
                }
            }
            FlashUpdate::Ended(result) => {
                self.flashing.writing = None;
                match result {
                    Ok(words) => {
                        self.notes.add(Severity::Good, words);
                        self.act(Intent::RefreshRigs);
                    }
                    Err(why) => self.notes.add(Severity::Error, why),
                }
            }
        }
    }
}

fn write(
    outbox: &Outbox,
    prober: Option<Prober>,
    firmware: &Firmware,
    cancel: &Cancel,
) -> Result<String, String> {
    let write = || {
        let prober = prober.map_or_else(Prober::find, Ok)?;
        let probe = prober.choose(None)?;
        let mut say = |line: &str| {
            outbox.send(Update::Flashing(FlashUpdate::Line(line.to_owned())));
        };
        prober.write(firmware, &probe, &mut say, &mut || cancel.is_set())
    };
    match write() {
        Ok(()) => Ok(format!(
            "{} has its firmware and has started again: connect it",
            firmware.board()
        )),
        Err(error) => Err(error.to_string()),
    }
}
