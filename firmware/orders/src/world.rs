//! Both planes and their environment, run through one sequence of events.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use mortise_firmware::channel::Channels;
use mortise_firmware::control::ControlPlane;
use mortise_firmware::device::start;
use mortise_firmware::link::LinkPlane;
use mortise_firmware::safety::{AfterSoftStop, Safety};
use mortise_protocol::frame::{Decoder, Stamp, encode_stamped};
use mortise_protocol::image::{CRC, LAYOUT_VERSION};
use mortise_protocol::limits::{MAX_CHUNK, MAX_FRAME};
use mortise_protocol::message::{FromDevice, ToDevice, Version};
use mortise_protocol::parameter::ParameterId;

use crate::board::{Chip, ChipFlash, IDENTITY, Line, NoClock, Puppet, Rig};
use crate::event::{Event, Host, ORDERS, Order};
use crate::oracle::{Broken, Oracle};

/// The parameter that is set and read; its two values, m. The rig is at the origin, within both.
const PARAMETER: ParameterId = ParameterId::WorkspaceRadius;
const VALUES: [f32; 2] = [0.05, 0.3];
/// Ticks of [`Event::Wait`]: a soft stop takes 100.
const WAIT_TICKS: u32 = 120;

/// A frame that a host sent.
#[derive(Clone)]
struct Sent {
    bytes: Vec<u8>,
    /// Frames after it that need no freshness.
    rest: Vec<u8>,
    stamp: Stamp,
    /// Session in which it was sent: number of the greeting.
    session: u32,
    arrived: bool,
}

/// State of a host.
#[derive(Clone, Copy, Default)]
struct Knows {
    /// Its session: number of the greeting; 0: none.
    session: u32,
    stamp: u32,
    count: u32,
}

/// Both planes and their environment; see the module.
pub(crate) struct World<'c, 's> {
    link: LinkPlane<'c, 's, ChipFlash<'s>>,
    control: ControlPlane<'c, 's, Puppet<'s>, NoClock>,
    chip: &'s Chip,
    rig: &'s Rig,
    scene: &'s [u8],
    line: Line,
    decoder: Decoder,
    sessions: u32,
    hosts: [Knows; 2],
    /// The newest frame of each order from A.
    sent: [Option<Sent>; ORDERS],
    /// Count of the newest fresh order that arrived in this session.
    newest: u32,
    value: usize,
    /// Values in effect since the parameter was queried; `None`: no query.
    in_force: Option<Vec<f32>>,
    /// Number of queries of the parameter without an answer yet.
    questions: u32,
    oracle: Oracle,
    /// Content of the queues: the events since the last tick that put a command into the queue or made one in it outdated, and the result of each
    /// tick since the last poll that could forward anything.
    queued: Vec<Event>,
    said: Vec<(Vec<Event>, Safety)>,
}

impl<'c, 's> World<'c, 's> {
    /// Starts with a scene, greeted by A.
    pub fn new(channels: &'c mut Channels<'s>, chip: &'s Chip, rig: &'s Rig, scene: &'s [u8]) -> Self {
        let (link, control) = start(channels, ChipFlash { chip, rig }, Puppet(rig), NoClock, IDENTITY);
        let mut world = Self {
            link,
            control,
            chip,
            rig,
            scene,
            line: Line::default(),
            decoder: Decoder::new(),
            sessions: 0,
            hosts: [Knows::default(); 2],
            sent: [const { None }; ORDERS],
            newest: 0,
            value: 0,
            in_force: None,
            questions: 0,
            oracle: Oracle::default(),
            queued: Vec::new(),
            said: Vec::new(),
        };
        for event in [Event::Tick, Event::Hello(Host::A), Event::Tick, Event::Poll] {
            let broken = world.step(event);
            assert_eq!(broken, None, "the start itself");
        }
        world
    }

    /// Whether the event can occur in this state.
    pub fn can(&self, event: Event) -> bool {
        match event {
            Event::Deliver(order) => self.sent[order as usize].is_some(),
            Event::Send(Host::B, _) => self.hosts[1].session != 0,
            _ => true,
        }
    }

