//! Both planes and their environment, run through one sequence of events.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use mortise_firmware::channel::{COMMANDS, EVENTS, EVENTS_AT_ONCE};
use mortise_firmware::safety::{AfterSoftStop, Motors, Safety};
use mortise_protocol::frame::{Decoder, Stamp, encode_stamped};
use mortise_protocol::image::{CRC, LAYOUT_VERSION};
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, FromDevice, ToDevice, Version};
use mortise_protocol::parameter::ParameterId;

use crate::board::Line;
use crate::event::{Event, Host, ORDERS, Order};
use crate::oracle::{Broken, Oracle, Seen};
use crate::planes::{Planes, Saved};

/// The parameter that is set and read; its values, m: the default, and another. The rig is at the origin, within both.
const PARAMETER: ParameterId = ParameterId::WorkspaceRadius;
const VALUES: [f32; 2] = [1.0, 0.3];
/// Ticks of [`Event::Wait`]: a soft stop and the test of a motor take 100 each.
const WAIT_TICKS: u32 = 120;
/// Ticks of a soft stop or a test, a little fewer than it takes.
const FADE_TICKS: u32 = 99;
/// Largest number of reports to the host that one event can cause, now or by the commands it queues (checked in every step).
const REPORTS_AN_EVENT: usize = 4;
/// Largest number of commands that one event can queue (checked likewise).
const COMMANDS_AN_EVENT: usize = 1;
/// Reports that one queued command can cause.
const REPORTS_A_COMMAND: usize = 3;
/// Largest number of answers that one event can leave waiting: both frames of an upload.
const ANSWERS_AN_EVENT: usize = 2;
/// Waiting answers with which the next message is dropped.
const ANSWERS: usize = 16;

/// A frame that a host sent.
#[derive(Clone, Copy)]
struct Sent {
    stamp: Stamp,
    /// Session in which it was sent: number of the greeting.
    session: u32,
    arrived: bool,
}

/// Lengths of the queues of reports, answers and commands.
struct Queues {
    /// 0 for one that cannot be filled.
    lengths: [usize; 3],
    /// Each queued command counts, whatever it does.
    counted: bool,
}

/// State of a host.
#[derive(Clone, Copy, Default)]
struct Knows {
    /// Its session: number of the greeting; 0: none.
    session: u32,
    stamp: u32,
    count: u32,
}

/// What is outside the planes.
#[derive(Clone, Copy)]
struct Outside {
    full: bool,
    sessions: u32,
    hosts: [Knows; 2],
    /// The newest frame of each order from A.
    sent: [Option<Sent>; ORDERS],
    /// Count of the newest fresh order that arrived in this session.
    newest: u32,
    /// Of [`VALUES`], the one sent last.
    value: usize,
    /// Of [`VALUES`], those in effect since the parameter was queried.
    in_force: [bool; VALUES.len()],
    /// Number of constraint targets sent.
    targets: u16,
    /// Number of queries of the parameter without an answer yet.
    questions: u32,
    oracle: Oracle,
}

/// Both planes and their environment; see the module.
pub(crate) struct World<'i> {
    planes: Planes,
    scene: &'i [u8],
    crc: u32,
    line: Line,
    decoder: Decoder,
    outside: Outside,
}

/// The world at one moment.
pub(crate) struct Moment {
    planes: Saved,
    outside: Outside,
}

impl<'i> World<'i> {
    /// Starts with a scene, greeted by A.
    pub fn new(scene: &'i [u8]) -> Self {
        let mut world = Self {
            planes: Planes::start(scene),
            scene,
            crc: CRC.checksum(scene),
            line: Line::default(),
            decoder: Decoder::new(),
            outside: Outside {
                full: false,
                sessions: 0,
                hosts: [Knows::default(); 2],
                sent: [None; ORDERS],
                newest: 0,
                value: 0,
                in_force: [false; VALUES.len()],
                targets: 0,
                questions: 0,
                oracle: Oracle::default(),
            },
        };
        for event in [Event::Tick, Event::Hello(Host::A), Event::Tick, Event::Poll] {
            let broken = world.step(event);
            assert_eq!(broken, None, "the start itself");
        }
        world
    }

    /// The present moment, to come back to.
    pub fn save(&self) -> Moment {
        Moment {
            planes: Saved::of(&self.planes),
            outside: self.outside,
        }
    }

    /// As [`Self::save`], into a moment that is no longer needed.
    pub fn save_to(&self, moment: &mut Moment) {
        moment.planes.take(&self.planes);
        moment.outside = self.outside;
    }

    /// Goes back to a moment of this world.
    pub fn put_back(&mut self, moment: &Moment) {
        moment.planes.put_back(&mut self.planes);
        self.outside = moment.outside;
        self.line.full = self.outside.full;
    }

