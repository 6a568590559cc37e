//! Every fault in every state: what the motors do, and what the operator reads.
//!
//! Both planes of the board run here on a mechanism that the test controls. Each case starts a board, brings it into the state by messages, causes
//! one fault, and checks the motor commands in the tick that sees it and in the next.

use std::cell::{Cell, RefCell};
use std::path::Path;
use std::rc::Rc;

use glam::Vec3;
use mortise_firmware::board::{
    Clock, Drive, DriverFault, DriverFaultKind, ERASED, FlashWord, Identity, Mechanism, Outbound, SLOTS,
    Sensed, Simulation,
};
use mortise_firmware::channel::Channels;
use mortise_firmware::control::ControlPlane;
use mortise_firmware::device::start;
use mortise_firmware::link::LinkPlane;
use mortise_mechanism::hardware_limits::HardwareLimits;
use mortise_protocol::frame::{Decoder, Stamp, encode_stamped};
use mortise_protocol::image::{CRC, LAYOUT_VERSION};
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::{CostUnit, DeviceState, Fault, FromDevice, ResetReason, ToDevice, Version};
use mortise_protocol::parameter::ParameterId;
use mortise_rig::describe;
use mortise_scenario::{PreparedScene, Scenario};
use mortise_simulation::ram_flash::{ERASE_SIZE, RamFlash};

use crate::LabError;
use crate::figures::{Plan, Row};

/// Ticks within which motors must be off or fading, including the one that sees the fault.
const WITHIN_TICKS: u32 = 2;
/// Consecutive missed ticks that are a fault on this board.
const OVERRUN_TICKS: u8 = 3;

/// States into which a board can be brought.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Before {
    Boot,
    Homing,
    Idle,
    Armed,
    Active,
    Disarming,
    FadingInFault,
    Stopped,
    Faulted,
    Testing,
}

const STATES: [Before; 10] = [
    Before::Boot,
    Before::Homing,
    Before::Idle,
    Before::Armed,
    Before::Active,
    Before::Disarming,
    Before::FadingInFault,
    Before::Stopped,
    Before::Faulted,
    Before::Testing,
];

impl Before {
    fn live(self) -> bool {
        matches!(
            self,
            Self::Armed | Self::Active | Self::Disarming | Self::FadingInFault | Self::Testing
        )
    }
}

/// Axis of the faults that name one.
const AXIS: u16 = 1;

/// True if this bench can cause the fault. A damaged scene is detected when arming, which reads all of it, and has its own test
/// (`firmware/app/tests/link.rs`); no input is known that makes the computed wrench non-finite.
fn can_be_caused(fault: &Fault) -> bool {
    !matches!(fault, Fault::SceneDamaged | Fault::NonFinite)
}

/// True if a board with its motors off checks for this fault.
fn seen_at_rest(fault: Fault) -> bool {
    matches!(
        fault,
        Fault::StopInput
            | Fault::SupplyLow
            | Fault::Driver { .. }
            | Fault::OverCurrent { .. }
            | Fault::OverTemperature { .. }
            | Fault::BadReading
    )
}

/// Longest time from the first reading of a handle that turns too fast to motors off, ticks.
///
/// # Errors
/// Anything that prevents the scene from being baked.
pub(crate) fn ticks_until_off_when_turning(pair: &Path) -> Result<u32, LabError> {
    let scenario = Scenario::insertion(pair)?;
    let scene = PreparedScene::of(&scenario)?;
    let slot = scene.image.len().next_multiple_of(ERASE_SIZE) + ERASE_SIZE;
    let mut flash = vec![ERASED; SLOTS * slot / size_of::<FlashWord>()];
    Board::start(&mut Box::default(), &mut flash).upload(&scene.image);
    let limit = ParameterId::AngularSpeedLimit.row().default;
    let mut longest = 0;
    let axes = [
        Vec3::X,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::new(1.0, -2.0, 3.0).normalize(),
    ];
    for rate in [1.0025 * limit, 900.0] {
        for state in [Before::Armed, Before::Active] {
            for axis in axes {
                let mut channels = Box::default();
                let mut board = Board::start(&mut channels, &mut flash);
                board.bring(state, scene.part);
                // Just within the limit there is no fault.
                board.pull(|s| s.twist.angular = axis * (0.9975 * limit));
                board.ticks(10);
                let sound = board.control.safety().live();
                board.pull(|s| s.twist.angular = axis * rate);
                let mut ticks = 0;
                while board.control.safety().live() && ticks < 1_000 {
                    board.tick();
                    ticks += 1;
                }
                let right = sound && board.state() == DeviceState::Fault(Fault::AngularOverSpeed);
                longest = longest.max(if right { ticks } else { u32::MAX });
            }
        }
    }
    Ok(longest)
}

