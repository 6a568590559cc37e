//! The mechanism of a rig's description between encoder counts and motor currents, the same on a real board and in simulation.

use mortise_protocol::limits::MAX_JOINTS;
use mortise_protocol::rig::{Rig, RigFault};

use crate::encoder_watch::{EncoderWatch, probed};
use crate::interface::{Drive, Sensed};
use crate::joints::{ENCODERS, Joints};

/// A described mechanism: joints, encoder watch and drive state; see the module.
#[derive(Clone, Debug)]
pub struct DescribedMechanism {
    joints: Joints,
    watch: EncoderWatch<ENCODERS>,
    /// A grabbed part is rendered.
    rendered: bool,
    /// Currents without the encoders' probes, A.
    driven: [f32; MAX_JOINTS],
    /// Counts of the last reading.
    counts: [i32; ENCODERS],
    referenced: bool,
}

impl DescribedMechanism {
    /// The mechanism in its home pose with all counts 0, motors off, no part rendered. `referenced`: the home pose is known rather than assumed.
    ///
    /// # Errors
    /// See [`crate::kinematics::Model::new`].
    pub fn new(rig: &Rig, referenced: bool) -> Result<Self, RigFault> {
        Ok(Self {
            joints: Joints::new(rig)?,
            watch: EncoderWatch::new(),
            rendered: false,
            driven: [0.0; MAX_JOINTS],
            counts: [0; ENCODERS],
            referenced,
        })
    }

    /// Kinematics, scales and limits.
    pub fn joints(&self) -> &Joints {
        &self.joints
    }

    /// Processes the counts of one tick: pose, velocity and encoder faults. The reference is lost with the first jump and in an impossible posture.
    pub fn read(&mut self, counts: &[i32; ENCODERS]) -> Sensed {
        self.counts = *counts;
        let reading = self.joints.read(counts);
        let encoder_stuck = if self.rendered {
            self.watch
                .update(&self.joints.axis_ticks(&reading.moved, &self.driven))
        } else {
            self.watch.rest();
            None
        };
        self.referenced &= reading.jump.is_none() && !reading.impossible;
        Sensed {
            handle: reading.handle,
            twist: reading.twist,
            encoder_jump: reading.jump,
            impossible_posture: reading.impossible,
            encoder_stuck,
            referenced: self.referenced,
            ..Sensed::AT_REST
        }
    }

    /// Currents for the motors (A, signed in the motor's sense) in the posture of the last reading, with the encoders' probes while a part is
    /// rendered; zero with the motors off. See [`Joints::currents`].
    pub fn currents(&mut self, drive: Drive) -> [f32; MAX_JOINTS] {
        self.driven = match drive {
            Drive::Off => [0.0; MAX_JOINTS],
            Drive::Wrench(wrench) => self.joints.currents(wrench.force),
            Drive::Joint { joint, force } => self.joints.joint_currents(usize::from(joint), force),
        };
        let mut currents = self.driven;
        if drive == Drive::Off || !self.rendered {
            return currents;
        }
        for (joint, current) in currents.iter_mut().enumerate() {
            if let Some(amplitude) = self.joints.probe(joint) {
                *current = probed(*current, amplitude, self.watch.share(joint));
            }
        }
        currents
    }

    /// Motors of the joints.
    pub fn motors(&self) -> u8 {
        self.joints.model().joints() as u8
    }

    /// Counts of the last reading.
    pub fn counts(&self) -> [i32; ENCODERS] {
        self.counts
    }

    /// Currents of the last drive command without the encoders' probes, A.
    pub fn driven(&self) -> [f32; MAX_JOINTS] {
        self.driven
    }

    /// See [`crate::interface::Mechanism::watch_encoders`].
    pub fn watch_encoders(&mut self, rendered: bool) {
        self.rendered = rendered;
    }

    /// Sets the reference: the mechanism rests at these counts, with which the next reading is compared.
    pub fn reference(&mut self, counts: &[i32; ENCODERS]) {
        self.watch.rest();
        self.joints.start_at(counts);
        self.counts = *counts;
        self.referenced = true;
    }

    /// Returns to the initial state: in the home pose, which is known.
    pub fn reset(&mut self) {
        self.reference(&[0; ENCODERS]);
        self.rendered = false;
        self.driven = [0.0; MAX_JOINTS];
    }
}
