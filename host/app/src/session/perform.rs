//! What each intent does.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use mortise_bake::{BakeOptions, Method, Request};
use mortise_guide::List;
use mortise_protocol::message::{DeviceState, HandScript, ToDevice};
use mortise_protocol::parameter::PARAMETERS;
use mortise_rig::{EmulatedMode, RigSpec};

use super::fitting::Fitting;
use super::intent::Intent;
use super::link::{self, Link};
use super::notes::Severity;
use super::project_file::is_project;
use super::purpose::Purpose;
use super::state::{GUIDE_CAP_N, Job, Session};
use super::tap::GuidanceCommand;
use super::threads::Cancel;
use super::tour::Tour;
use super::verdict::Verdict;
use super::work::{self, Wanted};

impl Session {
    /// Does what `intent` says, which must be possible.
    pub(super) fn perform(&mut self, intent: Intent) {
        match intent {
            Intent::Browse => self.ask_for_path(Purpose::OpenModel),
            Intent::Open(path) if is_project(&path) => self.read_project(path),
            Intent::Open(path) => self.open(Some(path)),
            Intent::OpenSample => self.open(None),
            Intent::Bake => self.bake(),
            Intent::ChooseMethod(method) => {
                let changed = std::mem::replace(&mut self.method, method) != method;
                if changed {
                    self.bake();
                }
            }
            Intent::CancelWork => {
                if let Some(job) = self.job.take() {
                    job.cancel.set();
                    self.notes.add(Severity::Info, "Cancelled");
                }
            }
            Intent::RefreshRigs => work::list_rigs(&self.outbox),
            Intent::ChooseRig(spec) => self.chosen = spec,
            Intent::Connect => self.connect(),
            Intent::Reconnect => {
                if let Some(lost) = &self.lost {
                    self.chosen = lost.spec.clone();
                    self.connect();
                }
            }
            Intent::Disconnect => self.disconnect(),
            // Asked for, it is sent again, also where the board has it.
            Intent::Upload => self.upload(true),
            Intent::CancelUpload => {
                if let Some(connection) = self.connection() {
                    connection.cancel_upload();
                }
            }
            Intent::Arm => self.request(ToDevice::Arm),
            Intent::Disarm => self.request(ToDevice::Disarm),
            Intent::Stop => self.stop(),
            Intent::ClearFault => self.request(ToDevice::ClearFault),
            Intent::Home => self.request(ToDevice::Home),
            Intent::Select(part) => self.select(part),
            Intent::SelectThese(parts) => self.select_these(&parts),
            Intent::SelectAlso(parts) => self.select_also(&parts),
            Intent::Group(intent) => self.perform_on_groups(&intent),
            Intent::Hide(part, hidden) => self.hide(part, hidden),
            Intent::Isolate(part) => self.isolate(part),
            Intent::ShowAll => self.show_all(),
            Intent::Grab(part) => self.grab(part),
            Intent::Release => self.request(ToDevice::Release),
            Intent::Lock(part, locks) => self.lock(part, locks),
            Intent::Clutch(intent) => self.clutch(intent),
            Intent::ResetScene => self.put_back(),
            Intent::Move(motion) => self.move_part(&motion),
            Intent::Undo => _ = self.rewind(true),
            Intent::Redo => _ = self.rewind(false),
            Intent::SetParameter(id, value) => self.set_parameter(id, value),
            Intent::ResetParameters => {
                for row in PARAMETERS {
                    if self.parameters[row.id as usize] != row.default {
                        self.set_parameter(row.id, row.default);
                    }
                }
            }
            Intent::PinTarget(id, pinned) => {
                self.fits.entry(id).or_default().pinned = pinned;
                self.command_guidance(GuidanceCommand::Pin(id, pinned));
            }
            Intent::SwitchTargetOff(id, off) => {
                self.fits.entry(id).or_default().off = off;
                self.command_guidance(GuidanceCommand::SwitchOff(id, off));
            }
            Intent::GuideWhen(when) => {
                self.guide.when = when;
                self.command_guidance(GuidanceCommand::Set(self.guide));
            }
            Intent::GuideCap(newton) => {
                if newton.is_finite() {
                    self.guide.force_cap_n = newton.clamp(*GUIDE_CAP_N.start(), *GUIDE_CAP_N.end());
                    self.command_guidance(GuidanceCommand::Set(self.guide));
                }
            }
            Intent::FitWith(part) => self.partner = part,
            Intent::FindFits => self.find_fits(),
            Intent::CancelFits => self.cancel_fits(),
            Intent::ChooseFit(number) => self.show_fit(|fitting, _| fitting.choose(number)),
            Intent::NextFit => self.show_fit(|fitting, _| fitting.choose_next()),
            Intent::TurnOver => self.show_fit(Fitting::turn_over),
            Intent::PlaceFit => self.place_fit(),
            Intent::FollowFit => self.follow_fit(),
            Intent::DropFits => self.drop_fits(),
            Intent::Energy(intent) => self.perform_on_energies(intent),
            Intent::FindSequence => self.find_sequence(),
            Intent::CancelSequence => self.sequencing.cancel(),
            Intent::SaveSteps => self.ask_for_path(Purpose::SaveSteps),
            Intent::WriteSteps { path, replace } => self.write_steps(path, replace),
            Intent::GoToStep { done, goes_on } => self.go_to_step(done, goes_on),
            Intent::SaveProject => self.ask_for_path(Purpose::SaveProject),
            Intent::WriteProject { path, replace } => self.write_project(path, replace),
            Intent::ForgetRecent(path) => self.preferences.recent.forget(&path),
            Intent::Fold { section, open } => _ = self.preferences.open.insert(section.to_owned(), open),
            Intent::ExportTraces(traces) => self.export(&traces),
            Intent::SaveTraces { path, replace } => self.save_traces(path, replace),
            Intent::Instruct(text) => self.instruct(&text),
            Intent::CancelInstruction => self.cancel_instruction(),
            Intent::Record => self.begin_recording(),
            Intent::EndRecording => self.end_recording(),
            Intent::Show(workspace) => self.show_workspace(workspace),
            Intent::Run(intent) => self.perform_on_run(intent),
            Intent::Rig(intent) => self.perform_on_rig(intent),
            Intent::Flash(intent) => self.perform_flashing(intent),
            Intent::Joint(intent) => self.perform_on_joints(intent),
            Intent::Connections(intent) => self.perform_on_connections(intent),
            Intent::PlayInsertion => self.tour = Some(Tour::from_the_rig()),
            Intent::Demo(rig) => self.demo(rig),
        }
    }

