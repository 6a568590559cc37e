//! Shared helpers of the window tests: a window without a display, and an operator's first steps.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::DAffine3;
use mortise::folder_cache::FolderCache;
use mortise::kept::StateFolder;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session};
use mortise::ui::{Window, theme};
use mortise::viewport::compose::{Look, compose};
use mortise::viewport::picture::Item;
use mortise_protocol::message::DeviceState;
use mortise_rig::RigSpec;

/// Time limit for operations that take seconds: only a hang reaches it.
const PATIENCE: Duration = Duration::from_secs(300);

/// A window with nothing open.
pub fn harness() -> Harness<'static, Window> {
    harness_with(theme::apply)
}

/// A window whose egui context `setup` has configured.
pub fn harness_with(setup: impl FnOnce(&egui::Context) + 'static) -> Harness<'static, Window> {
    harness_of(Session::new(Arc::new(|| {})), setup)
}

/// A window with a cache, which all windows of this kind share and which stays for the next run of this program: what one has baked or made, others
/// read.
pub fn harness_with_cache() -> Harness<'static, Window> {
    let program = std::env::current_exe()
        .and_then(std::fs::read)
        .expect("this program");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("window-cache");
    let cache = FolderCache::new(folder, &program, 64 << 20);
    let session = Session::new(Arc::new(|| {}));
    harness_of(session.with_cache(Some(cache)), theme::apply)
}

/// A window that keeps what its user does in a folder.
pub fn harness_on(folder: &Path) -> Harness<'static, Window> {
    let session = Session::new(Arc::new(|| {}));
    let folder = StateFolder::at(folder.to_owned());
    harness_of(session.with_state(Some(folder)), theme::apply)
}

fn harness_of(session: Session, setup: impl FnOnce(&egui::Context) + 'static) -> Harness<'static, Window> {
    Harness::builder()
        .with_size(egui::vec2(1500.0, 940.0))
        .with_max_steps(1)
        .with_context_setup(setup)
        .build_ui_state(
            |ui, window: &mut Window| window.show(ui, None),
            Window::new(session),
        )
}

/// Draws frames until `done`.
pub fn until(harness: &mut Harness<'_, Window>, what: &str, done: impl Fn(&Session) -> bool) {
    let begun = Instant::now();
    loop {
        harness.step();
        if done(&harness.state().session) {
            return;
        }
        if begun.elapsed() > PATIENCE {
            let notes: Vec<_> = harness
                .state()
                .session
                .notes
                .iter()
                .map(|n| n.text.clone())
                .collect();
            panic!("never: {what}; messages: {notes:#?}");
        }
        // The longer it takes the less often it polls: each frame takes processor time from the work it waits for.
        std::thread::sleep(
            (begun.elapsed() / 20).clamp(Duration::from_millis(10), Duration::from_millis(60)),
        );
    }
}

/// Present poses of the parts, mm.
pub fn poses(harness: &Harness<'_, Window>) -> Vec<DAffine3> {
    let document = harness.state().session.document.as_ref();
    document.expect("open").poses.clone()
}

/// What is drawn: the parts, then what is beside them.
pub fn picture(harness: &Harness<'_, Window>) -> Vec<Item> {
    let window = harness.state();
    let document = window.session.document.as_ref().expect("open");
    let look = Look {
        camera: window.view.camera,
        ..Look::default()
    };
    compose(&window.session, document, &look).items
}

/// Presses a key.
pub fn press(harness: &mut Harness<'_, Window>, key: Key) {
    harness.key_press(key);
    harness.run_steps(2);
}

/// Texts of the window that begin like this: names of controls and pictures, and labels.
pub fn texts(harness: &Harness<'_, Window>, start: &str) -> Vec<String> {
    let root = harness.root();
    let texts = root.children_recursive().flat_map(|node| {
        let node = node.accesskit_node();
        [node.label(), node.value()]
    });
    texts.flatten().filter(|text| text.starts_with(start)).collect()
}

/// Clicks the control with this accessible name.
pub fn click(harness: &mut Harness<'_, Window>, label: &str) {
    harness.get_by_label(label).click();
    harness.step();
    harness.step();
}

/// Opens the sample and waits until it is baked.
pub fn open_sample(harness: &mut Harness<'_, Window>) {
    harness.step();
    click(harness, "Open the sample");
    until(harness, "the sample is baked", |s| {
        s.document.as_ref().is_some_and(|d| d.baked.is_some())
    });
}

/// Chooses the simulation, connects, and waits until the collision model is on the board.
pub fn connect(harness: &mut Harness<'_, Window>) {
    until(harness, "rigs are listed", |s| !s.rigs.is_empty());
    let simulation = RigSpec::Simulated { realtime: true };
    let entry = |s: &Session| s.rigs.iter().find(|r| r.spec == simulation).cloned();
    let entry = entry(&harness.state().session).expect("the simulation is in the list");
    click(harness, "Rig");
    click(harness, &entry.label);
    assert_eq!(harness.state().session.chosen, simulation);
    click(harness, "Connect");
    until(harness, "the scene is on the board", Session::scene_is_on_board);
}

/// The highest severity of all messages so far.
pub fn worst(session: &Session) -> Severity {
    session
        .notes
        .iter()
        .map(|n| n.severity)
        .max()
        .unwrap_or(Severity::Info)
}

/// Switches the motors on.
pub fn arm(harness: &mut Harness<'_, Window>) {
    click(harness, "Arm");
    until(harness, "armed", |s| s.device() == Some(DeviceState::Armed));
}

/// A window with the peg of the sample in hand.
pub fn holding() -> Harness<'static, Window> {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    arm(&mut harness);
    click(&mut harness, "peg");
    click(&mut harness, "Grab");
    until(&mut harness, "the peg is held", |s| s.grabbed() == Some(1));
    harness
}

/// Begins a recording with the collision model on the board; returns its file.
pub fn begin_recording(harness: &mut Harness<'_, Window>) -> PathBuf {
    click(harness, "Record");
    until(harness, "the recording", |s| {
        s.recording.is_some() && s.scene_is_on_board()
    });
    let recording = harness.state().session.recording.as_ref();
    recording.expect("just seen").path.clone()
}

/// Records while the simulated hand inserts the peg of the sample, which must be on the board; returns the file.
pub fn record_insertion(harness: &mut Harness<'_, Window>) -> PathBuf {
    let path = begin_recording(harness);
    click(harness, "Reset parts");
    arm(harness);
    click(harness, "peg");
    click(harness, "Grab");
    until(harness, "the peg is held", |s| s.grabbed() == Some(1));
    click(harness, "Play insertion");
    until(harness, "the verdict", |s| s.verdict.is_some());
    harness.state_mut().session.act(Intent::EndRecording);
    until(harness, "the end", |s| s.recording.is_none());
    path
}

/// A pseudo-terminal: its end for a board, the port for a program, and a handle that keeps it alive while no program has it open.
#[cfg(unix)]
pub fn terminal() -> (serialport::TTYPort, String, std::fs::File) {
    use serialport::SerialPort as _;

    let (mut master, slave) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    master.set_timeout(Duration::from_millis(20)).expect("a timeout");
    let port = slave.name().expect("it has a name");
    let held = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(&port)
        .expect("it opens");
    (master, port, held)
}