    /// Executes the event; returns the promise that it broke, if any.
    pub fn step(&mut self, event: Event) -> Option<Broken> {
        let waiting = self.link.waiting();
        let mut broken = None;
        match event {
            Event::Hello(host) => self.greet(host),
            Event::Send(host, order) => {
                let mut sent = self.compose(host, order);
                self.arrive(order, &mut sent);
                if host == Host::A {
                    self.sent[order as usize] = Some(sent);
                }
            }
            Event::Hold(order) => self.sent[order as usize] = Some(self.compose(Host::A, order)),
            Event::Deliver(order) => {
                if let Some(mut sent) = self.sent[order as usize].take() {
                    self.arrive(order, &mut sent);
                    self.sent[order as usize] = Some(sent);
                }
            }
            Event::Read => self.query(),
            Event::Stop => {
                self.oracle.stop();
                let bytes = frame(None, &ToDevice::Stop);
                self.receive(&bytes);
            }
            Event::Damage => self.chip.damage(),
            Event::Lose => self.rig.sense(|sensed| sensed.referenced = false),
            Event::StopInput => self.rig.sense(|sensed| sensed.stop_open ^= true),
            Event::Full => self.line.full ^= true,
            Event::Tick => broken = self.tick(),
            Event::Poll => {
                self.link.poll(&mut self.line);
                if !self.line.full {
                    self.said.clear();
                }
            }
            Event::Wait => {
                for _ in 0..WAIT_TICKS {
                    broken = broken.or(self.tick());
                }
            }
        }
        let outdates = matches!(event, Event::Stop | Event::Hello(_)) && !self.queued.is_empty();
        if (self.link.waiting() > waiting || outdates) && self.queued.last() != Some(&event) {
            self.queued.push(event);
        }
        let acting = self.acting();
        if let Some(values) = &mut self.in_force {
            values.push(acting);
        }
        broken = broken.or(self.listen());
        if self.rig.flash_while_driven.get() {
            broken = broken.or(Some(Broken::FlashWhileLive));
        }
        broken
    }

    /// A host queries the parameter.
    fn query(&mut self) {
        let coming = self.link.parameters().get(PARAMETER);
        // A second query before the answer to the first: either answer may come, in the order of the queries.
        let acting = self.acting();
        self.in_force.get_or_insert_default().extend([acting, coming]);
        self.questions += 1;
        let bytes = frame(None, &ToDevice::GetParameter(PARAMETER));
        self.receive(&bytes);
    }

    fn greet(&mut self, host: Host) {
        self.sessions += 1;
        self.oracle.greeted();
        self.newest = 0;
        self.in_force = None;
        self.questions = 0;
        let bytes = frame(None, &ToDevice::Hello(Version::own()));
        self.receive(&bytes);
        self.hosts[host as usize] = Knows {
            session: self.sessions,
            stamp: self.link.session(),
            count: 0,
        };
    }

    fn compose(&mut self, host: Host, order: Order) -> Sent {
        let knows = &mut self.hosts[host as usize];
        knows.count += 1;
        let stamp = Stamp {
            session: knows.stamp,
            count: knows.count,
        };
        let session = knows.session;
        let mut rest = Vec::new();
        let message = match order {
            Order::Clear => ToDevice::ClearFault,
            Order::Arm => ToDevice::Arm,
            Order::Grab => ToDevice::Grab { part: 0 },
            Order::Home => ToDevice::Home,
            Order::Set => {
                self.value = 1 - self.value;
                ToDevice::SetParameter {
                    id: PARAMETER,
                    value: VALUES[self.value],
                }
            }
            Order::Upload => {
                for (index, piece) in self.scene.chunks(MAX_CHUNK).enumerate() {
                    let chunk = ToDevice::SceneChunk {
                        offset: (index * MAX_CHUNK) as u32,
                        data: piece.iter().copied().collect(),
                    };
                    rest.extend(frame(None, &chunk));
                }
                ToDevice::SceneBegin {
                    length: self.scene.len() as u32,
                    crc: CRC.checksum(self.scene),
                    layout: LAYOUT_VERSION,
                }
            }
            Order::Commit => ToDevice::SceneCommit,
        };
        Sent {
            bytes: frame(Some(stamp), &message),
            rest,
            stamp,
            session,
            arrived: false,
        }
    }

