//! Counters of the control plane and the state hash.

use glam::{Quat, Vec3};
use mortise_haptics::{Pose, Twist, Wrench};
use mortise_protocol::message::Statistics;

/// 64-bit FNV-1a over 32-bit words where the original takes octets: a quarter of the multiplications in the tick.
///
/// Two runs with equal hashes agree in every bit of every word (up to a chance of 2⁻⁶⁴), −0 and NaN patterns included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateHash(u64);

impl Default for StateHash {
    fn default() -> Self {
        Self::new()
    }
}

impl StateHash {
    /// FNV's offset basis.
    pub const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// The hash so far.
    pub const fn value(self) -> u64 {
        self.0
    }

    fn word(&mut self, x: f32) {
        self.0 = (self.0 ^ u64::from(x.to_bits())).wrapping_mul(0x0000_0100_0000_01b3);
    }

    fn vector(&mut self, v: Vec3) {
        self.word(v.x);
        self.word(v.y);
        self.word(v.z);
    }

    fn pose(&mut self, pose: &Pose) {
        let Quat { x, y, z, w } = pose.orientation;
        self.vector(pose.position);
        for part in [x, y, z, w] {
            self.word(part);
        }
    }

    /// Adds one tick: handle, object if one is grabbed (pose, then twist: linear, angular), commanded wrench (force, torque).
    pub fn tick(&mut self, handle: &Pose, object: Option<&(Pose, Twist)>, wrench: &Wrench) {
        self.pose(handle);
        if let Some((pose, twist)) = object {
            self.pose(pose);
            self.vector(twist.linear);
            self.vector(twist.angular);
        }
        self.vector(wrench.force);
        self.vector(wrench.torque);
    }
}

/// Adds one tick's cost and work; totals saturate instead of wrapping.
pub fn count_tick(statistics: &mut Statistics, cost: u32, points: u32, wrench: &Wrench) {
    statistics.ticks = statistics.ticks.saturating_add(1);
    statistics.cost_max = statistics.cost_max.max(cost);
    statistics.cost_sum = statistics.cost_sum.saturating_add(u64::from(cost));
    statistics.points_max = statistics.points_max.max(points);
    statistics.peak_force = statistics
        .peak_force
        .max(libm::sqrtf(wrench.force.length_squared()));
    statistics.peak_torque = statistics
        .peak_torque
        .max(libm::sqrtf(wrench.torque.length_squared()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_is_pinned() {
        // Computed by hand with the definition above: 13 words of handle and wrench, all +0 but the quaternion's w = 1.
        let mut expected = 0xcbf2_9ce4_8422_2325u64;
        for i in 0..13 {
            let word = if i == 6 { 0x3f80_0000u64 } else { 0 };
            expected = (expected ^ word).wrapping_mul(1_099_511_628_211);
        }
        let mut hash = StateHash::new();
        hash.tick(&Pose::IDENTITY, None, &Wrench::ZERO);
        assert_eq!(hash.value(), expected);
    }

    #[test]
    fn one_bit_anywhere_changes_the_hash() {
        let hash = |handle: Pose, object: Option<(Pose, Twist)>, wrench: Wrench| {
            let mut h = StateHash::new();
            h.tick(&handle, object.as_ref(), &wrench);
            h.value()
        };
        let object = Some((Pose::IDENTITY, Twist::ZERO));
        let base = hash(Pose::IDENTITY, object, Wrench::ZERO);
        assert_ne!(base, hash(Pose::IDENTITY, None, Wrench::ZERO));
        let mut handle = Pose::IDENTITY;
        handle.position.z = f32::from_bits(1);
        assert_ne!(base, hash(handle, object, Wrench::ZERO));
        let mut moved = object;
        if let Some((_, twist)) = &mut moved {
            twist.angular.y = -0.0;
        }
        assert_ne!(base, hash(Pose::IDENTITY, moved, Wrench::ZERO));
        let mut wrench = Wrench::ZERO;
        wrench.torque.x = f32::from_bits(1);
        assert_ne!(base, hash(Pose::IDENTITY, object, wrench));
    }
}
