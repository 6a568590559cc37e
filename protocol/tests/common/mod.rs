//! Random messages of every kind, from a seed. Each test binary uses a part of this.
#![allow(dead_code)]

use heapless::{String, Vec};
use mortise_protocol::image::ImageError;
use mortise_protocol::limits::*;
use mortise_protocol::message::*;
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_protocol::rig::*;

/// SplitMix64 (Steele, Lea, Flood 2014): small, and the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0..n, n > 0. The bias of the remainder does not matter here.
    pub fn below(&mut self, n: usize) -> usize {
        (self.u64() % n as u64) as usize
    }

    /// Small, large and extreme values alike, so that every length of a varint occurs.
    pub fn u32(&mut self) -> u32 {
        (self.u64() as u32) >> self.below(32)
    }

    pub fn u16(&mut self) -> u16 {
        (self.u64() as u16) >> self.below(16)
    }

    pub fn u8(&mut self) -> u8 {
        self.u64() as u8
    }

    pub fn bool(&mut self) -> bool {
        self.u64() & 1 == 1
    }

    /// Any number but NaN, which is not equal to itself.
    pub fn f32(&mut self) -> f32 {
        let value = f32::from_bits(self.u64() as u32);
        if value.is_nan() { f32::INFINITY } else { value }
    }

    pub fn floats<const N: usize>(&mut self) -> [f32; N] {
        core::array::from_fn(|_| self.f32())
    }

    pub fn list<T, const N: usize>(&mut self, mut make: impl FnMut(&mut Self) -> T) -> Vec<T, N> {
        // The bounds themselves are the interesting lengths.
        let length = match self.below(4) {
            0 => 0,
            1 => N,
            _ => self.below(N + 1),
        };
        (0..length).map(|_| make(self)).collect()
    }

    fn pose(&mut self) -> WirePose {
        WirePose {
            position: self.floats(),
            orientation: self.floats(),
        }
    }

    fn wrench(&mut self) -> WireWrench {
        WireWrench {
            force: self.floats(),
            torque: self.floats(),
        }
    }

    fn parameter(&mut self) -> ParameterId {
        PARAMETERS[self.below(PARAMETERS.len())].id
    }

    fn version(&mut self) -> Version {
        Version {
            schema: self.u64() >> self.below(64),
            release: [self.u16(), self.u16(), self.u16()],
        }
    }

    fn fault(&mut self) -> Fault {
        Fault::every(self.u16())[self.below(Fault::COUNT)]
    }

    fn state(&mut self) -> DeviceState {
        match self.below(9) {
            0 => DeviceState::Boot,
            1 => DeviceState::Homing,
            2 => DeviceState::Idle,
            3 => DeviceState::Armed,
            4 => DeviceState::Active,
            5 => DeviceState::SoftStop,
            6 => DeviceState::Stopped,
            7 => DeviceState::Testing,
            _ => DeviceState::Fault(self.fault()),
        }
    }

    fn image_error(&mut self) -> ImageError {
        match self.below(7) {
            0 => ImageError::TooShort {
                needed: self.u32(),
                got: self.u32(),
            },
            1 => ImageError::BadMagic,
            2 => ImageError::Layout {
                expected: self.u32(),
                found: self.u32(),
            },
            3 => ImageError::Crc {
                expected: self.u32(),
                found: self.u32(),
            },
            4 => ImageError::Misaligned,
            5 => ImageError::Section { section: self.u8() },
            _ => ImageError::Record {
                section: self.u8(),
                index: self.u32(),
            },
        }
    }

    fn refusal(&mut self) -> Refusal {
        match self.below(24) {
            0 => Refusal::NotGreeted,
            1 => Refusal::State(self.state()),
            2 => Refusal::NoScene,
            3 => Refusal::NoSuchPart { parts: self.u16() },
            4 => Refusal::NotGrabbable,
            5 => Refusal::OutOfRange {
                id: self.parameter(),
                min: self.f32(),
                max: self.f32(),
            },
            6 => Refusal::ChunkOrder { expected: self.u32() },
            7 => Refusal::NoUpload,
            8 => Refusal::SceneTooLarge { capacity: self.u32() },
            9 => Refusal::TooManyParts { capacity: self.u16() },
            10 => Refusal::SceneIncomplete { received: self.u32() },
            11 => Refusal::SceneCrc {
                expected: self.u32(),
                found: self.u32(),
            },
            12 => Refusal::SceneImage(self.image_error()),
            13 => Refusal::Flash,
            14 => Refusal::NotSimulated,
            15 => Refusal::Lockstep,
            16 => Refusal::BadNumber,
            17 => Refusal::Busy,
            18 => Refusal::Rig(self.rig_fault()),
            19 => Refusal::RigFixed,
            20 => Refusal::RigDamaged,
            21 => Refusal::Outdated,
            22 => Refusal::NoSuchMotor { motors: self.u8() },
            _ => Refusal::Undecodable,
        }
    }

    fn rig_fault(&mut self) -> RigFault {
        let joint = self.u8();
        match self.below(9) {
            0 => RigFault::OutOfRange {
                key: RIG_KEYS[self.below(RIG_KEYS.len())].id,
                joint,
                value: self.f32(),
            },
            1 => RigFault::Joints { needed: joint },
            2 => RigFault::Range { joint },
            3 => RigFault::Home { joint },
            4 => RigFault::Counts { joint },
            5 => RigFault::WristAxes,
            6 => RigFault::Linkage,
            7 => RigFault::Singular,
            _ => RigFault::Workspace,
        }
    }

    fn name(&mut self) -> String<MAX_NAME> {
        let mut name = String::new();
        for _ in 0..self.below(MAX_NAME + 1) {
            // One byte each, so that MAX_NAME of them fit.
            let letter = char::from(b'a' + self.below(26) as u8);
            name.push(letter).expect("no longer than MAX_NAME");
        }
        name
    }

    pub fn rig(&mut self) -> Rig {
        Rig {
            name: self.name(),
            kinematics: match self.below(3) {
                0 => Kinematics::Paddle { radius: self.f32() },
                1 => Kinematics::Pantograph {
                    base: self.f32(),
                    proximal: self.floats(),
                    distal: self.floats(),
                },
                _ => Kinematics::SerialArm {
                    base_height: self.f32(),
                    upper: self.f32(),
                    lower: self.f32(),
                },
            },
            mount: Mount {
                origin: self.floats(),
                turn: self.floats(),
            },
            joints: self.list(|r| Joint {
                counts_per_turn: r.f32(),
                encoder_on_motor: r.bool(),
                encoder_reversed: r.bool(),
                gear: r.f32(),
                torque_constant: r.f32(),
                motor_reversed: r.bool(),
                current_limit: r.f32(),
                range: r.floats(),
                home: r.f32(),
                rate_limit: r.f32(),
                coulomb: r.f32(),
                viscous: r.f32(),
                inertia: r.f32(),
            }),
            wrist: self.bool().then(|| Wrist {
                axes: [self.floats(), self.floats(), self.floats()],
                counts_per_turn: self.floats(),
                home: self.floats(),
            }),
            handle_mass: self.f32(),
            ceilings: RigCeilings {
                force: self.f32(),
                power: self.f32(),
                speed: self.f32(),
                workspace: self.f32(),
            },
        }
    }

    fn feature(&mut self) -> Feature {
        Feature {
            point: self.floats(),
            direction: self.floats(),
        }
    }

    fn target(&mut self) -> ConstraintTarget {
        let kinds = ConstraintKind::ALL;
        ConstraintTarget {
            id: self.u16(),
            sequence: self.u16(),
            kind: kinds[self.below(kinds.len())],
            moving: self.feature(),
            static_part: self.u16(),
            fixed: self.feature(),
            stiffness: self.f32(),
            force_cap: self.f32(),
            torque_cap: self.f32(),
            expiry_ticks: self.u16(),
            path: self.bool().then(|| Path {
                orientation: self.floats(),
                turn: match self.bool() {
                    true => PathTurn::Free,
                    false => PathTurn::Geared(self.f32()),
                },
                ends: self.bool(),
            }),
            faces: self.list(|r| (r.u16(), r.u16())),
        }
    }

    fn script(&mut self) -> HandScript {
        HandScript {
            stiffness: self.f32(),
            damping: self.f32(),
            angular_stiffness: self.f32(),
            angular_damping: self.f32(),
            tremor: self.f32(),
            tremor_hz: self.f32(),
            keyframes: self.list(|r| Keyframe {
                tick: r.u32(),
                pose: r.pose(),
                push: r.floats(),
            }),
        }
    }

    fn input_fault(&mut self) -> InputFault {
        let axis = self.u8();
        InputFault {
            tick: self.u32(),
            ticks: self.u32(),
            kind: match self.below(12) {
                0 => InputFaultKind::EncoderGlitch {
                    axis,
                    counts: self.u32() as i32,
                },
                1 => InputFaultKind::EncoderStuck { axis },
                2 => InputFaultKind::NotANumber,
                3 => InputFaultKind::Driver { axis },
                4 => InputFaultKind::OverCurrent { axis },
                5 => InputFaultKind::OverTemperature { axis },
                6 => InputFaultKind::StopOpen,
                7 => InputFaultKind::SupplyLow,
                8 => InputFaultKind::EncoderSense {
                    axis,
                    reversed: self.bool(),
                },
                9 => InputFaultKind::MotorSense {
                    axis,
                    reversed: self.bool(),
                },
                10 => InputFaultKind::MotorDead { axis },
                _ => InputFaultKind::EncodersSwapped {
                    axis,
                    with: self.u8(),
                },
            },
        }
    }

    fn pair(&mut self) -> TouchingPair {
        TouchingPair {
            moving_face: self.u16(),
            static_part: self.u16(),
            static_face: self.u16(),
            moving_edge_face: self.u16(),
            static_edge_face: self.u16(),
            count: self.u16(),
            depth: self.f32(),
            point: self.floats(),
            insertion: self.f32(),
        }
    }

    fn driver(&mut self) -> Option<DriverReport> {
        match self.below(4) {
            0 => None,
            1 => Some(DriverReport::Any(self.u8())),
            2 => Some(DriverReport::OverCurrent(self.u8())),
            _ => Some(DriverReport::OverTemperature(self.u8())),
        }
    }

    fn counts(&mut self) -> [i32; MAX_ENCODERS] {
        std::array::from_fn(|_| self.u32() as i32)
    }

    fn tick_input(&mut self) -> TickInput {
        let twist = self.wrench();
        TickInput {
            handle: self.pose(),
            twist: WireTwist {
                linear: twist.force,
                angular: twist.torque,
            },
            bad_reading: self.bool(),
            stop_open: self.bool(),
            supply_low: self.bool(),
            impossible_posture: self.bool(),
            referenced: self.bool(),
            driver: self.driver(),
            encoder_jump: self.bool().then(|| self.u8()),
            encoder_stuck: self.bool().then(|| self.u8()),
            carried_out: self.u16(),
            stops: self.u8(),
            hash: self.u32(),
        }
    }

    fn telemetry(&mut self) -> Telemetry {
        Telemetry {
            tick: self.u32(),
            handle: self.pose(),
            object: if self.bool() {
                Some((self.u16(), self.pose()))
            } else {
                None
            },
            wrench: self.wrench(),
            contact: self.wrench(),
            hand: if self.bool() { Some(self.wrench()) } else { None },
            cost: self.u32(),
            points: self.u16(),
            flags: self.u16(),
            missed: self.u32(),
            dropped: self.u32(),
            guidance: Guidance {
                active: self.u8(),
                joints: self.u8(),
                engagement: self.f32(),
                wrench: self.wrench(),
            },
            pairs: self.list(Self::pair),
        }
    }

    fn statistics(&mut self) -> Statistics {
        Statistics {
            ticks: self.u32(),
            missed_ticks: self.u32(),
            cost_max: self.u32(),
            cost_sum: self.u64(),
            peak_force: self.f32(),
            peak_torque: self.f32(),
            points_max: self.u32(),
            state_hash: self.u64(),
            frames: self.u32(),
            bad_frames: self.u32(),
            unanswered: self.u32(),
            dropped: self.u32(),
            stack_max: self.u32(),
        }
    }

    fn capabilities(&mut self) -> Capabilities {
        Capabilities {
            board: self.name(),
            scene_capacity: self.u32(),
            scene_layout: self.u32(),
            scene: if self.bool() { Some(self.u32()) } else { None },
            tick_hz: self.u16(),
            force_axes: self.u8(),
            torque_axes: self.u8(),
            simulated: self.bool(),
            cost_unit: [CostUnit::Instructions, CostUnit::Cycles, CostUnit::Nanoseconds][self.below(3)],
            cost_budget: self.u32(),
            max_targets: self.u8(),
            reset: match self.below(7) {
                0 => ResetReason::PowerOn,
                1 => ResetReason::Requested,
                2 => ResetReason::Watchdog,
                3 => ResetReason::Panic { line: self.u32() },
                4 => ResetReason::HardFault { pc: self.u32() },
                5 => ResetReason::BrownOut,
                _ => ResetReason::Unknown,
            },
            state: self.state(),
            session: self.u32(),
        }
    }
}

