//! Probe: the nearest point found by branch and bound is the nearest of all, and the contacts are the overlapping points.

use std::sync::LazyLock;

use crate::support::hole_and_peg;
use crate::support::image::Image;
use mortise_haptics::{ContactSettings, Pose, ProbeError, Prober, Quat, Settings, Vec3};
use mortise_protocol::image::{Lookup, SceneImage};
use proptest::prelude::*;

const BLOCK: u16 = 0;
const PEG: u16 = 1;

fn settings() -> ContactSettings {
    Settings::default().contact
}

/// Every point of one part in the field of the other, in both directions: smallest distance stored, and number below zero.
fn brute_force(scene: &SceneImage<'_>, pose: Pose) -> (f32, usize) {
    let (peg, block) = (scene.shape_of_part(1), scene.shape_of_part(0));
    let (mut least, mut touching) = (f32::INFINITY, 0);
    let mut take = |lookup: Lookup| {
        if let Lookup::Near(sample) = lookup {
            least = least.min(sample.distance);
            touching += usize::from(sample.distance < 0.0);
        }
    };
    for point in peg.points {
        let p = pose.transform_point(Vec3::from_array(point.position));
        take(block.field.lookup(p.to_array()));
    }
    let back = pose.inverse();
    for point in block.points {
        let p = back.transform_point(Vec3::from_array(point.position));
        take(peg.field.lookup(p.to_array()));
    }
    (least, touching)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Where the field stores the distance (2 mm about the surface), the traversal finds the same point as an exhaustive search.
    #[test]
    fn as_brute_force(
        aside in prop::array::uniform2(-0.7e-3f32..0.7e-3),
        height in -5e-3f32..30e-3,
        tilt in prop::array::uniform3(-0.05f32..0.05),
    ) {
        static IMAGE: LazyLock<Image> = LazyLock::new(|| hole_and_peg(0.4e-3, 1e-3));
        let scene = IMAGE.open();
        let pose = Pose::new(
            Vec3::new(aside[0], aside[1], height),
            Quat::from_xyzw(tilt[0], tilt[1], tilt[2], 1.0).normalize(),
        );
        let mut prober = Prober::new();
        let found = prober.probe(&scene, PEG, BLOCK, &pose, &settings()).expect("two parts");
        let (least, touching) = brute_force(&scene, pose);
        // A point beside the field's grid has a bound only, and the probe reports it as one.
        prop_assume!(least.abs() < 1.2e-3 && found.nearest.in_band);
        // Poses are composed in another order: a few roundings of 40 mm, 3.7 nm each.
        let rounding = 5e-8;
        prop_assert!((found.nearest.field_distance_m - least).abs() < rounding, "{found:?} {least}");
        if least < -rounding {
            prop_assert!(found.contacts > 0);
            // The store holds 256; a point within rounding may count in one and not in the other.
            let kept = prober.contacts().count();
            prop_assert_eq!(kept, usize::from(found.contacts));
            prop_assert!(kept.abs_diff(touching.min(256)) <= 4, "{kept} {touching}");
        } else if least > rounding {
            prop_assert_eq!(found.contacts, 0);
            prop_assert_eq!(found.wrench.force, Vec3::ZERO);
        }
    }
}

#[test]
fn refusals() {
    let image = hole_and_peg(0.4e-3, 1e-3);
    let scene = image.open();
    let mut prober = Prober::new();
    let mut ask = |moving, fixed, pose| prober.probe(&scene, moving, fixed, &pose, &settings()).err();
    let here = Pose::IDENTITY;
    assert_eq!(ask(2, 0, here), Some(ProbeError::NoSuchPart { part: 2 }));
    assert_eq!(ask(1, 7, here), Some(ProbeError::NoSuchPart { part: 7 }));
    assert_eq!(ask(1, 1, here), Some(ProbeError::SamePart));
    let nowhere = Pose::new(Vec3::new(f32::NAN, 0.0, 0.0), Quat::IDENTITY);
    assert_eq!(ask(1, 0, nowhere), Some(ProbeError::BadPose));
    assert_eq!(ask(1, 0, here), None);
}
