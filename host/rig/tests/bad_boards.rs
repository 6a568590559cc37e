//! Faulty boards and ports: each gives a message that says what, where and what to do.

mod common;

use std::time::Duration;

use common::{short, wire};
use mortise_protocol::message::{
    Capabilities, CostUnit, DeviceState, FromDevice, Refusal, ResetReason, ToDevice, Version,
};
use mortise_rig::{Client, Event, RigError, RigSpec};

fn error(result: Result<Client, RigError>) -> RigError {
    match result {
        Ok(client) => panic!("connected to {}", client.name()),
        Err(error) => error,
    }
}

fn capabilities(state: DeviceState) -> Capabilities {
    Capabilities {
        board: "test".try_into().expect("short"),
        scene_capacity: 0,
        scene_layout: 1,
        scene: None,
        tick_hz: 1000,
        force_axes: 3,
        torque_axes: 3,
        simulated: false,
        cost_unit: CostUnit::Cycles,
        cost_budget: 0,
        max_targets: 0,
        reset: ResetReason::PowerOn,
        state,
        session: 1,
    }
}

#[test]
fn a_board_of_another_version_is_refused_naming_both() {
    let (transport, mut far) = wire();
    let other = Version {
        schema: 0xdead_beef,
        release: [9, 8, 7],
    };
    let board = std::thread::spawn(move || {
        while let Some((_, message)) = far.next() {
            if matches!(message, ToDevice::Hello(_)) {
                far.say(&FromDevice::Hello(other));
            }
        }
    });
    let said = error(Client::over(transport, "test", short(), None)).to_string();
    assert!(said.contains("9.8.7 (protocol 00000000deadbeef)"), "{said}");
    assert!(said.contains(env!("CARGO_PKG_VERSION")), "{said}");
    board.join().expect("the board ends with the link");
}

#[test]
fn a_silent_board_is_given_up_with_a_hint() {
    let (transport, far) = wire();
    let said = error(Client::over(transport, "/dev/ttyQ", short(), None)).to_string();
    assert!(said.contains("/dev/ttyQ did not answer within"), "{said}");
    assert!(said.contains("firmware"), "{said}");
    drop(far);
}

#[test]
fn a_board_that_only_babbles_is_given_up() {
    let (transport, mut far) = wire();
    let board = std::thread::spawn(move || {
        while far.next().is_some() {
            use std::io::Write;
            let _ = far.to_host.write_all(b"U-Boot 2024.01 (arm)\r\n\0=> \0");
        }
    });
    assert!(matches!(
        error(Client::over(transport, "test", short(), None)),
        RigError::NoAnswer { .. }
    ));
    board.join().expect("the board ends with the link");
}

#[test]
fn a_pulled_cable_shows_as_event_and_error() {
    let (transport, mut far) = wire();
    let board = std::thread::spawn(move || {
        while let Some((_, message)) = far.next() {
            match message {
                ToDevice::Hello(_) => far.say(&FromDevice::Hello(Version::own())),
                ToDevice::GetCapabilities => {
                    far.say(&FromDevice::Capabilities(capabilities(DeviceState::Idle)))
                }
                // The cable is unplugged.
                ToDevice::Arm => return,
                _ => {}
            }
        }
    });
    let client = Client::over(transport, "test", short(), None).expect("greeted");
    let failed = client.request(ToDevice::Arm).expect_err("the cable is unplugged");
    assert!(failed.is_link_lost(), "{failed}");
    let lost = std::iter::from_fn(|| client.events().recv_timeout(Duration::from_secs(5)).ok())
        .any(|event| matches!(event, Event::LinkLost(_)));
    assert!(lost);
    board.join().expect("ended");
}