    /// Executes the event; returns the promise that it broke, if any.
    pub fn step(&mut self, event: Event) -> Option<Broken> {
        let (room, waiting) = (self.reports_at_most(), self.planes.link.waiting());
        let restarting = self.planes.link.restart_requested();
        let mut broken = self.execute(event);
        assert!(
            self.reports_at_most() <= room + REPORTS_AN_EVENT,
            "{event} causes more reports than REPORTS_AN_EVENT"
        );
        assert!(
            self.planes.link.waiting() <= waiting + COMMANDS_AN_EVENT,
            "{event} queues more commands than COMMANDS_AN_EVENT"
        );
        if self.outside.questions > 0 {
            self.note_value();
        }
        broken = broken.or(self.listen());
        if self.planes.rig.flash_while_driven.get() {
            broken = broken.or(Some(Broken::FlashWhileLive));
        }
        let live = self.planes.control.safety().live();
        if self.planes.link.restart_requested()
            && (live || !(restarting || self.outside.oracle.may_restart()))
        {
            broken = broken.or(Some(Broken::Restart));
        }
        broken
    }

    /// Executes the event; returns the promise that a tick broke.
    fn execute(&mut self, event: Event) -> Option<Broken> {
        match event {
            Event::Hello(host) => self.greet(host),
            Event::Send(host, order) => {
                let sent = self.compose(host, order);
                let arrived = self.arrive(order, sent);
                if host == Host::A {
                    self.outside.sent[order as usize] = Some(arrived);
                }
            }
            Event::Hold(order) => self.outside.sent[order as usize] = Some(self.compose(Host::A, order)),
            Event::Deliver(order) => {
                let sent = self.outside.sent[order as usize];
                let arrived = self.arrive(order, sent.unwrap_or_else(|| self.earlier()));
                self.outside.sent[order as usize] = sent.map(|_| arrived);
            }
            Event::Read => self.query(),
            Event::Stop => {
                self.outside.oracle.stop();
                self.receive(None, &ToDevice::Stop);
            }
            Event::Disarm => {
                if self.is_queued(&ToDevice::Disarm) {
                    self.outside.oracle.disarm();
                }
            }
            Event::Release => {
                if self.is_queued(&ToDevice::Release) {
                    self.outside.oracle.release();
                }
            }
            Event::Target => {
                self.outside.targets += 1;
                self.receive(None, &ToDevice::SetTarget(target(self.outside.targets)));
            }
            Event::Damage => self.planes.chip.damage(),
            Event::Lose => self.planes.rig.sense(|sensed| sensed.referenced = false),
            Event::StopInput => self.planes.rig.sense(|sensed| sensed.stop_open ^= true),
            Event::Full => {
                self.outside.full ^= true;
                self.line.full = self.outside.full;
            }
            Event::Tick => return self.tick(),
            Event::Poll => {
                self.planes.link.poll(&mut self.line);
            }
            Event::Wait => return self.wait(),
        }
        None
    }

    /// Delivers a message; whether the control plane will receive it.
    fn is_queued(&mut self, message: &ToDevice) -> bool {
        let before = self.planes.link.waiting();
        self.receive(None, message);
        self.planes.link.waiting() > before
    }

    /// Reports that wait, and those that the queued commands can cause.
    fn reports_at_most(&self) -> usize {
        self.planes.link.reported() + REPORTS_A_COMMAND * self.planes.link.waiting()
    }

    /// A host queries the parameter.
    fn query(&mut self) {
        // A second query before the answer to the first: either answer may come, in the order of the queries.
        self.note_value();
        let coming = self.planes.link.parameters().get(PARAMETER);
        self.outside.in_force[index(coming)] = true;
        self.outside.questions += 1;
        self.receive(None, &ToDevice::GetParameter(PARAMETER));
    }

    fn note_value(&mut self) {
        self.outside.in_force[index(self.acting())] = true;
    }

    fn greet(&mut self, host: Host) {
        self.outside.sessions += 1;
        self.outside.oracle.greeted();
        self.outside.newest = 0;
        self.no_questions();
        self.receive(None, &ToDevice::Hello(Version::own()));
        self.outside.hosts[host as usize] = Knows {
            session: self.outside.sessions,
            stamp: self.planes.link.session(),
            count: 0,
        };
    }

    fn no_questions(&mut self) {
        self.outside.questions = 0;
        self.outside.in_force = [false; VALUES.len()];
    }

    fn compose(&mut self, host: Host, order: Order) -> Sent {
        if order == Order::Set {
            self.outside.value = (self.outside.value + 1) % VALUES.len();
        }
        let knows = &mut self.outside.hosts[host as usize];
        knows.count += 1;
        Sent {
            stamp: Stamp {
                session: knows.stamp,
                count: knows.count,
            },
            session: knows.session,
            arrived: false,
        }
    }