    /// By the independent record: the frame never arrived, is of this session, and no later frame has arrived.
    fn is_fresh(&self, sent: &Sent) -> bool {
        !sent.arrived && sent.session == self.sessions && sent.stamp.count > self.newest
    }

    fn arrive(&mut self, order: Order, sent: &mut Sent) {
        let fresh = self.is_fresh(sent);
        match order {
            Order::Arm => self.oracle.arm(fresh, self.link.store().is_sound()),
            Order::Clear => self.oracle.clear(fresh),
            _ => {}
        }
        if fresh {
            self.newest = sent.stamp.count;
        }
        sent.arrived = true;
        self.receive(&sent.bytes);
        self.receive(&sent.rest);
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.link.receive(bytes, &mut self.line);
    }

    fn tick(&mut self) -> Option<Broken> {
        self.control.tick();
        let state = self.control.safety();
        let queued = std::mem::take(&mut self.queued);
        if !queued.is_empty() || self.said.last().is_some_and(|(_, before)| *before != state) {
            self.said.push((queued, state));
        }
        let live = state.live();
        let halted = matches!(
            state,
            Safety::Stopped | Safety::Fault(_) | Safety::SoftStop(AfterSoftStop::Fault(_))
        );
        let broken = self.oracle.tick(live, halted, self.rig.sensed.get().referenced);
        let differs = live != self.rig.driven.get();
        // Every queued command has been executed: the value assumed by the link plane must be in effect.
        let believed = self.link.parameters().get(PARAMETER) == self.acting();
        broken
            .or(differs.then_some(Broken::StateDiffers))
            .or((!believed).then_some(Broken::ReadBack))
    }

    fn acting(&self) -> f32 {
        self.control.settings().safety.workspace_m
    }

    /// Processes the board's output.
    fn listen(&mut self) -> Option<Broken> {
        let mut broken = None;
        for byte in std::mem::take(&mut self.line.bytes) {
            if let Some(Ok((_, FromDevice::Parameter { value, .. }))) = self.decoder.push(byte)
                && let Some(values) = &self.in_force
            {
                if !values.contains(&value) {
                    broken = Some(Broken::ReadBack);
                }
                self.questions = self.questions.saturating_sub(1);
                if self.questions == 0 {
                    self.in_force = None;
                }
            }
        }
        broken
    }

    /// Equal for equivalent worlds.
    pub fn fingerprint(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        let hash = &mut hasher;
        self.link.fingerprint(hash);
        self.control.fingerprint(hash);
        let sensed = self.rig.sensed.get();
        (sensed.referenced, sensed.stop_open, self.rig.driven.get()).hash(hash);
        (self.line.full, self.link.store().is_sound(), self.value).hash(hash);
        for knows in &self.hosts {
            (knows.session == self.sessions, knows.session != 0).hash(hash);
        }
        // Frames by their possible effect, in the order in which they were sent.
        let mut order: Vec<(u32, usize)> = Vec::with_capacity(ORDERS);
        for (index, sent) in self.sent.iter().enumerate() {
            let Some(sent) = sent else {
                continue;
            };
            let takeable = self.link.is_fresh(sent.stamp);
            (index, takeable).hash(hash);
            if takeable {
                (self.is_fresh(sent), sent.arrived).hash(hash);
                order.push((sent.stamp.count, index));
            }
        }
        order.sort_unstable();
        order.iter().for_each(|(_, index)| index.hash(hash));
        let mut values: Vec<u32> = self.in_force.iter().flatten().map(|v| v.to_bits()).collect();
        values.sort_unstable();
        values.dedup();
        (self.questions, values).hash(hash);
        self.oracle.hash(hash);
        self.queued.hash(hash);
        for (queued, state) in &self.said {
            (queued, std::mem::discriminant(state)).hash(hash);
        }
        hasher.finish()
    }
}

fn frame(stamp: Option<Stamp>, message: &ToDevice) -> Vec<u8> {
    let mut wire = [0; MAX_FRAME];
    match encode_stamped(0, stamp, message, &mut wire) {
        Ok(bytes) => bytes.to_vec(),
        Err(error) => panic!("{message:?} does not fit a frame: {error:?}"),
    }
}
