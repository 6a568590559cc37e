//! The operator's intents and the reasons that block them.
//!
//! Single place of the decision: the window disables a button with the reason from [`obstacle`], and the session refuses for the same
//! reason.

use std::path::PathBuf;

use mortise_bake::Method;
use mortise_guide::When;
use mortise_mating::recognise::TargetId;
use mortise_protocol::message::DeviceState;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::RigSpec;

use super::clutch::ClutchIntent;
use super::energies::EnergyIntent;
use super::find_connections::ConnectionsIntent;
use super::finding::NO_FIT;
use super::flashing::FlashIntent;
use super::grouping::GroupIntent;
use super::joints::JointIntent;
use super::link::Link;
use super::moves::Motion;
use super::rig_page::RigIntent;
use super::runs::RunIntent;
use super::state::Session;
use super::workspace::Workspace;

/// An action that the operator requests.
#[derive(Clone, Debug, PartialEq)]
pub enum Intent {
    /// Show a workspace.
    Show(Workspace),
    /// Choose a file in a dialog.
    Browse,
    /// Open a file.
    Open(PathBuf),
    /// Open the sample.
    OpenSample,
    /// Bake the scene (again).
    Bake,
    /// Choose the contact method; bakes the open scene again.
    ChooseMethod(Method),
    /// Cancel the reading or baking under way.
    CancelWork,
    /// Search for rigs again.
    RefreshRigs,
    /// Choose which rig to connect to.
    ChooseRig(RigSpec),
    /// Connect to the chosen rig.
    Connect,
    /// Reconnect to the rig whose link was lost.
    Reconnect,
    /// Disconnect the rig.
    Disconnect,
    /// Upload the scene to the board.
    Upload,
    /// Cancel the upload under way; the scene in use stays.
    CancelUpload,
    /// Motors on.
    Arm,
    /// Motors off.
    Disarm,
    /// Motors off now.
    Stop,
    /// Leave the stopped or faulted state.
    ClearFault,
    /// Declare that the handle is at its marked pose.
    Home,
    /// Select a part in the list and the view.
    Select(Option<usize>),
    /// Select these parts, the first one to act on.
    SelectThese(Vec<usize>),
    /// Add parts to the selection, or take them out where all of them are in it.
    SelectAlso(Vec<usize>),
    /// An action on groups of parts.
    Group(GroupIntent),
    /// Hide a part in the view, or show it again.
    Hide(usize, bool),
    /// Hide all parts but this one, those selected with it, and the held ones.
    Isolate(usize),
    /// Show every part.
    ShowAll,
    /// Grab a part.
    Grab(usize),
    /// Lock a part to the ground, or let it free.
    Lock(usize, bool),
    /// Release the held part.
    Release,
    /// Let the held part stay while the handle moves, and hold it again.
    Clutch(ClutchIntent),
    /// Move every part back to its position in the file.
    ResetScene,
    /// Move a part by keys or numbers.
    Move(Motion),
    /// Undo the last move of parts, whatever made it.
    Undo,
    /// Redo the move undone last.
    Redo,
    /// Change a parameter.
    SetParameter(ParameterId, f32),
    /// Reset every parameter to its default.
    ResetParameters,
    /// Pin a recognised target, which keeps it in the list and gives it priority, or unpin it.
    PinTarget(TargetId, bool),
    /// Switch a recognised target off, or on again.
    SwitchTargetOff(TargetId, bool),
    /// Choose when targets may engage.
    GuideWhen(When),
    /// Set the largest guidance force, N.
    GuideCap(f32),
    /// Find fits with a part, or with the nearest ones.
    FitWith(Option<usize>),
    /// Find the fits of the held or selected part.
    FindFits,
    /// End the search for fits; what was found stays.
    CancelFits,
    /// Show the fit of this number.
    ChooseFit(usize),
    /// Show the next fit.
    NextFit,
    /// Show the fit in which the part goes in the other way round.
    TurnOver,
    /// Put the part into the fit that is shown.
    PlaceFit,
    /// Let guidance follow the way of the fit that is shown, or no longer.
    FollowFit,
    /// Show no fits any more.
    DropFits,
    /// An action on geometric energies.
    Energy(EnergyIntent),
    /// Find the steps in which the assembly goes together.
    FindSequence,
    /// Cancel the search for them.
    CancelSequence,
    /// Ask for the file for a report of the steps.
    SaveSteps,
    /// Write a report of the steps.
    WriteSteps {
        /// File to write.
        path: PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Put the parts where they are after so many of these steps.
    GoToStep {
        /// Number of steps done, with a share of the next one.
        done: f64,
        /// Whether it goes on with the motion before, as while a slider is dragged.
        goes_on: bool,
    },
    /// Ask where to write the project.
    SaveProject,
    /// Write the project.
    WriteProject {
        /// File to write.
        path: PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Take a file out of the list of recent ones.
    ForgetRecent(PathBuf),
    /// Keep whether a section of the window is open.
    Fold {
        /// Name of the section.
        section: &'static str,
        /// Whether it is open.
        open: bool,
    },
    /// Make a table of traces, and ask where to write it.
    ExportTraces(Traces),
    /// Write that table.
    SaveTraces {
        /// File to write.
        path: PathBuf,
        /// Whether an existing file may be replaced.
        replace: bool,
    },
    /// Carry out an instruction in plain words.
    Instruct(String),
    /// Cancel the instruction under way.
    CancelInstruction,
    /// Record everything that crosses the link, to a new file.
    Record,
    /// End the recording.
    EndRecording,
    /// An action on recorded runs.
    Run(RunIntent),
    /// An action on the page on the rig.
    Rig(RigIntent),
    /// An action on the firmware of a board.
    Flash(FlashIntent),
    /// An action on the joints of a part.
    Joint(JointIntent),
    /// An action on the connections of the parts.
    Connections(ConnectionsIntent),
    /// Let the simulated hand insert the peg into the hole.
    PlayInsertion,
    /// Run everything from the sample to the insertion automatically. `None`: the emulated board if it is available, else in-process.
    Demo(Option<RigSpec>),
}

impl Intent {
    /// Whether the intent changes nothing on a rig and so never interrupts a running demonstration.
    pub fn is_passive(&self) -> bool {
        matches!(
            self,
            Self::Select(_)
                | Self::SelectThese(_)
                | Self::SelectAlso(_)
                | Self::Hide(..)
                | Self::Isolate(_)
                | Self::ShowAll
                | Self::RefreshRigs
                | Self::SetParameter(..)
                | Self::ResetParameters
                | Self::PinTarget(..)
                | Self::SwitchTargetOff(..)
                | Self::GuideWhen(_)
                | Self::GuideCap(_)
                | Self::FitWith(_)
                | Self::FindFits
                | Self::CancelFits
                | Self::ChooseFit(_)
                | Self::NextFit
                | Self::TurnOver
                | Self::FollowFit
                | Self::DropFits
                | Self::Energy(_)
                | Self::SaveSteps
                | Self::WriteSteps { .. }
                | Self::SaveProject
                | Self::WriteProject { .. }
                | Self::ForgetRecent(_)
                | Self::Fold { .. }
                | Self::ExportTraces(_)
                | Self::SaveTraces { .. }
                | Self::CancelInstruction
                | Self::Record
                | Self::EndRecording
                | Self::Run(_)
                | Self::Joint(_)
                | Self::Connections(_)
                | Self::Show(_)
                | Self::Rig(RigIntent::Draw(_))
                | Self::Demo(_)
        )
    }
}

/// Traces to be exported.
#[derive(Clone, Debug, PartialEq)]
pub struct Traces {
    /// Times in the history, s: from, to.
    pub range_s: [f64; 2],
    /// Keys of the signals.
    pub keys: Vec<&'static str>,
}

const NO_RIG: &str = "No rig is connected";
const NO_FILE: &str = "No file is open";

/// Why `intent` is not possible now (blocked reason), as a sentence; `None` when it is possible. [`Intent::Stop`] always is.
pub fn obstacle(session: &Session, intent: &Intent) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let armed = session.is_armed();
    match intent {
        Intent::Stop
        | Intent::RefreshRigs
        | Intent::Select(_)
        | Intent::SelectThese(_)
        | Intent::SelectAlso(_)
        | Intent::GuideWhen(_)
        | Intent::GuideCap(_)
        | Intent::FitWith(_)
        | Intent::DropFits
        | Intent::ForgetRecent(_)
        | Intent::Show(_)
        | Intent::Fold { .. } => None,
        Intent::Browse | Intent::Open(_) | Intent::OpenSample => {
            armed.then(|| "The rig is armed: disarm it before another file is opened".to_owned())
        }
        Intent::Demo(_) => armed.then(|| "The rig is armed: disarm it first".to_owned()),
        Intent::Bake => match &session.document {
            None => no(NO_FILE),
            Some(_) if session.is_busy() => no("Work is under way"),
            Some(_) if armed => no("The rig is armed: disarm it first"),
            Some(_) => None,
        },
        Intent::ChooseMethod(_) if session.is_busy() => no("Work is under way"),
        Intent::ChooseMethod(_) => {
            armed.then(|| "The rig is armed: disarm it before the collision model is baked again".to_owned())
        }
        Intent::CancelWork => (!session.is_busy()).then(|| "Nothing is under way".to_owned()),
        Intent::ChooseRig(_) => match session.link {
            Link::None => None,
            _ => no("Disconnect first"),
        },
        Intent::Connect => connect(session),
        Intent::Reconnect => match (&session.lost, &session.link) {
            (None, _) => no("No link was lost"),
            (Some(_), Link::None) => None,
            (Some(_), _) => no("Connecting"),
        },
        Intent::Disconnect => match session.link {
            Link::None => no(NO_RIG),
            _ => None,
        },
        Intent::Upload => upload(session),
        Intent::CancelUpload => match session.connection() {
            Some(connection) if connection.upload.is_some() => None,
            _ => no("No upload is under way"),
        },
        Intent::Arm => arm(session),
        Intent::Disarm => match session.device() {
            None => no(NO_RIG),
            Some(_) if armed => None,
            Some(_) => no("The motors are off"),
        },
        Intent::ClearFault => match session.device() {
            None => no(NO_RIG),
            Some(DeviceState::Stopped | DeviceState::Fault(_)) => None,
            Some(_) => no("Nothing is stopped"),
        },
        Intent::Home => match session.device() {
            None => no(NO_RIG),
            Some(_) if armed => no("Only while the motors are off: disarm first"),
            Some(_) => None,
        },
        Intent::Group(intent) => session.no_grouping(intent),
        Intent::Hide(part, true) if session.is_held(*part) => no("It is held: release it first"),
        Intent::Hide(..) | Intent::Isolate(_) => session.document.is_none().then(|| NO_FILE.to_owned()),
        Intent::ShowAll => match &session.document {
            None => no(NO_FILE),
            Some(document) if !document.hidden.contains(&true) => no("No part is hidden"),
            Some(_) => None,
        },
        Intent::Grab(part) => grab(session, *part),
        Intent::Lock(part, locks) => session.no_locking(*part, *locks),
        Intent::Clutch(intent) => session.no_clutch(*intent),
        Intent::Release => match session.device() {
            None => no(NO_RIG),
            Some(DeviceState::Active) => None,
            Some(_) => no("No part is held"),
        },
        Intent::ResetScene if session.replays() => no("A recorded run is shown: close it first"),
        Intent::ResetScene => match session.device() {
            // Without a board the parts are where the window has them.
            None if session
                .document
                .as_ref()
                .is_some_and(|d| d.poses != d.file_poses()) =>
            {
                None
            }
            None => no(NO_RIG),
            Some(_) if armed => no("Only while the motors are off: disarm first"),
            Some(_) if !session.scene_is_on_board() => no("The collision model is not on the board"),
            Some(_) => None,
        },
        Intent::Move(motion) => session.no_moving(motion.part),
        Intent::Undo => session.no_rewinding(true),
        Intent::Redo => session.no_rewinding(false),
        Intent::SetParameter(..) | Intent::ResetParameters => {
            session.connection().is_none().then(|| NO_RIG.to_owned())
        }
        Intent::PinTarget(id, _) | Intent::SwitchTargetOff(id, _) => {
            let listed = session.guidance.rows.iter().any(|row| row.target.id == *id);
            match session.connection() {
                None => no(NO_RIG),
                Some(_) if !listed => no("This target is no longer in the list"),
                Some(_) => None,
            }
        }
        Intent::FindFits
        | Intent::CancelFits
        | Intent::ChooseFit(_)
        | Intent::NextFit
        | Intent::TurnOver
        | Intent::FollowFit
        | Intent::PlaceFit => fits(session, intent),
        Intent::FindSequence
        | Intent::CancelSequence
        | Intent::SaveSteps
        | Intent::WriteSteps { .. }
        | Intent::GoToStep { .. } => sequence(session, intent),
        Intent::SaveProject | Intent::WriteProject { .. } => {
            session.document.is_none().then(|| NO_FILE.to_owned())
        }
        Intent::ExportTraces(traces) if traces.keys.is_empty() => no("No signal is chosen"),
        Intent::ExportTraces(_) => session
            .shown_history()
            .is_empty()
            .then(|| "Nothing was recorded yet: connect a rig".to_owned()),
        Intent::SaveTraces { .. } => session
            .table
            .is_none()
            .then(|| "No traces are to be written".to_owned()),
        Intent::Instruct(text) => instruct(session, text),
        Intent::CancelInstruction => {
            (session.instructions.under_way().is_none()).then(|| "No instruction is under way".to_owned())
        }
        Intent::Record | Intent::EndRecording => record(session, intent),
        Intent::Run(intent) => session.no_run_action(intent),
        Intent::Rig(intent) => session.no_rig_action(intent),
        Intent::Flash(intent) => session.no_flashing(intent),
        Intent::Joint(intent) => session.no_joint_action(intent),
        Intent::Connections(intent) => session.no_connections_action(*intent),
        Intent::Energy(intent) => session.no_energy_action(*intent),
        Intent::PlayInsertion => play(session),
    }
}

fn fits(session: &Session, intent: &Intent) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let fitting = session.fitting.as_ref();
    let shown = fitting.filter(|fitting| fitting.offer().is_some());
    match intent {
        Intent::FindFits => session.no_search(),
        Intent::PlaceFit => session.no_placing(),
        Intent::FollowFit => session.no_following(),
        Intent::CancelFits => match fitting.and_then(|fitting| fitting.search.as_ref()) {
            None => no("No search for fits is under way"),
            Some(_) => None,
        },
        Intent::TurnOver => match shown.zip(session.document.as_ref()) {
            None => no(NO_FIT),
            Some((fitting, document)) if fitting.turned_over(document).is_none() => {
                no("In no fit that was found the part goes in the other way round")
            }
            Some(_) => None,
        },
        _ => shown.is_none().then(|| NO_FIT.to_owned()),
    }
}

