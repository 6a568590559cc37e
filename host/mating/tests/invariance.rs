//! Invariance of contacts under motion of the assembly, order of its parts, and splitting of faces. Common areas are
//! compared with closed forms. Files are read in-process; they are this project's test parts.

use crate::build;
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::OnceLock;

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, load_step};
use mortise_mating::{Contact, ContactKind, Tolerances, identify};
use proptest::prelude::*;

/// A file with its contacts: kind, count, and area (of a ball in a bore: length) in closed form.
type Sample = (CadModel, Vec<(ContactKind, usize, f64)>);

fn samples() -> &'static [Sample] {
    static SAMPLES: OnceLock<Vec<Sample>> = OnceLock::new();
    SAMPLES.get_or_init(|| {
        let load = |name: &str| {
            load_step(
                Path::new(env!("CARGO_MANIFEST_DIR"))
                    .join("tests/data")
                    .join(name),
            )
            .unwrap()
        };
        // Slant height of the taper from radius 7 at z = 0 to 10 at z = 30.
        let slant = 3f64.hypot(30.0);
        vec![
            // A link 40 × 16 with two pins of 6, 12 long.
            (
                load("two_pin_exact.step"),
                vec![
                    (ContactKind::Planar, 1, 40.0 * 16.0 - 18.0 * PI),
                    (ContactKind::Cylindrical, 1, PI * 6.0 * 12.0),
                    (ContactKind::Cylindrical, 1, PI * 6.0 * 12.0),
                ],
            ),
            (
                load("cone_in_cone.step"),
                vec![(ContactKind::Conical, 1, PI * 17.0 * slant)],
            ),
            (
                load("ball_in_socket.step"),
                vec![(ContactKind::Spherical, 1, TAU * 100.0)],
            ),
            (
                load("ball_in_cylinder.step"),
                vec![(ContactKind::Annular, 1, TAU * 10.0)],
            ),
        ]
    })
}

fn size(c: &Contact) -> f64 {
    c.area_mm2 + c.length_mm
}

fn sorted(model: &CadModel) -> Vec<Contact> {
    let mut contacts = identify(model, &Tolerances::default());
    contacts.sort_by(|a, b| {
        a.kind
            .cmp(&b.kind)
            .then(a.axis.origin.x.total_cmp(&b.axis.origin.x))
    });
    contacts
}