    pub(super) fn open(&mut self, path: Option<PathBuf>) {
        self.generation += 1;
        let name = path
            .as_ref()
            .and_then(|p| p.file_name())
            .map_or_else(|| "the sample".to_owned(), |n| n.to_string_lossy().into_owned());
        let limit = Duration::from_secs(mortise_brep::LoadOptions::default().time_limit_s);
        let cancel = self.start_job(format!("Reading {name}"), self.generation, Some(limit));
        let folder = self.keeper.folder.clone();
        work::import(&self.outbox, path, self.generation, folder, cancel);
    }

    pub(super) fn bake(&mut self) {
        let Some(document) = &mut self.document else {
            return;
        };
        document.baked = None;
        let (grouped, generation) = (Arc::clone(&document.grouped), document.generation);
        let mut slot = mortise_bake::SLOT_BYTES;
        if let Some(connection) = self.connection_mut() {
            slot = u64::from(connection.capabilities.scene_capacity);
            connection.scene_of = None;
            connection.refused_scene_of = None;
        }
        if self.guides_by_energy() {
            slot = slot.saturating_sub(self.energies.wanted_bytes());
        }
        let cancel = self.start_job("Baking the collision model".to_owned(), generation, None);
        let wanted = match self.method {
            Method::DistanceField => Wanted::Planned(Request {
                flash_bytes: slot,
                grabbable: grouped.grabbable(),
                ..Request::default()
            }),
            method => Wanted::Described(BakeOptions {
                method,
                image_limit_bytes: slot,
                grabbable: grouped.grabbable(),
                ..BakeOptions::default()
            }),
        };
        work::bake(
            &self.outbox,
            grouped,
            generation,
            wanted,
            self.cache.clone(),
            cancel,
        );
    }

    fn start_job(&mut self, doing: String, generation: u64, limit: Option<Duration>) -> Cancel {
        if let Some(job) = self.job.take() {
            job.cancel.set();
        }
        let cancel = Cancel::default();
        self.job = Some(Job {
            doing,
            fraction: None,
            since: Instant::now(),
            limit,
            generation,
            cancel: cancel.clone(),
        });
        cancel
    }

    fn connect(&mut self) {
        // With a rig, the parts are where it has them.
        self.close_run();
        self.link_id += 1;
        self.link = link::connect(&self.outbox, self.link_id, self.chosen.clone());
    }

    fn disconnect(&mut self) {
        let link = std::mem::replace(&mut self.link, Link::None);
        let name = match &link {
            Link::Connected(connection) => Some(connection.capabilities.board.to_string()),
            _ => None,
        };
        link.close(false);
        self.clear_board();
        self.rig_page.disconnected();
        if let Some(name) = name {
            self.notes
                .add(Severity::Info, format!("Disconnected from {name}"));
        }
    }