fn sequence(session: &Session, intent: &Intent) -> Option<String> {
    let sequencing = &session.sequencing;
    let reason = match (&session.document, intent) {
        (None, _) => NO_FILE,
        (Some(_), Intent::CancelSequence) if sequencing.since().is_none() => "No search is under way",
        (Some(_), Intent::CancelSequence) => return None,
        (Some(_), Intent::FindSequence) if sequencing.since().is_some() => "The search is under way",
        (Some(document), Intent::FindSequence) if document.model.parts.len() < 2 => "One part is no assembly",
        (Some(_), Intent::FindSequence) => return None,
        (Some(document), _) if sequencing.found(document).is_none() => "Find the steps first",
        (Some(_), Intent::SaveSteps | Intent::WriteSteps { .. }) => return None,
        _ => session.no_move()?,
    };
    Some(reason.to_owned())
}

fn connect(session: &Session) -> Option<String> {
    match &session.link {
        Link::Connecting { .. } => return Some("Connecting".to_owned()),
        Link::Connected(_) => return Some("A rig is connected".to_owned()),
        Link::None => {}
    }
    let entry = session.rigs.iter().find(|entry| entry.spec == session.chosen);
    entry.and_then(|entry| entry.available.clone().err())
}

fn upload(session: &Session) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let Some(document) = &session.document else {
        return no(NO_FILE);
    };
    let Some(connection) = session.connection() else {
        return no(NO_RIG);
    };
    if document.baked.is_none() {
        return no("The collision model is not baked yet");
    }
    if connection.upload.is_some() {
        return no("The collision model is being uploaded");
    }
    session
        .is_armed()
        .then(|| "Only while the motors are off: disarm first".to_owned())
}

