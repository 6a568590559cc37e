//! A SpaceMouse in the running window, through a socket as the daemon spacenavd has it, and read directly.

use std::io::{self, ErrorKind, Write as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use crate::common::{click, harness, holding, open_sample, poses, until};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use mortise::session::notes::Severity;
use mortise::ui::Window;
use mortise::ui::space_mouse::{Event, Link, Source, SpaceMouse};
use mortise::viewport::camera::View;
use mortise::viewport::six_axis::{Deflection, Use};
use tempfile::TempDir;

const BUTTON: &str = "SpaceMouse moves the part";

/// The daemon of a window.
struct Daemon {
    link: UnixStream,
    _place: TempDir,
}

impl Daemon {
    /// Begins a daemon that the window of `harness` follows.
    fn of(harness: &mut Harness<'_, Window>) -> Self {
        let place = tempfile::tempdir().expect("temporary folder");
        let socket = place.path().join("spnav.sock");
        let listener = UnixListener::bind(&socket).expect("bound");
        let none = place.path().join("none.sock");
        let mouse = SpaceMouse::follow_at(&harness.ctx, vec![none, socket]);
        harness.state_mut().space_mouse = Some(mouse);
        let (link, _) = listener.accept().expect("the window connects");
        Self { link, _place: place }
    }

    fn send(&mut self, words: [i32; 8]) {
        let packet: Vec<u8> = words.into_iter().flat_map(i32::to_ne_bytes).collect();
        self.link.write_all(&packet).expect("sent");
    }

    /// Holds the cap at a deflection for some frames, then lets go of it.
    fn push(&mut self, harness: &mut Harness<'_, Window>, deflection: [i32; 6], frames: usize) {
        self.hold(harness, deflection, frames);
        self.send([0; 8]);
        settle(harness);
    }

    fn hold(&mut self, harness: &mut Harness<'_, Window>, [x, y, z, rx, ry, rz]: [i32; 6], frames: usize) {
        for _ in 0..frames {
            self.send([0, x, y, z, rx, ry, rz, 20]);
            std::thread::sleep(Duration::from_millis(20));
            harness.step();
        }
    }

    fn press(&mut self, harness: &mut Harness<'_, Window>, button: i32) {
        self.send([1, button, 0, 0, 0, 0, 0, 0]);
        self.send([2, button, 0, 0, 0, 0, 0, 0]);
        settle(harness);
    }
}

/// Draws frames until the window has taken in what was sent.
fn settle(harness: &mut Harness<'_, Window>) {
    for _ in 0..5 {
        std::thread::sleep(Duration::from_millis(20));
        harness.step();
    }
}

#[test]
fn the_cap_moves_the_view_and_its_buttons_choose() {
    let mut harness = harness();
    open_sample(&mut harness);
    harness.run_steps(2);
    assert!(harness.query_by_label(BUTTON).is_none(), "no device");
    let mut daemon = Daemon::of(&mut harness);
    settle(&mut harness);
    let _ = harness.get_by_label(BUTTON);
    harness.state_mut().view.camera.look(View::Front);
    let (camera, before) = (harness.state().view.camera, poses(&harness));
    daemon.push(&mut harness, [350, 0, 0, 0, 0, 0], 5);
    let by = harness.state().view.camera.target - camera.target;
    assert!(by.dot(camera.right()) < -1.0, "the scene goes right: {by}");
    let yaw = harness.state().view.camera.yaw;
    daemon.push(&mut harness, [0, 0, 0, 0, 350, 0], 5);
    assert_ne!(harness.state().view.camera.yaw, yaw);
    assert_eq!(poses(&harness), before);
    // The right button shows everything again.
    daemon.press(&mut harness, 1);
    harness.run_steps(40);
    let document = harness.state().session.document.as_ref().expect("open");
    let off = harness
        .state()
        .view
        .camera
        .target
        .distance(document.extent.center);
    assert!(off < 0.01 * document.extent.radius, "{off}");
    daemon.press(&mut harness, 0);
    assert_eq!(harness.state().view.six_axis.used, Use::Part);
    click(&mut harness, BUTTON);
    assert_eq!(harness.state().view.six_axis.used, Use::View);
    // Without the daemon the button goes.
    drop(daemon);
    settle(&mut harness);
    assert!(harness.query_by_label(BUTTON).is_none());
}

#[test]
fn the_cap_moves_the_selected_part_and_a_push_is_undone_as_one() {
    let mut harness = harness();
    open_sample(&mut harness);
    let mut daemon = Daemon::of(&mut harness);
    click(&mut harness, "peg");
    harness.state_mut().view.camera.look(View::Front);
    daemon.press(&mut harness, 0);
    let (before, camera) = (poses(&harness), harness.state().view.camera);
    daemon.hold(&mut harness, [0, 350, 0, 0, 0, 0], 5);
    let by = poses(&harness)[1].translation - before[1].translation;
    assert!(by.z > 1.0 && by.truncate().length() < 1e-9, "{by}");
    // Without the focus another program has the cap.
    harness.input_mut().focused = false;
    settle(&mut harness);
    let there = poses(&harness);
    daemon.hold(&mut harness, [0, 350, 0, 0, 0, 0], 5);
    assert_eq!(poses(&harness), there);
    harness.input_mut().focused = true;
    daemon.push(&mut harness, [0, 0, 0, 0, 0, 200], 5);
    assert_ne!(poses(&harness)[1].matrix3, there[1].matrix3, "turned");
    assert_eq!(harness.state().view.camera, camera);
    for expected in [&there, &before] {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
        harness.run_steps(2);
        assert_eq!(poses(&harness), *expected);
    }
}

#[test]
fn the_cap_moves_the_simulated_hand_and_presses_no_harder_than_its_lead() {
    let mut harness = holding();
    let mut daemon = Daemon::of(&mut harness);
    daemon.press(&mut harness, 0);
    harness.state_mut().view.camera.look(View::Front);
    let height = |harness: &Harness<'_, Window>| {
        let handle = harness.state().session.handle().expect("reported");
        handle.translation.z
    };
    let before = height(&harness);
    daemon.push(&mut harness, [0, 250, 0, 0, 0, 0], 30);
    until(&mut harness, "the hand went up", |session| {
        session
            .handle()
            .is_some_and(|handle| handle.translation.z > before + 1.0)
    });
    // Down against the block beside the hole, for long: 5 mm at the hand's 400 N/m.
    daemon.push(&mut harness, [250, 0, 0, 0, 0, 0], 25);
    daemon.hold(&mut harness, [0, -350, 0, 0, 0, 0], 120);
    let newest = harness
        .state()
        .session
        .history
        .newest()
        .map(|sample| sample.handle_n);
    assert!(
        newest.is_some_and(|force| (1.5..2.2).contains(&force)),
        "{newest:?}"
    );
    daemon.push(&mut harness, [0; 6], 1);
    let pressed = height(&harness);
    daemon.push(&mut harness, [0, 350, 0, 0, 0, 0], 15);
    until(&mut harness, "it comes back", |session| {
        session
            .handle()
            .is_some_and(|handle| handle.translation.z > pressed + 1.0)
    });
}