    /// A frame of a session before the first.
    fn earlier(&self) -> Sent {
        Sent {
            stamp: Stamp {
                session: self.planes.link.session().wrapping_sub(1 << 16),
                count: 1,
            },
            session: 0,
            arrived: false,
        }
    }

    /// By the independent record: the frame never arrived, is of this session, and no later frame has arrived.
    fn is_fresh(&self, sent: &Sent) -> bool {
        let outside = &self.outside;
        !sent.arrived && sent.session == outside.sessions && sent.stamp.count > outside.newest
    }

    fn arrive(&mut self, order: Order, mut sent: Sent) -> Sent {
        if self.is_fresh(&sent) {
            match order {
                Order::Arm => {
                    let slot = self.slot_in_use();
                    let sound = slot.is_some_and(|slot| self.planes.chip.holds(slot, self.scene));
                    self.outside.oracle.arm(sound);
                }
                Order::Clear => self.outside.oracle.clear(),
                Order::Grab => self.outside.oracle.grab(),
                Order::Restart => self.outside.oracle.restart(),
                Order::Test => self.outside.oracle.test(),
                Order::Home | Order::Set | Order::Upload | Order::Commit => {}
            }
            self.outside.newest = sent.stamp.count;
        }
        sent.arrived = true;
        let message = match order {
            Order::Clear => ToDevice::ClearFault,
            Order::Arm => ToDevice::Arm,
            Order::Grab => ToDevice::Grab { part: 0 },
            Order::Home => ToDevice::Home,
            Order::Set => ToDevice::SetParameter {
                id: PARAMETER,
                value: VALUES[self.outside.value],
            },
            Order::Upload => ToDevice::SceneBegin {
                length: self.scene.len() as u32,
                crc: self.crc,
                layout: LAYOUT_VERSION,
            },
            Order::Commit => ToDevice::SceneCommit,
            Order::Restart => ToDevice::Restart,
            Order::Test => ToDevice::TestMotor { joint: 0, force: 1.0 },
        };
        self.receive(Some(sent.stamp), &message);
        if order == Order::Upload {
            // These need no freshness.
            for (index, piece) in self.scene.chunks(MAX_CHUNK).enumerate() {
                let chunk = ToDevice::SceneChunk {
                    offset: (index * MAX_CHUNK) as u32,
                    data: piece.iter().copied().collect(),
                };
                self.receive(None, &chunk);
            }
        }
        sent
    }

    fn receive(&mut self, stamp: Option<Stamp>, message: &ToDevice) {
        let mut wire = [0; MAX_FRAME];
        match encode_stamped(0, stamp, message, &mut wire) {
            Ok(bytes) => self.planes.link.receive(bytes, &mut self.line),
            Err(error) => panic!("{message:?} does not fit a frame: {error:?}"),
        }
    }

    /// Runs more ticks than a soft stop takes.
    fn wait(&mut self) -> Option<Broken> {
        let mut broken = self.tick();
        let fades = matches!(
            self.planes.control.safety().motors(),
            Motors::Fading | Motors::Tested
        );
        for _ in 1..WAIT_TICKS {
            broken = broken.or(self.tick());
        }
        let late = fades && self.planes.control.safety().live();
        broken.or(late.then_some(Broken::FadeLate))
    }

    /// The slot in flash of the scene that the control plane uses.
    fn slot_in_use(&self) -> Option<usize> {
        let scene = self.planes.control.scene()?;
        self.planes
            .chip
            .slot_at(std::ptr::from_ref(scene.header()).cast())
    }

    fn tick(&mut self) -> Option<Broken> {
        let slot = self.slot_in_use();
        let booting = self.planes.control.safety() == Safety::Boot;
        self.planes.tick();
        assert!(
            booting || self.planes.link.waiting() == 0,
            "a tick takes every command"
        );
        let state = self.planes.control.safety();
        let live = state.live();
        let halted = matches!(
            state,
            Safety::Stopped | Safety::Fault(_) | Safety::SoftStop(AfterSoftStop::Fault(_))
        );
        let rig = &self.planes.rig;
        let seen = Seen {
            live,
            held: live && state.motors() != Motors::Fading,
            active: state == Safety::Active,
            tested: state == Safety::Testing,
            halted,
            referenced: rig.sensed.get().referenced,
            other_scene: self.slot_in_use() != slot,
        };
        let broken = self.outside.oracle.tick(&seen);
        let differs = live != rig.driven.get();
        // Every queued command has been executed: the value assumed by the link plane must be in effect.
        let believed = self.planes.link.parameters().get(PARAMETER) == self.acting();
        broken
            .or(differs.then_some(Broken::StateDiffers))
            .or((!believed).then_some(Broken::ReadBack))
    }

