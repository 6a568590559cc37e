//! A reset restores the initial state, to the bit.

use crate::support::IDENTITY;
use crate::support::flash::TestFlash;
use crate::support::image::two_parts;
use mortise_firmware::board::{Clock, Identity, Outbound};
use mortise_firmware::channel::Channels;
use mortise_firmware::control::{ControlPlane, Ticked};
use mortise_firmware::device::start;
use mortise_protocol::frame::{Stamp, encode_stamped};
use mortise_protocol::message::*;
use mortise_simulation::simulated::Simulated;

struct NoClock;

impl Clock for NoClock {
    fn begin(&mut self) -> u32 {
        0
    }

    fn cost(&mut self) -> u32 {
        0
    }
}

struct Sink;

impl Outbound for Sink {
    fn room(&self) -> usize {
        1 << 16
    }

    fn write(&mut self, _: &[u8]) {}
}

/// The same scenario after different histories gives the same bits.
#[test]
fn a_reset_forgets_the_past_to_the_bit() {
    let run = |history: u32| {
        let channels = Box::leak(Box::new(Channels::new()));
        let identity = Identity {
            overrun_ticks: 0,
            ..IDENTITY
        };
        let (mut link, mut control): (_, ControlPlane<'_, 'static, Simulated, NoClock>) =
            start(channels, TestFlash::leaked(), Simulated::new(), NoClock, identity);
        let mut seq = 0;
        let mut say = |link: &mut mortise_firmware::link::LinkPlane<'_, 'static, TestFlash>,
                       control: &mut ControlPlane<'_, 'static, Simulated, NoClock>,
                       message: &ToDevice| {
            let mut frame = [0; mortise_protocol::limits::MAX_FRAME];
            seq += 1;
            let stamp = Stamp {
                session: link.session(),
                count: u32::from(seq),
            };
            let bytes = encode_stamped(seq, Some(stamp), message, &mut frame).unwrap();
            link.receive(bytes, &mut Sink);
            control.tick();
            link.poll(&mut Sink);
        };
        let image = two_parts(1);
        say(&mut link, &mut control, &ToDevice::Hello(Version::own()));
        let begin = ToDevice::SceneBegin {
            length: image.len() as u32,
            crc: mortise_protocol::image::CRC.checksum(&image),
            layout: mortise_protocol::image::LAYOUT_VERSION,
        };
        say(&mut link, &mut control, &begin);
        for (i, piece) in image.chunks(512).enumerate() {
            let chunk = ToDevice::SceneChunk {
                offset: (i * 512) as u32,
                data: heapless::Vec::from_slice(piece).unwrap(),
            };
            say(&mut link, &mut control, &chunk);
        }
        say(&mut link, &mut control, &ToDevice::SceneCommit);
        let pose = |x: f32| WirePose {
            position: [x, 0.01, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
        };
        let script = |x: f32| {
            let frames = [(0, 0.0), (50, x)].map(|(tick, x)| Keyframe {
                tick,
                pose: pose(x),
                push: [0.0, 0.5, 0.0],
            });
            ToDevice::SimulatedHand(HandScript {
                stiffness: 400.0,
                damping: 5.0,
                angular_stiffness: 1.0,
                angular_damping: 0.01,
                tremor: 1e-4,
                tremor_hz: 9.0,
                keyframes: heapless::Vec::from_slice(&frames).unwrap(),
            })
        };
        for message in [script(0.05), ToDevice::Arm, ToDevice::Grab { part: 1 }] {
            say(&mut link, &mut control, &message);
        }
        for _ in 0..history {
            control.tick();
        }
        for message in [ToDevice::Disarm, ToDevice::Heartbeat] {
            say(&mut link, &mut control, &message);
        }
        for _ in 0..200 {
            control.tick();
        }
        for message in [
            ToDevice::Lockstep(true),
            ToDevice::ResetScene,
            script(0.02),
            ToDevice::Arm,
            ToDevice::Grab { part: 1 },
            ToDevice::Run { ticks: 400 },
        ] {
            say(&mut link, &mut control, &message);
        }
        while control.tick() == Ticked::Ran {}
        control.state_hash()
    };
    let hash = run(0);
    assert_ne!(hash, mortise_firmware::statistics::StateHash::new().value());
    for history in [1, 77, 499] {
        assert_eq!(run(history), hash, "after {history} ticks");
    }
}