/// A board that fails and restarts has lost its greeting; the operator reads the reason of the restart, whether or not the program sends
/// requests.
#[test]
fn a_board_that_started_anew_is_reported_with_the_reason() {
    for asks in [false, true] {
        let (transport, mut far) = wire();
        let board = std::thread::spawn(move || {
            let mut reported = capabilities(DeviceState::Idle);
            let (mut greeted, mut refused) = (false, 0);
            while let Some((seq, message)) = far.next() {
                match message {
                    ToDevice::Hello(_) => {
                        greeted = true;
                        far.say(&FromDevice::Hello(Version::own()));
                    }
                    _ if !greeted => {
                        refused += 1;
                        far.say(&FromDevice::Refused {
                            seq,
                            reason: Refusal::NotGreeted,
                        });
                    }
                    ToDevice::GetCapabilities => far.say(&FromDevice::Capabilities(reported.clone())),
                    ToDevice::Disarm => {
                        far.say(&FromDevice::Ack { seq });
                        // The board then fails.
                        greeted = false;
                        reported.reset = ResetReason::Panic { line: 4242 };
                    }
                    _ => far.say(&FromDevice::Ack { seq }),
                }
            }
            refused
        });
        let client = Client::over(transport, "test", short(), None).expect("greeted");
        client.request(ToDevice::Disarm).expect("answered");
        let reason = "the board has restarted: the board restarted after a panic in line 4242";
        if asks {
            let failed = client.request(ToDevice::Arm).expect_err("the greeting is lost");
            assert!(
                failed.is_link_lost() && failed.to_string().contains(reason),
                "{failed}"
            );
        }
        let reported = std::iter::from_fn(|| client.events().recv_timeout(Duration::from_secs(5)).ok())
            .find_map(|event| match event {
                Event::LinkLost(why) => Some(why),
                _ => None,
            });
        assert_eq!(reported.as_deref(), Some(reason));
        drop(client);
        assert!(board.join().expect("ended") > 0);
    }
}

/// An armed board receives STOP when its client is dropped.
#[test]
fn going_away_armed_says_stop() {
    let (transport, mut far) = wire();
    let board = std::thread::spawn(move || {
        let mut heard = Vec::new();
        while let Some((seq, message)) = far.next() {
            match &message {
                ToDevice::Hello(_) => far.say(&FromDevice::Hello(Version::own())),
                ToDevice::GetCapabilities => {
                    far.say(&FromDevice::Capabilities(capabilities(DeviceState::Armed)))
                }
                _ => far.say(&FromDevice::Ack { seq }),
            }
            heard.push(message);
        }
        heard
    });
    drop(Client::over(transport, "test", short(), None).expect("greeted"));
    let heard = board.join().expect("ended");
    assert_eq!(heard.last(), Some(&ToDevice::Stop));
}

/// A message whose answer is lost is sent again only when that does no harm.
#[test]
fn lost_answers_are_asked_for_again_only_where_harmless() {
    let (transport, mut far) = wire();
    let board = std::thread::spawn(move || {
        let (mut disarms, mut grabs) = (0, 0);
        while let Some((seq, message)) = far.next() {
            match message {
                ToDevice::Hello(_) => far.say(&FromDevice::Hello(Version::own())),
                ToDevice::GetCapabilities => {
                    far.say(&FromDevice::Capabilities(capabilities(DeviceState::Idle)))
                }
                ToDevice::Disarm => {
                    disarms += 1;
                    if disarms == 2 {
                        far.say(&FromDevice::Ack { seq });
                    }
                }
                ToDevice::Grab { .. } => grabs += 1,
                _ => far.say(&FromDevice::Ack { seq }),
            }
        }
        (disarms, grabs)
    });
    let client = Client::over(transport, "test", short(), None).expect("greeted");
    client
        .request(ToDevice::Disarm)
        .expect("answered the second time");
    let failed = client
        .request(ToDevice::Grab { part: 3 })
        .expect_err("never answered");
    assert!(
        failed.to_string().contains("no answer to grabbing part 3"),
        "{failed}"
    );
    drop(client);
    assert_eq!(board.join().expect("ended"), (2, 1));
}

#[test]
fn a_port_that_is_not_there_is_named() {
    let spec = RigSpec::Serial {
        port: "/dev/ttyNOBODY7".into(),
    };
    let said = error(Client::connect(&spec)).to_string();
    assert!(said.contains("there is no port `/dev/ttyNOBODY7`"), "{said}");
    // A mistyped rig is taken for a port: the words for the other rigs are said.
    assert!(said.contains("`sim`, `emulated`"), "{said}");
}

#[test]
fn missing_firmware_says_how_to_build_it() {
    let spec = RigSpec::Emulated {
        mode: mortise_rig::EmulatedMode::Lockstep,
        firmware: Some("nowhere/board.elf".into()),
    };
    let said = error(Client::connect(&spec)).to_string();
    assert!(
        said.contains("nowhere/board.elf") && said.contains("cargo xtask firmware mps2-an500"),
        "{said}"
    );
}

#[cfg(unix)]
#[test]
fn a_port_in_use_is_named_as_such() {
    use serialport::SerialPort;
    let (_master, slave) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    let port = slave.name().expect("it has a name");
    drop(slave);
    let holder = serialport::new(&port, 1_000_000).open().expect("free so far");
    let said = error(Client::connect(&RigSpec::Serial { port: port.clone() })).to_string();
    assert!(
        said.contains(&format!("{port} is in use by another program")),
        "{said}"
    );
    drop(holder);
}