    fn acting(&self) -> f32 {
        self.planes.control.settings().safety.workspace_m
    }

    /// Processes the board's output.
    fn listen(&mut self) -> Option<Broken> {
        let mut broken = None;
        for byte in std::mem::take(&mut self.line.bytes) {
            if let Some(Ok((_, FromDevice::Parameter { value, .. }))) = self.decoder.push(byte)
                && self.outside.questions > 0
            {
                if !self.outside.in_force[index(value)] {
                    broken = Some(Broken::ReadBack);
                }
                self.outside.questions -= 1;
                if self.outside.questions == 0 {
                    self.no_questions();
                }
            }
        }
        broken
    }

    /// Equal for worlds that behave alike under any `left` more events. The planes must be put back afterwards: their queues are emptied.
    pub fn fingerprint(&mut self, left: usize) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.timers(left).hash(&mut hasher);
        let queues = self.queues(left);
        queues.lengths.hash(&mut hasher);
        let number = self.planes.control.scene_number();
        self.planes.control.fingerprint(queues.counted, &mut hasher);
        self.planes.link.fingerprint(number, &mut hasher);
        self.outside_fingerprint(left, &mut hasher);
        hasher.finish()
    }

    /// The counters of ticks, as far as `left` events can let them decide anything: a soft stop that single ticks cannot end, but any wait does, is
    /// one that just began, and a silence that no wait can make too long is none.
    fn timers(&self, left: usize) -> (u32, u32) {
        let timers = self.planes.control.timers();
        let left = left as u32;
        let fades = timers.fade + left < FADE_TICKS;
        let silent = timers.silent + left * WAIT_TICKS <= timers.timeout;
        (
            if fades { 0 } else { timers.fade },
            if silent { 0 } else { timers.silent },
        )
    }

    /// The lengths of the queues, as far as `left` events can fill them.
    fn queues(&self, left: usize) -> Queues {
        let (reports, link) = (self.reports_at_most(), &self.planes.link);
        let (commands, answers) = (link.waiting(), link.unsent());
        let has_room = reports + left * REPORTS_AN_EVENT <= EVENTS - EVENTS_AT_ONCE;
        let has_places = answers + left * ANSWERS_AN_EVENT < ANSWERS;
        let has_space = commands + left * COMMANDS_AN_EVENT <= COMMANDS;
        Queues {
            lengths: [
                if has_room { 0 } else { link.reported() },
                if has_places { 0 } else { answers },
                if has_space { 0 } else { commands },
            ],
            counted: !has_room || !has_space,
        }
    }

    fn outside_fingerprint(&self, left: usize, hash: &mut impl Hasher) {
        let (outside, sensed) = (&self.outside, self.planes.rig.sensed.get());
        let flags = [
            sensed.referenced,
            sensed.stop_open,
            self.planes.rig.driven.get(),
            self.planes.chip.is_damaged(),
            outside.full,
        ];
        (flags, outside.questions, outside.in_force).hash(hash);
        outside.oracle.hash(hash);
        for knows in &outside.hosts {
            (knows.session == outside.sessions).hash(hash);
        }
        // A frame that arrives as the last event reaches the queue only, and the uploads and commits of A are never late.
        if left < 2 {
            return;
        }
        outside.value.hash(hash);
        // Frames that can have an effect, in the order in which they were sent.
        let mut order: [Option<(u32, usize, bool)>; ORDERS] = [None; ORDERS];
        for (index, sent) in outside.sent.iter().enumerate() {
            order[index] = sent
                .filter(|sent| self.planes.link.is_fresh(sent.stamp))
                .map(|sent| (sent.stamp.count, index, self.is_fresh(&sent)));
        }
        order.sort_unstable();
        for (_, index, fresh) in order.into_iter().flatten() {
            (index, fresh).hash(hash);
        }
    }
}

/// A constraint target that guides the grabbed part; the numbers increase as a host's do.
fn target(sequence: u16) -> ConstraintTarget {
    let feature = Feature {
        point: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
    };
    ConstraintTarget {
        id: 0,
        sequence,
        kind: ConstraintKind::Concentric,
        moving: feature,
        static_part: 1,
        fixed: feature,
        stiffness: 1000.0,
        force_cap: 1.0,
        torque_cap: 0.01,
        expiry_ticks: 200,
        path: None,
        faces: Default::default(),
    }
}

/// Which of [`VALUES`] this is.
fn index(value: f32) -> usize {
    let found = VALUES.iter().position(|known| *known == value);
    found.unwrap_or_else(|| panic!("{value} m was never sent"))
}