fn arm(session: &Session) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let Some(connection) = session.connection() else {
        return no(NO_RIG);
    };
    match connection.state {
        DeviceState::Armed | DeviceState::Active => return no("The rig is armed"),
        DeviceState::Homing => return no("Bring the handle to its marked pose and set the reference first"),
        DeviceState::Stopped => return no("Stopped: clear the stop first"),
        DeviceState::Fault(_) => return no("Fault: see the messages, then clear it"),
        DeviceState::Boot | DeviceState::SoftStop | DeviceState::Testing => {
            return no("Wait until the board is idle");
        }
        DeviceState::Idle => {}
    }
    if session.document.is_none() {
        return no("Open a STEP file first: without it the window cannot show the parts");
    }
    if !session.scene_is_on_board() {
        return no("The collision model is not on the board yet");
    }
    None
}

fn grab(session: &Session, part: usize) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let Some(document) = &session.document else {
        return no(NO_FILE);
    };
    match session.device() {
        None => return no(NO_RIG),
        Some(DeviceState::Armed | DeviceState::Active) => {}
        Some(_) => return no("Arm the rig first"),
    }
    if !document.is_grabbable(part) {
        return no("This part is locked to the ground: unlock it below the list of parts");
    }
    session.is_held(part).then(|| "It is held".to_owned())
}