/// Number of cases, and how many of them fail in which way.
///
/// # Errors
/// Anything that prevents the scene from being baked.
pub fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let scenario = Scenario::insertion(plan.pair)?;
    let scene = PreparedScene::of(&scenario)?;
    let slot = scene.image.len().next_multiple_of(ERASE_SIZE) + ERASE_SIZE;
    let mut flash = vec![ERASED; SLOTS * slot / size_of::<FlashWord>()];
    Board::start(&mut Box::default(), &mut flash).upload(&scene.image);
    let (mut cases, mut unreached, mut driven, mut unsaid) = (0u32, Vec::new(), Vec::new(), Vec::new());
    for state in STATES {
        for fault in Fault::every(AXIS).into_iter().filter(can_be_caused) {
            cases += 1;
            let case = format!("{fault:?} in {state:?}");
            let mut channels = Box::default();
            let mut board = Board::start(&mut channels, &mut flash);
            if !board.bring(state, scene.part) {
                unreached.push(case.clone());
            }
            let (quiet, words) = board.suffer(fault);
            if !quiet {
                driven.push(case.clone());
            }
            // The first fault is the one reported; some are no faults while the motors are off.
            let reported = matches!(state, Before::FadingInFault | Before::Faulted);
            // A host that disarmed may leave before the fade ends, and a test ends sooner than a host counts as silent.
            let gone = matches!(state, Before::Disarming | Before::Testing)
                && matches!(fault, Fault::HostSilent { .. });
            let expected = !reported && !gone && (state.live() || seen_at_rest(fault));
            if expected && words.is_none_or(|said| said != describe(board.as_seen(fault))) {
                unsaid.push(case);
            }
        }
    }
    out(Row::reported(
        "every fault in every state: cases",
        f64::from(cases),
        "",
    ));
    out(Row::exactly(
        format!(
            "every fault in every state: states not reached{}",
            named(&unreached)
        ),
        unreached.len() as f64,
        "cases",
        0.0,
    ));
    out(Row::exactly(
        format!(
            "every fault in every state: motors neither off nor stopping softly within {WITHIN_TICKS} ticks{}",
            named(&driven)
        ),
        driven.len() as f64,
        "cases",
        0.0,
    ));
    out(Row::exactly(
        format!(
            "every fault in every state: reason not in words at the host{}",
            named(&unsaid)
        ),
        unsaid.len() as f64,
        "cases",
        0.0,
    ));
    Ok(())
}

fn named(cases: &[String]) -> String {
    match cases.first() {
        None => String::new(),
        Some(first) => format!(" ({first}, …)"),
    }
}

/// State shared by the test, the mechanism and the clock.
struct Strings {
    sensed: RefCell<Sensed>,
    drive: Cell<Drive>,
    missed: Cell<u32>,
}

struct Puppet(Rc<Strings>);

impl Mechanism for Puppet {
    fn sense(&mut self) -> Sensed {
        *self.0.sensed.borrow()
    }

    fn drive(&mut self, drive: Drive) {
        self.0.drive.set(drive);
    }

    fn motors(&self) -> u8 {
        1
    }

    fn simulation(&mut self) -> Option<&mut dyn Simulation> {
        Some(self)
    }
}

impl Simulation for Puppet {}

struct Late(Rc<Strings>);

impl Clock for Late {
    fn begin(&mut self) -> u32 {
        self.0.missed.get()
    }

    fn cost(&mut self) -> u32 {
        0
    }
}

#[derive(Default)]
struct Wire(Vec<u8>);

impl Outbound for Wire {
    fn room(&self) -> usize {
        16 * MAX_FRAME - self.0.len().min(16 * MAX_FRAME)
    }

    fn write(&mut self, frame: &[u8]) {
        self.0.extend_from_slice(frame);
    }
}

