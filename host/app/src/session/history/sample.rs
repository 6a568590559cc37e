//! One sample of the loop, as the plots need it.

use mortise_protocol::message::{Telemetry, WirePose, WireWrench};

use crate::session::pose;

/// One sample of the loop. A value that the message does not have is not a number, such as the object's position while nothing is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Board time as sent; in the history, time since the first sample kept there, s.
    pub time_s: f64,
    /// Magnitude of the force on the handle, N.
    pub handle_n: f32,
    /// Magnitude of the contacts' force on the object, N.
    pub contact_n: f32,
    /// Magnitude of the torque on the handle, N·m.
    pub handle_nm: f32,
    /// Magnitude of the contacts' torque on the object, N·m.
    pub contact_nm: f32,
    /// Wrench on the handle: force N, torque N·m.
    pub handle: [[f32; 3]; 2],
    /// Wrench of the contacts on the object.
    pub contact: [[f32; 3]; 2],
    /// Wrench of the simulated hand on the handle.
    pub hand: [[f32; 3]; 2],
    /// Wrench of the guidance targets on the object.
    pub guidance: [[f32; 3]; 2],
    /// Position of the handle, mm, and its rotation vector, degrees.
    pub handle_pose: [[f32; 3]; 2],
    /// Position of the object, mm, and its rotation vector, degrees.
    pub object_pose: [[f32; 3]; 2],
    /// Speed of the handle, mm/s, over the time from the sample before.
    pub handle_mm_s: f32,
    /// Speed of the object, mm/s, likewise.
    pub object_mm_s: f32,
    /// Deepest penetration, µm.
    pub depth_um: f32,
    /// Insertion depth of the deepest pair, mm.
    pub insertion_mm: f32,
    /// Largest engagement of the guidance targets, 0 to 1.
    pub engagement: f32,
    /// Guidance targets in force.
    pub targets: u8,
    /// Pairs of faces that touch.
    pub pairs: u8,
    /// Points queried in the tick.
    pub points: u16,
    /// Cost of the tick, in the board's unit.
    pub cost: f32,
    /// Loop overruns since the board started.
    pub late: u32,
    /// Messages dropped since the board started.
    pub dropped: u32,
}

impl Default for Sample {
    /// At rest, with nothing held.
    fn default() -> Self {
        const NONE: [[f32; 3]; 2] = [[f32::NAN; 3]; 2];
        Self {
            time_s: 0.0,
            handle_n: 0.0,
            contact_n: 0.0,
            handle_nm: 0.0,
            contact_nm: 0.0,
            handle: [[0.0; 3]; 2],
            contact: [[0.0; 3]; 2],
            hand: NONE,
            guidance: [[0.0; 3]; 2],
            handle_pose: [[0.0; 3]; 2],
            object_pose: NONE,
            handle_mm_s: f32::NAN,
            object_mm_s: f32::NAN,
            depth_um: 0.0,
            insertion_mm: 0.0,
            engagement: 0.0,
            targets: 0,
            pairs: 0,
            points: 0,
            cost: 0.0,
            late: 0,
            dropped: 0,
        }
    }
}

impl Sample {
    /// The sample of a telemetry message from a board of `tick_hz` ticks a second. Speeds need the sample before, see [`Self::with_speeds`].
    pub fn of(telemetry: &Telemetry, tick_hz: u16) -> Self {
        let none = Self::default();
        let deepest = telemetry.pairs.first();
        Self {
            time_s: f64::from(telemetry.tick) / f64::from(tick_hz.max(1)),
            handle_n: length(telemetry.wrench.force),
            contact_n: length(telemetry.contact.force),
            handle_nm: length(telemetry.wrench.torque),
            contact_nm: length(telemetry.contact.torque),
            handle: wrench(&telemetry.wrench),
            contact: wrench(&telemetry.contact),
            hand: telemetry.hand.as_ref().map_or(none.hand, wrench),
            guidance: wrench(&telemetry.guidance.wrench),
            handle_pose: placed(&telemetry.handle),
            object_pose: (telemetry.object.as_ref()).map_or(none.object_pose, |(_, at)| placed(at)),
            depth_um: deepest.map_or(0.0, |pair| 1e6 * pair.depth),
            insertion_mm: deepest.map_or(0.0, |pair| 1e3 * pair.insertion),
            engagement: telemetry.guidance.engagement,
            targets: telemetry.guidance.active,
            pairs: u8::try_from(telemetry.pairs.len()).unwrap_or(u8::MAX),
            points: telemetry.points,
            cost: telemetry.cost as f32,
            late: telemetry.missed,
            dropped: telemetry.dropped,
            ..none
        }
    }

    /// The sample with its speeds, from the way since the sample before.
    pub fn with_speeds(mut self, before: &Self) -> Self {
        let seconds = (self.time_s - before.time_s) as f32;
        let speed = |now: [f32; 3], then: [f32; 3]| {
            let way = [0, 1, 2].map(|i| now[i] - then[i]);
            length(way) / seconds
        };
        if seconds > 0.0 {
            self.handle_mm_s = speed(self.handle_pose[0], before.handle_pose[0]);
            self.object_mm_s = speed(self.object_pose[0], before.object_pose[0]);
        } else {
            (self.handle_mm_s, self.object_mm_s) = (before.handle_mm_s, before.object_mm_s);
        }
        self
    }
}

/// Length of a vector.
pub(super) fn length(v: [f32; 3]) -> f32 {
    v.iter().map(|x| x * x).sum::<f32>().sqrt()
}

fn wrench(wrench: &WireWrench) -> [[f32; 3]; 2] {
    [wrench.force, wrench.torque]
}

/// Position, mm, and rotation vector, degrees.
fn placed(at: &WirePose) -> [[f32; 3]; 2] {
    let position = at.position.map(|x| pose::MM_PER_M as f32 * x);
    let turn = glam::DQuat::from_mat3(&pose::from_wire(at).matrix3).to_scaled_axis();
    [position, turn.to_array().map(|x| x.to_degrees() as f32)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_the_way_by_the_time() {
        let at = |time_s, x| Sample {
            time_s,
            handle_pose: [[x, 0.0, 0.0], [0.0; 3]],
            ..Sample::default()
        };
        let moved = at(1.5, 8.0).with_speeds(&at(1.0, 5.0));
        assert_eq!(moved.handle_mm_s, 6.0);
        assert!(moved.object_mm_s.is_nan(), "nothing is held");
        // The same message twice: no time has passed.
        assert_eq!(at(1.5, 8.0).with_speeds(&moved).handle_mm_s, 6.0);
    }

    #[test]
    fn a_pose_is_shown_in_millimetres_and_degrees() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let [position, turn] = placed(&WirePose {
            position: [0.1, 0.0, -0.02],
            orientation: [0.0, 0.0, half, half],
        });
        assert_eq!(position, [100.0, 0.0, -20.0]);
        assert!((turn[2] - 90.0).abs() < 1e-3, "{turn:?}");
    }
}
