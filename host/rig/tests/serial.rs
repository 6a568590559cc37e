//! A board on a serial port, by the port's name: the simulated board behind a pseudo-terminal, opened like any port.
#![cfg(unix)]

mod common;

use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use common::image;
use mortise_protocol::image::CRC;
use mortise_protocol::message::{ResetReason, ToDevice};
use mortise_rig::{Client, Event, Flash, RigError, RigSpec, Transport, simulate};
use serialport::{SerialPort, TTYPort};

/// Copies bytes both ways between a pseudo-terminal and a simulated board, until `over`.
struct Bridge {
    over: Arc<AtomicBool>,
    threads: Vec<std::thread::JoinHandle<()>>,
    port: String,
    /// Keeps the terminal open between two programs that use it, without a lock on it.
    _slave: std::fs::File,
}

fn copy(mut from: Box<dyn Read + Send>, mut to: Box<dyn Write + Send>, over: &AtomicBool) {
    let mut bytes = [0; 256];
    while !over.load(Ordering::Relaxed) {
        match from.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) => {
                if to.write_all(&bytes[..count]).is_err() {
                    return;
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(_) => return,
        }
    }
}

impl Bridge {
    fn new() -> Self {
        let (mut master, slave) = TTYPort::pair().expect("a pseudo-terminal");
        master.set_timeout(Duration::from_millis(20)).expect("a timeout");
        let port = slave.name().expect("it has a name");
        let held = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(&port)
            .expect("it opens");
        drop(slave);
        let Transport { reader, writer, keep } = simulate(&Flash::default(), true).expect("a thread");
        let over = Arc::new(AtomicBool::new(false));
        let from_host: Box<dyn Read + Send> = master.try_clone().expect("a second handle");
        let ends: [(Box<dyn Read + Send>, Box<dyn Write + Send>); 2] =
            [(from_host, writer), (reader, Box::new(master))];
        let mut threads: Vec<_> = ends
            .into_iter()
            .map(|(from, to)| {
                let over = over.clone();
                std::thread::spawn(move || copy(from, to, &over))
            })
            .collect();
        // The board ends when both its pipes are closed, so its thread is joined last.
        threads.push(std::thread::spawn(move || drop(keep)));
        Self {
            over,
            threads,
            port,
            _slave: held,
        }
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            thread.join().expect("the bridge ends");
        }
    }
}

#[test]
fn a_board_is_reached_by_the_name_of_its_port_again_and_again() {
    let bridge = Bridge::new();
    let spec: RigSpec = bridge.port.parse().expect("a port's name");
    let scene = image(5000, 1);
    {
        let client = Client::connect(&spec).expect("the board greets");
        assert_eq!(client.capabilities().board, "simulation");
        client.upload(&scene, &mut |_| {}).expect("room");
        client.request(ToDevice::Arm).expect("armed");
    }
    // The first program ended armed; the next finds the scene on the board and the motors off.
    let client = Client::connect(&spec).expect("the board greets again");
    assert_eq!(client.capabilities().scene, Some(CRC.checksum(&scene)));
    let held = Client::connect(&spec).map(|_| ());
    assert!(matches!(held, Err(RigError::Busy { .. })), "{held:?}");
}

/// The restart was not requested by this client: the heartbeat detects it, and the link ends with the board's reason.
#[test]
fn a_board_that_starts_anew_says_why() {
    let bridge = Bridge::new();
    let spec: RigSpec = bridge.port.parse().expect("a port's name");
    let client = Client::connect(&spec).expect("the board greets");
    client.send(ToDevice::Restart).expect("sent");
    let reported =
        std::iter::from_fn(|| client.events().recv_timeout(Duration::from_secs(5)).ok()).find_map(|event| {
            match event {
                Event::LinkLost(why) => Some(why),
                _ => None,
            }
        });
    assert_eq!(
        reported.as_deref(),
        Some("the board has restarted: the board restarted on request")
    );
    drop(client);
    // The board can be reached again.
    let client = Client::connect(&spec).expect("the board greets again");
    assert_eq!(client.capabilities().reset, ResetReason::Requested);
}