fn play(session: &Session) -> Option<String> {
    let no = |reason: &str| Some(reason.to_owned());
    let Some(document) = &session.document else {
        return no(NO_FILE);
    };
    if document.insertion.is_none() {
        return no("This assembly has no peg in front of a hole");
    }
    if session.is_touring() {
        return no("It is already running");
    }
    let Some(connection) = session.connection() else {
        return no(NO_RIG);
    };
    if !connection.capabilities.simulated {
        return no("This rig has a real handle: move it yourself");
    }
    match connection.state {
        DeviceState::Stopped | DeviceState::Fault(_) => no("Stopped: clear the stop first"),
        _ if !session.scene_is_on_board() => no("The collision model is not on the board yet"),
        _ => None,
    }
}

/// Why no instruction can be carried out now.
fn instruct(session: &Session, text: &str) -> Option<String> {
    let reason = if session.document.is_none() {
        NO_FILE
    } else if text.trim().is_empty() {
        "Write an instruction first"
    } else if session.instructions.under_way().is_some() {
        "An instruction is under way"
    } else {
        session.no_move()?
    };
    Some(reason.to_owned())
}

/// Why a recording cannot begin or end now.
fn record(session: &Session, intent: &Intent) -> Option<String> {
    let reason = match (session.connection(), &session.recording) {
        (None, _) => NO_RIG,
        (Some(_), Some(_)) if *intent == Intent::Record => "A recording is under way",
        (Some(_), None) if *intent == Intent::EndRecording => "Nothing is being recorded",
        _ => return None,
    };
    Some(reason.to_owned())
}