/// A device that is there once, and sends what the test does.
struct Plugged(Option<Receiver<Event>>);

impl Source for Plugged {
    fn open(&mut self) -> Result<Option<Box<dyn Link>>, String> {
        Ok(self.0.take().map(|sent| Box::new(Cable(sent)) as Box<dyn Link>))
    }
}

struct Cable(Receiver<Event>);

impl Link for Cable {
    fn read(&mut self, wait: Duration, events: &mut Vec<Event>) -> io::Result<()> {
        match self.0.recv_timeout(wait) {
            Ok(event) => events.push(event),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(ErrorKind::NotConnected.into()),
        }
        Ok(())
    }
}

/// A device that is there and may not be read.
struct Locked;

const REFUSAL: &str = "SpaceNavigator is plugged in but may not be read by you (/dev/hidraw3).";

impl Source for Locked {
    fn open(&mut self) -> Result<Option<Box<dyn Link>>, String> {
        Err(REFUSAL.into())
    }
}

#[test]
fn a_device_without_the_daemon_moves_the_view_and_one_that_may_not_be_read_is_stated() {
    let mut harness = harness();
    open_sample(&mut harness);
    let (device, sent) = channel();
    let sources: Vec<Box<dyn Source>> = vec![Box::new(Locked), Box::new(Plugged(Some(sent)))];
    let mouse = SpaceMouse::follow_sources(&harness.ctx, sources);
    harness.state_mut().space_mouse = Some(mouse);
    settle(&mut harness);
    let _ = harness.get_by_label(BUTTON);
    let _ = harness.get_by_label(REFUSAL);
    let notes = &harness.state().session.notes;
    let stated: Vec<_> = notes.iter().filter(|note| note.text == REFUSAL).collect();
    assert!(
        matches!(&stated[..], [one] if one.times == 1 && one.severity == Severity::Warning),
        "{stated:?}"
    );
    harness.state_mut().view.camera.look(View::Front);
    let camera = harness.state().view.camera;
    let push = Event::Deflected(Deflection {
        shift: DVec3::X,
        turn: DVec3::ZERO,
    });
    for _ in 0..5 {
        device.send(push).expect("read");
        std::thread::sleep(Duration::from_millis(20));
        harness.step();
    }
    let by = harness.state().view.camera.target - camera.target;
    assert!(by.dot(camera.right()) < -1.0, "the scene goes right: {by}");
    device.send(Event::Pressed(0)).expect("read");
    settle(&mut harness);
    assert_eq!(harness.state().view.six_axis.used, Use::Part);
    // It is unplugged in mid-push.
    drop(device);
    settle(&mut harness);
    assert!(harness.query_by_label(BUTTON).is_none());
    let there = harness.state().view.camera;
    settle(&mut harness);
    assert_eq!(harness.state().view.camera, there);
}
