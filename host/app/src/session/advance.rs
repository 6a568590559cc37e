//! Progress of the automatic insertion.
//!
//! A sequence of waits: each step continues when the board reports its completion. Any refusal, stop or fault ends it.

use mortise_protocol::message::{DeviceState, ToDevice};

use super::insertion::{Manner, script};
use super::intent::Intent;
use super::notes::Severity;
use super::state::Session;
use super::tour::{Step, Tour};

/// Advances as far as possible. Call it after every message.
pub fn advance(session: &mut Session) {
    while let Some(tour) = session.tour.clone() {
        if tour.is_stuck() {
            session.tour = None;
            session.notes.add(
                Severity::Warning,
                "The demonstration ended: the board did not respond in time",
            );
            return;
        }
        match session.device() {
            Some(DeviceState::Stopped | DeviceState::Fault(_)) => {
                session.tour = None;
                return;
            }
            None if !matches!(tour.step, Step::Connect(_) | Step::Scene) => {
                session.tour = None;
                return;
            }
            _ => {}
        }
        let Some(next) = step(session, &tour) else { return };
        session.tour = next;
    }
}

/// Executes one step. `None`: wait; `Some(None)`: finished; otherwise the next step.
fn step(session: &mut Session, tour: &Tour) -> Option<Option<Tour>> {
    let ask = |session: &mut Session, message: ToDevice| {
        if !tour.asked {
            if let Some(connection) = session.connection() {
                connection.request(message);
            }
            session.tour = Some(tour.with_request_sent());
        }
    };
    match &tour.step {
        Step::Connect(rig) => {
            session.document.as_ref()?.baked.as_ref()?;
            if session.connection().is_none() && !tour.asked {
                session.chosen = rig.clone();
                session.tour = Some(tour.with_request_sent());
                session.perform(Intent::Connect);
            }
            session.connection()?;
            Some(Some(Tour::at(Step::Scene)))
        }
        Step::Scene => {
            if !session.scene_is_on_board() {
                return None;
            }
            if !session.connection()?.capabilities.simulated {
                // On a rig with a real handle, only the person at the handle arms the motors.
                session.notes.add(
                    Severity::Info,
                    "The collision model is on the board: take the handle, arm, and grab a part",
                );
                return Some(None);
            }
            Some(Some(Tour::at(Step::PutBack)))
        }
        Step::PutBack => {
            if session.is_armed() {
                ask(session, ToDevice::Disarm);
                return None;
            }
            if session.device() != Some(DeviceState::Idle) {
                return None;
            }
            if session.document.as_ref()?.is_placed() {
                // The insertion begins where the file has the parts; a scene with them there is uploaded.
                session.put_back();
            }
            session.scene_is_on_board().then(|| Some(Tour::at(Step::Arm)))
        }
        Step::Arm => {
            if session.device() == Some(DeviceState::Idle) {
                if !tour.asked {
                    session.put_back();
                }
                ask(session, ToDevice::Arm);
                return None;
            }
            (session.device() == Some(DeviceState::Armed)).then(|| Some(Tour::at(Step::Grab)))
        }
        Step::Grab => {
            let document = session.document.as_ref()?;
            let moving = document.insertion.as_ref()?.moving;
            let part = document.scene_part(moving)?;
            if !session.is_held(moving) {
                ask(session, ToDevice::Grab { part });
                return None;
            }
            Some(Some(Tour::at(Step::Play)))
        }
        Step::Play => {
            let insertion = session.document.as_ref()?.insertion?;
            let hand = script(&insertion, &session.scaled_handle()?, &Manner::default());
            session.move_hand(hand);
            session.notes.add(
                Severity::Info,
                format!(
                    "The simulated hand inserts the peg into the hole: {:.0} mm, {:.2} mm clearance",
                    insertion.travel_mm, insertion.clearance_mm
                ),
            );
            Some(None)
        }
    }
}
