//! A SpaceMouse in the running window, through a socket as the daemon spacenavd has it.

use std::io::Write as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Duration;

use crate::common::{click, harness, holding, open_sample, poses, until};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::ui::Window;
use mortise::ui::space_mouse::SpaceMouse;
use mortise::viewport::camera::View;
use mortise::viewport::six_axis::Use;
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