/// Kinds of host message; a test compares it with the schema.
pub const TO_DEVICE: usize = 32;

/// A random host message of kind `kind < TO_DEVICE`.
pub fn to_device(kind: usize, r: &mut Random) -> ToDevice {
    match kind {
        0 => ToDevice::Hello(r.version()),
        1 => ToDevice::GetCapabilities,
        2 => ToDevice::Arm,
        3 => ToDevice::Disarm,
        4 => ToDevice::Stop,
        5 => ToDevice::ClearFault,
        6 => ToDevice::Home,
        7 => ToDevice::Heartbeat,
        8 => ToDevice::SetParameter {
            id: r.parameter(),
            value: r.f32(),
        },
        9 => ToDevice::GetParameter(r.parameter()),
        10 => ToDevice::Grab { part: r.u16() },
        11 => ToDevice::Release,
        12 => ToDevice::ResetScene,
        13 => ToDevice::SceneBegin {
            length: r.u32(),
            crc: r.u32(),
            layout: r.u32(),
        },
        14 => ToDevice::SceneChunk {
            offset: r.u32(),
            data: r.list(Random::u8),
        },
        15 => ToDevice::SceneCommit,
        16 => ToDevice::SceneAbort,
        17 => ToDevice::SetTarget(r.target()),
        18 => ToDevice::ClearTarget { id: r.u16() },
        19 => ToDevice::SetTelemetry { every_ticks: r.u16() },
        20 => ToDevice::GetStatistics { reset: r.bool() },
        21 => ToDevice::SimulatedHand(r.script()),
        22 => ToDevice::SimulatedInputs(r.list(Random::input_fault)),
        23 => ToDevice::Lockstep(r.bool()),
        24 => ToDevice::Run { ticks: r.u32() },
        25 => ToDevice::Restart,
        26 => ToDevice::SetRig(r.rig()),
        27 => ToDevice::GetRig,
        28 => ToDevice::RecordInputs(r.bool()),
        29 => ToDevice::GetReadings,
        30 => ToDevice::TestMotor {
            joint: r.u8(),
            force: r.f32(),
        },
        _ => ToDevice::Place {
            part: r.u16(),
            pose: r.pose(),
        },
    }
}