#[test]
fn areas_are_those_of_arithmetic() {
    for (model, want) in samples() {
        let contacts = sorted(model);
        assert_eq!(contacts.len(), want.len(), "{contacts:?}");
        for (c, (kind, count, area)) in contacts.iter().zip(want) {
            assert_eq!((c.kind, c.count, c.fit_mm), (*kind, *count, 0.0));
            assert!(
                (size(c) / area - 1.0).abs() < 1e-3,
                "{kind:?}: {} {area}",
                size(c)
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn moving_the_assembly_and_swapping_parts_changes_nothing(
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in -3.0f64..3.0,
        by in prop::array::uniform3(-300.0f64..300.0),
        swap in any::<bool>(),
    ) {
        let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
        let motion = DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis, angle), by.into());
        for (model, _) in samples() {
            let mut other = model.clone();
            if swap {
                other.parts.reverse();
            }
            for part in &mut other.parts {
                part.placement = motion * part.placement;
            }
            let mut still = identify(model, &Tolerances::default());
            for c in identify(&other, &Tolerances::default()) {
                // The contact with the same axis, transformed from the moved assembly.
                let same = still.iter().position(|s| {
                    let at = motion.transform_point3(s.axis.origin);
                    let along = motion.transform_vector3(s.axis.direction);
                    s.kind == c.kind && s.count == c.count
                        // The error of a middle is bounded like that of the areas.
                        && at.distance(c.axis.origin) < 1e-3
                        && (s.kind == ContactKind::Spherical || along.cross(c.axis.direction).length() < 1e-9)
                        && (size(s) / size(&c) - 1.0).abs() < 1e-3
                        && s.radius_mm.is_some() == c.radius_mm.is_some()
                        && s.radius_mm.zip(c.radius_mm).is_none_or(|(r, q)| (r - q).abs() < 1e-4)
                });
                prop_assert!(same.is_some(), "{c:?} is not among {still:?}");
                still.swap_remove(same.unwrap_or_default());
            }
            prop_assert!(still.is_empty(), "{still:?} went away");
        }
    }

    /// The walls of shaft and bore form one contact of the same area, regardless of how they are cut into faces.
    #[test]
    fn a_split_cylinder_is_the_whole_one(
        sectors in (1u32..5, 1u32..5),
        rows in (1u32..4, 1u32..4),
        turn in -3.0f64..3.0,
        shift in -8.0f64..8.0,
    ) {
        let shaft = build::wall(5.0, 10.0, sectors.0, rows.0, false);
        let bore = build::wall(5.0, 10.0, sectors.1, rows.1, true);
        let place = DAffine3::from_rotation_translation(DQuat::from_rotation_z(turn), DVec3::Z * shift);
        let contacts = identify(&build::model([shaft, bore], place), &Tolerances::default());
        prop_assert_eq!(contacts.len(), 1, "{:?}", contacts);
        let c = &contacts[0];
        prop_assert_eq!((c.kind, c.count), (ContactKind::Cylindrical, 1));
        // The unrolled tiles are exact.
        let area = TAU * 5.0 * (10.0 - shift.abs());
        prop_assert!((c.area_mm2 / area - 1.0).abs() < 1e-9, "{} {area}", c.area_mm2);
        let middle = shift / 2.0 + 5.0;
        prop_assert!(c.axis.origin.distance(DVec3::Z * middle) < 1e-6, "{} {middle}", c.axis.origin);
    }

    /// A disc over a hole touches its rim if and only if it is larger, by however little, and for any tessellation of both.
    #[test]
    fn a_disc_on_a_hole_shares_the_ring_between_them(
        radius in 2.0f64..60.0,
        more in prop_oneof![-0.5f64..-1e-5, 1e-3f64..0.5],
        turn in -3.0f64..3.0,
        steps in (24u32..64, 24u32..64),
    ) {
        let plate = build::ring(radius, radius + 5.0, steps.0, true);
        let disc = build::ring(0.0, radius + more, steps.1, false);
        let place = DAffine3::from_rotation_z(turn);
        let contacts = identify(&build::model([plate, disc], place), &Tolerances::default());
        if more < 0.0 {
            prop_assert!(contacts.is_empty(), "{contacts:?}");
            return Ok(());
        }
        let area = PI * more * (2.0 * radius + more);
        prop_assert_eq!(contacts.len(), 1);
        // A thousandth, or arcs followed to 2 µm · 10⁻³ on both sides.
        let bound = 1e-3 * area + 2.0 * 2e-6 * TAU * (radius + more);
        prop_assert!((contacts[0].area_mm2 - area).abs() < bound, "{} {area}", contacts[0].area_mm2);
    }

    /// Surfaces whose radii or planes differ by more than the tolerance do not touch, by less they do; sides with the same
    /// orientation never touch.
    #[test]
    fn the_tolerance_decides(apart in prop_oneof![-0.9e-3f64..0.9e-3, 1.1e-3f64..1e-2, -1e-2f64..-1.1e-3]) {
        let near = apart.abs() < 1e-3;
        let wall = |radius, bore| build::wall(radius, 10.0, 2, 1, bore);
        let found = |shapes, place| identify(&build::model(shapes, place), &Tolerances::default()).len();
        prop_assert_eq!(found([wall(5.0, false), wall(5.0 + apart, true)], DAffine3::IDENTITY), usize::from(near));
        let aside = DAffine3::from_translation(DVec3::X * apart);
        prop_assert_eq!(found([wall(5.0, true), wall(5.0, false)], aside), usize::from(near));
        prop_assert_eq!(found([wall(5.0, true), wall(5.0, true)], DAffine3::IDENTITY), 0);
        let lift = DAffine3::from_translation(DVec3::Z * apart);
        let ring = |up| build::ring(2.0, 6.0, 32, up);
        prop_assert_eq!(found([ring(true), ring(false)], lift), usize::from(near));
        prop_assert_eq!(found([ring(true), ring(true)], DAffine3::IDENTITY), 0);
    }
}
