//! A board in memory: flash that can lose power, a scripted mechanism, a wire that can be read.
#![allow(dead_code, reason = "each test file uses its share")]

pub mod flash;
pub mod image;
pub mod mechanism;
pub mod rigs;

use std::collections::VecDeque;

use flash::TestFlash;
use mechanism::{Puppet, Strings};
use mortise_firmware::board::{Clock, Identity, Outbound};
use mortise_firmware::channel::Channels;
use mortise_firmware::control::{ControlPlane, Ticked};
use mortise_firmware::device::start;
use mortise_firmware::link::LinkPlane;
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::frame::{Decoder, Stamp, encode_stamped};
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::*;

pub const IDENTITY: Identity = Identity {
    board: "test bench",
    force_axes: 3,
    torque_axes: 1,
    cost_unit: CostUnit::Cycles,
    cost_budget: 480_000,
    reset: ResetReason::PowerOn,
    overrun_ticks: 3,
    hardware_limits: HardwareLimits::LARGEST,
    entropy: 1,
};

/// A wire with space for a few frames.
#[derive(Default)]
pub struct Wire {
    pub bytes: Vec<u8>,
    pub capacity: usize,
}

impl Outbound for Wire {
    fn room(&self) -> usize {
        self.capacity - self.bytes.len()
    }

    fn write(&mut self, frame: &[u8]) {
        assert!(frame.len() <= self.room(), "more than there was room for");
        self.bytes.extend_from_slice(frame);
    }
}

/// A clock that returns the test's values.
#[derive(Clone, Default)]
pub struct TestClock(pub std::rc::Rc<std::cell::Cell<(u32, u32)>>);

impl Clock for TestClock {
    fn begin(&mut self) -> u32 {
        let (missed, cost) = self.0.get();
        self.0.set((0, cost));
        missed
    }

    fn cost(&mut self) -> u32 {
        self.0.get().1
    }
}

/// Both planes on one thread.
pub struct Bench<const SIMULATED: bool = true, const DESCRIBED: bool = true> {
    pub link: LinkPlane<'static, 'static, TestFlash>,
    pub control: ControlPlane<'static, 'static, Puppet<SIMULATED, DESCRIBED>, TestClock>,
    pub strings: Strings,
    pub clock: TestClock,
    pub wire: Wire,
    decoder: Decoder,
    seq: u16,
    /// Count of the last message's stamp.
    pub count: u32,
    pub heard: VecDeque<FromDevice>,
}

impl Bench {
    /// Started, in a session, with a scene of a fixed part 0 and a grabbable part 1.
    pub fn ready() -> Self {
        let mut bench = Self::new(TestFlash::leaked());
        bench.greet();
        bench.upload(&image::two_parts(1)).unwrap();
        bench
    }
}

impl<const SIMULATED: bool, const DESCRIBED: bool> Bench<SIMULATED, DESCRIBED> {
    /// Powered on, before any message. Memory is leaked: a bench lives as long as its test.
    pub fn new(flash: TestFlash) -> Self {
        let channels = Box::leak(Box::new(Channels::new()));
        let strings = Strings::default();
        let clock = TestClock::default();
        let (link, control) = start(
            channels,
            flash,
            Puppet::new(strings.clone()),
            clock.clone(),
            IDENTITY,
        );
        Self {
            link,
            control,
            strings,
            clock,
            wire: Wire {
                bytes: Vec::new(),
                capacity: 6 * MAX_FRAME,
            },
            decoder: Decoder::new(),
            seq: 0,
            count: 0,
            heard: VecDeque::new(),
        }
    }

    /// Sends a message without letting the control plane run; returns its sequence number.
    pub fn send(&mut self, message: &ToDevice) -> u16 {
        let bytes = self.frame(message);
        self.feed(&bytes);
        self.seq
    }

    /// The frame of a new message, not sent.
    pub fn frame(&mut self, message: &ToDevice) -> Vec<u8> {
        self.seq = self.seq.wrapping_add(1);
        self.count += 1;
        let stamp = Stamp {
            session: self.link.session(),
            count: self.count,
        };
        let mut frame = [0; MAX_FRAME];
        encode_stamped(self.seq, Some(stamp), message, &mut frame)
            .expect("fits")
            .to_vec()
    }

