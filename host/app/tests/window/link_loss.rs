//! A lost link in the window: reported once, with the reason, and with a button that reconnects. The board is simulated behind a
//! pseudo-terminal, whose cable can be cut.

use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::{arm, click, harness, open_sample, terminal, until};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session};
use mortise::ui::Window;
use mortise_protocol::message::{DeviceState, ToDevice};
use mortise_rig::{Client, Flash, RigSpec, Transport, simulate};
use serialport::SerialPort as _;

/// Longest wait for the board's next ticks on a busy computer; on an idle one they come within 1 ms.
const STOPPED_WITHIN: Duration = Duration::from_secs(2);

/// A cable between a pseudo-terminal and a simulated board: copies bytes both ways, and none while it is cut.
struct Cable {
    over: Arc<AtomicBool>,
    cut: Arc<AtomicBool>,
    port: String,
    threads: Vec<std::thread::JoinHandle<()>>,
    /// Keeps the terminal alive while no program has it open.
    _slave: std::fs::File,
}

fn copy(mut from: Box<dyn Read + Send>, mut to: Box<dyn Write + Send>, over: &AtomicBool, cut: &AtomicBool) {
    let mut bytes = [0; 256];
    while !over.load(Ordering::Relaxed) {
        match from.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) if !cut.load(Ordering::Relaxed) => {
                if to.write_all(&bytes[..count]).is_err() {
                    return;
                }
            }
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(_) => return,
        }
    }
}

impl Cable {
    fn new() -> Self {
        let (master, port, held) = terminal();
        let Transport { reader, writer, keep } = simulate(&Flash::default(), true).expect("a thread");
        let (over, cut) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let from_host: Box<dyn Read + Send> = master.try_clone().expect("a handle");
        let ends: [(Box<dyn Read + Send>, Box<dyn Write + Send>); 2] =
            [(from_host, writer), (reader, Box::new(master))];
        let mut threads: Vec<_> = ends
            .into_iter()
            .map(|(from, to)| {
                let (over, cut) = (over.clone(), cut.clone());
                std::thread::spawn(move || copy(from, to, &over, &cut))
            })
            .collect();
        // The board ends when both of its pipes are dropped.
        threads.push(std::thread::spawn(move || drop(keep)));
        Self {
            over,
            cut,
            port,
            threads,
            _slave: held,
        }
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            thread.join().expect("it ends");
        }
    }
}

/// A window with the sample on the board behind a cable, armed.
fn armed(cable: &Cable) -> (Harness<'static, Window>, RigSpec) {
    let mut harness = harness();
    open_sample(&mut harness);
    let spec: RigSpec = cable.port.parse().expect("a port's name");
    harness.state_mut().session.act(Intent::ChooseRig(spec.clone()));
    click(&mut harness, "Connect");
    until(
        &mut harness,
        "the scene is on the board",
        Session::scene_is_on_board,
    );
    arm(&mut harness);
    (harness, spec)
}

fn errors(session: &Session) -> Vec<String> {
    (session.notes.iter())
        .filter(|note| note.severity == Severity::Error)
        .flat_map(|note| vec![note.text.clone(); note.times as usize])
        .collect()
}

#[test]
fn a_lost_link_is_reported_once_with_its_reason_and_reconnect_mends_it() {
    let cable = Cable::new();
    let (mut harness, spec) = armed(&cable);
    assert_eq!(errors(&harness.state().session), [""; 0]);

    cable.cut.store(true, Ordering::Relaxed);
    // Requests under way when the link is lost must not be reported separately.
    harness.state_mut().session.act(Intent::Disarm);
    until(&mut harness, "the loss is noticed", |s| s.lost.is_some());
    // Time for pending requests to be reported.
    for _ in 0..100 {
        harness.step();
        std::thread::sleep(Duration::from_millis(10));
    }
    let session = &harness.state().session;
    let reported = errors(session);
    assert_eq!(reported.len(), 1, "{reported:#?}");
    assert!(reported[0].contains("nothing was received for"), "{reported:?}");
    assert_eq!(session.device(), None);
    harness.get_by_label("Link lost");
    // Once in the card and once among the messages.
    assert_eq!(
        harness
            .get_all_by_label_contains("nothing was received for")
            .count(),
        2
    );

    cable.cut.store(false, Ordering::Relaxed);
    click(&mut harness, "Reconnect");
    until(&mut harness, "connected again", |s| s.device().is_some());
    let session = &harness.state().session;
    assert_eq!(session.lost, None);
    assert_eq!(session.connection().expect("there").spec, spec);
    assert!(harness.query_by_label("Reconnect").is_none());
    assert!(!session.is_armed(), "motors stay off until armed");
}

/// A restart of the board is reported as a lost link with the board's own reason.
#[test]
fn a_board_that_starts_anew_is_reported_once_and_reached_again() {
    let cable = Cable::new();
    let mut harness = harness();
    let spec: RigSpec = cable.port.parse().expect("a port's name");
    harness.state_mut().session.act(Intent::ChooseRig(spec));
    click(&mut harness, "Connect");
    until(&mut harness, "connected", |s| {
        s.device() == Some(DeviceState::Idle)
    });
    (harness.state().session.connection().expect("there")).request(ToDevice::Restart);
    until(&mut harness, "the loss is noticed", |s| s.lost.is_some());
    harness.run_steps(20);
    let reported = errors(&harness.state().session);
    assert!(
        reported.len() == 1 && reported[0].contains("the board has restarted"),
        "{reported:#?}"
    );
    click(&mut harness, "Reconnect");
    until(&mut harness, "connected again", |s| s.device().is_some());
}

/// Closing the window switches the motors off, whatever was going on.
#[test]
fn a_window_that_is_closed_leaves_the_motors_off() {
    let cable = Cable::new();
    let (harness, spec) = armed(&cable);
    drop(harness);
    let client = Client::connect(&spec).expect("the port is free again");
    // The stop takes effect at the board's next tick, which on a busy computer comes after the answer to the greeting. Without a stop the
    // greeting itself would disarm, which ends in `Idle`.
    let off = || matches!(client.state(), DeviceState::Stopped | DeviceState::Fault(_));
    let begun = Instant::now();
    while !off() && begun.elapsed() < STOPPED_WITHIN {
        std::thread::sleep(Duration::from_millis(5));
    }
    // By the window's stop; on a busy computer the watchdog is sometimes first.
    assert!(off(), "{:?}", client.state());
}
