//! One thousand ticks give the same bits on every machine and at every level of optimisation.

use crate::support;
use mortise_haptics::{Input, Output, Pose, Quat, Settings, State, Twist, Vec3, tick};

/// FNV-1a over the bits of everything a tick returns.
struct Hash(u64);

impl Hash {
    fn word(&mut self, bits: u32) {
        for byte in bits.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    fn vector(&mut self, v: Vec3) {
        v.to_array().iter().for_each(|x| self.word(x.to_bits()));
    }

    fn output(&mut self, out: &Output) {
        for v in [
            out.handle.force,
            out.handle.torque,
            out.contact.force,
            out.contact.torque,
            out.object.position,
            out.object_twist.linear,
            out.object_twist.angular,
        ] {
            self.vector(v);
        }
        out.object
            .orientation
            .to_array()
            .iter()
            .for_each(|x| self.word(x.to_bits()));
        for p in &out.pairs {
            self.word(u32::from(p.count));
            self.word(p.depth_m.to_bits());
        }
        self.word(u32::from(out.work.flags.bits()));
    }
}

/// The contract: a change of this number is a change of the force law's results, and belongs in the changelog.
const GOLDEN: u64 = 0x5860_0056_1a45_ed10;

#[test]
fn a_thousand_ticks_hash_to_the_golden_value() {
    let image = support::hole_and_peg(0.1e-3, 1e-3);
    let scene = image.open();
    let mut state = State::new();
    state.load_scene(&scene);
    state.grab(&scene, 1, &Pose::IDENTITY).unwrap();
    let settings = Settings::default();
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    let mut touched = 0;
    // Down into the hole, off the axis and tilting, with a circling handle: exact arithmetic only, no library sines.
    let (mut x, mut y) = (0.4e-3f32, 0.0f32);
    for t in 0..1000u32 {
        (x, y) = (x - 0.03 * y, y + 0.03 * (x - 0.03 * y));
        let z = -1.5e-5 * t as f32;
        let tilt = 1e-5 * t as f32;
        let out = tick(
            &mut state,
            &scene,
            &settings,
            &Input {
                handle: Pose::new(Vec3::new(x, y, z), Quat::from_xyzw(tilt, 0.0, 0.0, 1.0)),
                handle_twist: Twist {
                    linear: Vec3::new(-30.0 * y, 30.0 * x, -0.015),
                    angular: Vec3::new(0.02, 0.0, 0.0),
                },
                enabled: true,
            },
        );
        touched += u32::from(out.work.contacts > 0);
        hash.output(&out);
    }
    assert!(touched > 500, "{touched}");
    assert_eq!(hash.0, GOLDEN, "{:#018x}", hash.0);
}