    /// Clears the state that only a connection provides; parts stay at their last known poses.
    pub(super) fn clear_board(&mut self) {
        self.telemetry = None;
        self.let_go();
        self.history.interrupt();
        self.recording_lost();
        self.guidance = List::default();
    }

    /// Clears the held part.
    pub(super) fn let_go(&mut self) {
        self.held = None;
        let verdict = self.document.as_mut().and_then(|d| d.watch.let_go());
        self.report(verdict);
    }

    /// Reports the outcome of an insertion as a message, and as a card until the next one.
    pub(super) fn report(&mut self, verdict: Option<Verdict>) {
        if let Some(verdict) = verdict {
            self.notes.add(verdict.severity(), verdict.to_string());
            self.verdict = Some(verdict);
        }
    }

    /// Starts guidance in the scene that is now on the board.
    pub(super) fn start_guidance(&mut self) {
        self.guidance = List::default();
        self.guide.sending = self.guides();
        if let (Some(connection), Some(document)) = (self.connection(), &self.document) {
            connection.guide(
                document,
                self.guide,
                &self.fits,
                self.ways.followed(),
                &self.outbox,
            );
        }
    }

    pub(super) fn command_guidance(&mut self, command: GuidanceCommand) {
        let taken = self.connection().is_none_or(|c| c.tap.command(command));
        if !taken && self.scene_is_on_board() {
            self.notes.add(Severity::Warning, "Guidance is busy: try again");
        }
    }

    /// Brings the scene onto the board: its parts alone where it is there already, unless as a `whole`.
    pub(super) fn upload(&mut self, whole: bool) {
        let Some(document) = &self.document else { return };
        let generation = document.generation;
        let (Some(baked), Some(placements)) = (document.baked.clone(), document.scene_placements()) else {
            return;
        };
        // A recording has no places but those of images.
        let whole = whole || self.recording.is_some();
        if let Some(connection) = self.connection_mut() {
            connection.send_scene(baked, placements, generation, whole);
        }
    }

    fn stop(&mut self) {
        match self.connection() {
            Some(connection) => {
                connection.stop(&self.outbox);
                self.notes.add(Severity::Error, "STOP: motors off");
            }
            None => self
                .notes
                .add(Severity::Info, "STOP: no rig is connected, nothing moves"),
        }
    }

    fn grab(&mut self, part: usize) {
        let Some(document) = &self.document else { return };
        let (together, scene_part) = (document.groups().together(part), document.scene_part(part));
        if self.selection() != together {
            self.select(Some(part));
        }
        // What is in hand is always seen.
        for part in together {
            self.hide(part, false);
        }
        let Some(scene_part) = scene_part else { return };
        if self.device() == Some(DeviceState::Active) {
            self.request(ToDevice::Release);
        }
        self.request(ToDevice::Grab { part: scene_part });
    }

    fn demo(&mut self, rig: Option<RigSpec>) {
        let rig = rig.unwrap_or_else(|| self.demo_rig());
        self.tour = Some(Tour::from_the_start(rig));
        if self.document.is_none() && self.job.is_none() {
            self.open(None);
        }
    }

    /// The emulated board if it is available, else the in-process simulation, with a message.
    fn demo_rig(&mut self) -> RigSpec {
        let emulated = RigSpec::Emulated {
            mode: EmulatedMode::Interactive,
            firmware: None,
        };
        let rigs = mortise_rig::list();
        match rigs.iter().find(|entry| entry.spec == emulated) {
            Some(entry) if entry.available.is_ok() => emulated,
            other => {
                let why = other.and_then(|entry| entry.available.clone().err());
                self.notes.add(
                    Severity::Warning,
                    format!(
                        "The emulated board is not available, so the simulation in this program is used: {}",
                        why.unwrap_or_else(|| "run `cargo xtask demo`".to_owned())
                    ),
                );
                RigSpec::Simulated { realtime: true }
            }
        }
    }

    pub(super) fn request(&self, message: ToDevice) {
        if let Some(connection) = self.connection() {
            connection.request(message);
        }
    }

    /// Moves the simulated hand, which has the scaled handle follow a script; no effect on a rig with a real one.
    pub fn move_hand(&mut self, script: HandScript) {
        self.tour = None;
        let script = self.for_handle(script);
        if let Some(connection) = self.connection_mut()
            && connection.capabilities.simulated
        {
            connection.set_hand(script);
        }
    }
}