    /// Sends raw bytes.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.link.receive(bytes, &mut self.wire);
        self.listen();
    }

    /// Decodes the frames on the wire.
    pub fn listen(&mut self) {
        for byte in std::mem::take(&mut self.wire.bytes) {
            match self.decoder.push::<FromDevice>(byte) {
                None => {}
                Some(Ok((_, message))) => self.heard.push_back(message),
                Some(Err(error)) => panic!("the board sent a bad frame: {error:?}"),
            }
        }
    }

    /// One call of the control plane, and delivery of its events.
    pub fn tick(&mut self) -> Ticked {
        let ticked = self.control.tick();
        self.link.poll(&mut self.wire);
        self.listen();
        ticked
    }

    pub fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.tick();
        }
    }

    /// Sends a message and waits for its answer; all other messages received stay in `heard`.
    pub fn ask(&mut self, message: &ToDevice) -> FromDevice {
        let seq = self.send(message);
        for _ in 0..50 {
            let answer = self.heard.iter().position(|m| match m {
                FromDevice::Ack { seq: s } | FromDevice::Refused { seq: s, .. } => *s == seq,
                FromDevice::Hello(_)
                | FromDevice::Capabilities(_)
                | FromDevice::Parameter { .. }
                | FromDevice::Statistics(_)
                | FromDevice::Rig { .. }
                | FromDevice::Ran { .. } => true,
                _ => false,
            });
            if let Some(at) = answer {
                return self.heard.remove(at).expect("it was there");
            }
            self.tick();
        }
        panic!("no answer to {message:?}");
    }

    /// Sends a message; `Ok` when acknowledged.
    pub fn request(&mut self, message: &ToDevice) -> Result<(), Refusal> {
        match self.ask(message) {
            FromDevice::Ack { .. } => Ok(()),
            FromDevice::Refused { reason, .. } => Err(reason),
            other => panic!("{other:?} is no answer to {message:?}"),
        }
    }

    pub fn greet(&mut self) {
        let hello = self.ask(&ToDevice::Hello(Version::own()));
        assert_eq!(hello, FromDevice::Hello(Version::own()));
        self.ticks(1);
    }

    pub fn begin(&mut self, image: &[u8]) -> Result<(), Refusal> {
        self.request(&ToDevice::SceneBegin {
            length: image.len() as u32,
            crc: mortise_protocol::image::CRC.checksum(image),
            layout: mortise_protocol::image::LAYOUT_VERSION,
        })
    }

    pub fn chunk(&mut self, image: &[u8], offset: usize) -> Result<(), Refusal> {
        let end = image.len().min(offset + MAX_CHUNK);
        self.request(&ToDevice::SceneChunk {
            offset: offset as u32,
            data: heapless::Vec::from_slice(&image[offset..end]).expect("at most MAX_CHUNK"),
        })
    }

    pub fn upload(&mut self, image: &[u8]) -> Result<(), Refusal> {
        self.begin(image)?;
        for offset in (0..image.len()).step_by(MAX_CHUNK) {
            self.chunk(image, offset)?;
        }
        self.request(&ToDevice::SceneCommit)
    }

    pub fn state(&mut self) -> DeviceState {
        self.control.safety().reported()
    }

    pub fn capabilities(&mut self) -> Capabilities {
        match self.ask(&ToDevice::GetCapabilities) {
            FromDevice::Capabilities(capabilities) => capabilities,
            other => panic!("{other:?}"),
        }
    }

    pub fn statistics(&mut self, reset: bool) -> Statistics {
        match self.ask(&ToDevice::GetStatistics { reset }) {
            FromDevice::Statistics(statistics) => statistics,
            other => panic!("{other:?}"),
        }
    }

    /// Clears the messages received so far.
    pub fn forget(&mut self) {
        self.heard.clear();
    }

    pub fn fault_heard(&self) -> Option<Fault> {
        self.heard.iter().find_map(|m| match m {
            FromDevice::Fault { fault, .. } => Some(*fault),
            _ => None,
        })
    }
}