/// Kinds of board message; a test compares it with the schema.
pub const FROM_DEVICE: usize = 15;

/// A random board message of kind `kind < FROM_DEVICE`.
pub fn from_device(kind: usize, r: &mut Random) -> FromDevice {
    match kind {
        0 => FromDevice::Hello(r.version()),
        1 => FromDevice::Capabilities(r.capabilities()),
        2 => FromDevice::Ack { seq: r.u16() },
        3 => FromDevice::Refused {
            seq: r.u16(),
            reason: r.refusal(),
        },
        4 => FromDevice::Parameter {
            id: r.parameter(),
            value: r.f32(),
        },
        5 => FromDevice::State {
            tick: r.u32(),
            state: r.state(),
        },
        6 => FromDevice::Telemetry(r.telemetry()),
        7 => FromDevice::Statistics(r.statistics()),
        8 => FromDevice::Fault {
            tick: r.u32(),
            fault: r.fault(),
        },
        9 => FromDevice::Log(r.list(Random::u8)),
        10 => FromDevice::Ran {
            tick: r.u32(),
            state_hash: r.u64(),
        },
        11 => FromDevice::Rig {
            rig: r.bool().then(|| r.rig()),
            in_use: r.bool(),
        },
        12 => FromDevice::Inputs(Inputs {
            first_tick: r.u32(),
            count: [r.f32(), r.f32()],
            lost: r.u32(),
            ticks: r.list(Random::tick_input),
        }),
        13 => FromDevice::Readings(Readings {
            tick: r.u32(),
            counts: r.counts(),
            currents: r.floats(),
            referenced: r.bool(),
            stop_open: r.bool(),
            supply_low: r.bool(),
            driver: r.driver(),
        }),
        _ => FromDevice::MotorTested(MotorTest {
            moved: r.counts(),
            far: r.bool(),
        }),
    }
}