/// Both planes of the board on one thread.
struct Board<'c, 's> {
    link: LinkPlane<'c, 's, RamFlash<'s>>,
    control: ControlPlane<'c, 's, Puppet, Late>,
    strings: Rc<Strings>,
    wire: Wire,
    decoder: Decoder,
    seq: u16,
    silent_ms: u16,
    reported: Option<Fault>,
}

impl<'c, 's> Board<'c, 's> {
    fn start(channels: &'c mut Box<Channels<'s>>, flash: &'s mut [FlashWord]) -> Self {
        let strings = Rc::new(Strings {
            sensed: RefCell::new(Sensed::AT_REST),
            drive: Cell::new(Drive::Off),
            missed: Cell::new(0),
        });
        let identity = Identity {
            board: "fault bench",
            force_axes: 3,
            torque_axes: 3,
            cost_unit: CostUnit::Cycles,
            cost_budget: 0,
            reset: ResetReason::PowerOn,
            overrun_ticks: OVERRUN_TICKS,
            hardware_limits: HardwareLimits::LARGEST,
            entropy: 1,
        };
        let (link, control) = start(
            channels,
            RamFlash::new(flash),
            Puppet(strings.clone()),
            Late(strings.clone()),
            identity,
        );
        Self {
            link,
            control,
            strings,
            wire: Wire::default(),
            decoder: Decoder::new(),
            seq: 0,
            silent_ms: 0,
            reported: None,
        }
    }

    /// Runs one tick and one call of the control plane, and takes the messages to the host.
    fn tick(&mut self) {
        self.control.tick();
        self.link.poll(&mut self.wire);
        for byte in std::mem::take(&mut self.wire.0) {
            if let Some(Ok((_, FromDevice::Fault { fault, .. }))) = self.decoder.push::<FromDevice>(byte) {
                self.reported.get_or_insert(fault);
            }
        }
    }

    fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.tick();
        }
    }

    /// Sends a message and lets the board take it.
    fn say(&mut self, message: &ToDevice) {
        let mut frame = [0; MAX_FRAME];
        self.seq = self.seq.wrapping_add(1);
        // Every message fits a frame, and the wire has space for sixteen answers.
        let stamp = Stamp {
            session: self.link.session(),
            count: u32::from(self.seq),
        };
        if let Ok(bytes) = encode_stamped(self.seq, Some(stamp), message, &mut frame) {
            self.link.receive(bytes, &mut self.wire);
        }
        self.tick();
    }

    fn greet(&mut self) {
        self.say(&ToDevice::Hello(Version::own()));
        self.ticks(2);
    }

    fn upload(&mut self, image: &[u8]) {
        self.greet();
        self.say(&ToDevice::SceneBegin {
            length: image.len() as u32,
            crc: CRC.checksum(image),
            layout: LAYOUT_VERSION,
        });
        for (i, piece) in image.chunks(MAX_CHUNK).enumerate() {
            self.say(&ToDevice::SceneChunk {
                offset: (i * MAX_CHUNK) as u32,
                data: piece.iter().copied().collect(),
            });
        }
        self.say(&ToDevice::SceneCommit);
        self.ticks(2);
    }

    fn pull(&self, change: impl FnOnce(&mut Sensed)) {
        change(&mut self.strings.sensed.borrow_mut());
    }

    fn state(&self) -> DeviceState {
        self.control.safety().reported()
    }

    /// Brings the board into a state by messages alone.
    fn bring(&mut self, state: Before, part: u16) -> bool {
        if state == Before::Boot {
            return self.state() == DeviceState::Boot;
        }
        if state == Before::Homing {
            self.pull(|s| s.referenced = false);
        }
        self.greet();
        if matches!(
            state,
            Before::Armed | Before::Active | Before::Disarming | Before::FadingInFault
        ) {
            self.say(&ToDevice::Arm);
        }
        if !matches!(state, Before::Armed | Before::Testing) && state.live() {
            self.say(&ToDevice::Grab { part });
            // Builds up a wrench to fade: the handle is 4 mm ahead of the part.
            self.pull(|s| s.handle.position += Vec3::new(0.0, 0.0, 0.004));
            self.ticks(30);
        }
        match state {
            Before::Disarming => self.say(&ToDevice::Disarm),
            Before::FadingInFault => {
                self.pull(|s| s.handle.position = Vec3::new(3.0, 0.0, 0.0));
                self.tick();
            }
            Before::Stopped => self.say(&ToDevice::Stop),
            Before::Testing => self.say(&ToDevice::TestMotor { joint: 0, force: 1.0 }),
            Before::Faulted => {
                self.pull(|s| s.stop_open = true);
                self.tick();
                self.pull(|s| s.stop_open = false);
            }
            _ => {}
        }
        self.tick();
        let reached = self.state();
        match state {
            Before::Boot => false,
            Before::Homing => reached == DeviceState::Homing,
            Before::Idle => reached == DeviceState::Idle,
            Before::Armed => reached == DeviceState::Armed,
            Before::Active => reached == DeviceState::Active,
            Before::Disarming | Before::FadingInFault => reached == DeviceState::SoftStop,
            Before::Stopped => reached == DeviceState::Stopped,
            Before::Faulted => matches!(reached, DeviceState::Fault(_)),
            Before::Testing => reached == DeviceState::Testing,
        }
    }

    /// Causes a fault. Returns whether the motors are off or stopping softly in time, and what the host reads.
    fn suffer(&mut self, fault: Fault) -> (bool, Option<String>) {
        self.reported = None;
        let report = |axis, kind| Some(DriverFault { axis, kind });
        let mut within = WITHIN_TICKS;
        match fault {
            Fault::StopInput => self.pull(|s| s.stop_open = true),
            Fault::SupplyLow => self.pull(|s| s.supply_low = true),
            Fault::Driver { axis } => self.pull(|s| s.driver_fault = report(axis, DriverFaultKind::Any)),
            Fault::OverCurrent { axis } => {
                self.pull(|s| s.driver_fault = report(axis, DriverFaultKind::OverCurrent));
            }
            Fault::OverTemperature { axis } => {
                self.pull(|s| s.driver_fault = report(axis, DriverFaultKind::OverTemperature));
            }
            // No reading makes the law compute a non-finite value: one that would is refused as a bad reading.
            Fault::BadReading | Fault::NonFinite => self.pull(|s| s.handle.position.y = f32::NAN),
            Fault::ImpossiblePosture => self.pull(|s| s.impossible_posture = true),
            Fault::ReferenceLost => self.pull(|s| s.referenced = false),
            Fault::AngularOverSpeed => self.pull(|s| s.twist.angular = Vec3::new(0.0, -41.0, 0.0)),
            Fault::EncoderJump { axis } => self.pull(|s| s.encoder_jump = Some(axis)),
            Fault::EncoderStuck { axis } => self.pull(|s| s.encoder_stuck = Some(axis)),
            Fault::OverSpeed => self.pull(|s| s.twist.linear = Vec3::new(0.0, 0.0, -3.0)),
            Fault::Workspace => self.pull(|s| s.handle.position = Vec3::new(0.0, 2.5, 0.0)),
            Fault::TickOverrun => {
                // The fault is this many in a row, reported with the last of them.
                self.strings.missed.set(1);
                within += u32::from(OVERRUN_TICKS) - 1;
            }
            // Silence up to the limit, then the tick that exceeds it.
            Fault::HostSilent { .. } | Fault::SceneDamaged => {
                within += (ParameterId::HostTimeout.row().default * 1e3) as u32 + 1;
            }
        }
        self.ticks(within);
        let stopping = matches!(self.state(), DeviceState::SoftStop);
        let quiet = match self.strings.drive.get() {
            Drive::Off => !self.control.safety().live(),
            Drive::Wrench(wrench) => stopping && wrench.is_finite(),
            Drive::Joint { .. } => false,
        };
        if let Some(Fault::HostSilent { silent_ms }) = self.reported {
            self.silent_ms = silent_ms;
        }
        // A host that was not yet connected receives the state on request.
        let reported = self.reported.or(match self.state() {
            DeviceState::Fault(fault) => Some(fault),
            _ => None,
        });
        (quiet, reported.map(describe))
    }

    /// The fault as this board reports it.
    fn as_seen(&self, fault: Fault) -> Fault {
        match fault {
            Fault::HostSilent { .. } => Fault::HostSilent {
                silent_ms: self.silent_ms,
            },
            other => other,
        }
    }
}
