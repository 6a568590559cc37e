//! Tests of what only the link plane's queue can reach.

use std::boxed::Box;
use std::vec::Vec;

use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::image::SceneImage;
use mortise_protocol::message::{CostUnit, Refusal, ResetReason};

use super::ControlPlane;
use crate::board::{Clock, Drive, Identity, Mechanism, Sensed};
use crate::channel::{Channels, Command, CommandKind, Event, Reply};
use crate::parameters::ControlSettings;

#[path = "../../tests/support/image.rs"]
#[allow(dead_code, reason = "each test uses its share")]
mod image;

struct Still;

impl Mechanism for Still {
    fn sense(&mut self) -> Sensed {
        Sensed::AT_REST
    }

    fn drive(&mut self, _drive: Drive) {}
}

struct NoClock;

impl Clock for NoClock {
    fn begin(&mut self) -> u32 {
        0
    }

    fn cost(&mut self) -> u32 {
        0
    }
}

/// The link plane sends the number of the scene whose checksum it has just verified. In no enumerated order of messages (`firmware/orders`) does it
/// differ from that of the scene in use; the control plane does not rely on that.
#[test]
fn a_scene_other_than_the_verified_one_is_not_armed() {
    let bytes: &'static [u32] = Box::leak(
        image::two_parts(1)
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
            .collect::<Vec<_>>()
            .into_boxed_slice(),
    );
    let scene = SceneImage::open(bytemuck::cast_slice(bytes)).expect("a valid scene");
    let mut channels = Box::new(Channels::new());
    let (mut link, ends) = channels.split();
    let identity = Identity {
        board: "test",
        force_axes: 3,
        torque_axes: 3,
        cost_unit: CostUnit::Cycles,
        cost_budget: 480_000,
        reset: ResetReason::PowerOn,
        overrun_ticks: 3,
        hardware_limits: HardwareLimits::LARGEST,
        entropy: 1,
    };
    let settings = ControlSettings::at_start(identity.hardware_limits);
    let mut control = ControlPlane::new(ends, Still, NoClock, &identity, settings);
    let mut answer = |kind| {
        let command = Command {
            seq: 1,
            epoch: link.shared.epoch(),
            session: link.shared.sessions(),
            kind,
        };
        link.commands.enqueue(command).expect("room");
        control.tick();
        while let Some(event) = link.events.dequeue() {
            match event {
                Event::Reply { reply, .. } => return Some(reply),
                Event::SceneTaken(taken) => taken.expect("motors are off"),
                _ => {}
            }
        }
        None
    };
    assert_eq!(
        answer(CommandKind::UseScene {
            image: scene,
            number: 7
        }),
        None
    );
    for number in [0, 6, 8, u32::MAX] {
        assert_eq!(
            answer(CommandKind::Arm(number)),
            Some(Reply::Refused(Refusal::Outdated))
        );
        assert!(!link.shared.live());
    }
    assert_eq!(answer(CommandKind::Arm(7)), Some(Reply::Done));
    assert!(link.shared.live());
}
