//! Regions of planes: area, middle and common area against closed forms.

use crate::build;
use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use mortise_mating::{PlaneRegion, Tolerances, merge, plane_regions};
use proptest::prelude::*;

fn ring(inner: f64, outer: f64, up: bool) -> PlaneRegion {
    let shape = build::ring(inner, outer, 24, up);
    let mut regions = plane_regions(&shape, &merge(&shape, &Tolerances::default()));
    assert_eq!(regions.len(), 1);
    regions.remove(0)
}

/// Area common to two discs whose centres are `d` apart.
fn lens(r: f64, s: f64, d: f64) -> f64 {
    if d >= r + s {
        return 0.0;
    }
    if d <= (r - s).abs() {
        return PI * r.min(s).powi(2);
    }
    let part = |r: f64, s: f64| {
        let x = (d * d + r * r - s * s) / (2.0 * d);
        r * r * (x / r).acos() - x * (r * r - x * x).sqrt()
    };
    part(r, s) + part(s, r)
}

proptest! {
    /// A ring's area, middle, normal and reach are those of its circles.
    #[test]
    fn a_ring_has_the_area_of_its_circles(inner in 1.0..5.0f64, width in 0.5..10.0f64, up: bool) {
        let outer = inner + width;
        let region = ring(inner, outer, up);
        let area = PI * (outer * outer - inner * inner);
        prop_assert!((region.area_mm2 - area).abs() < 1e-5 * area, "{} {area}", region.area_mm2);
        prop_assert!(region.middle.length() < 1e-9, "{}", region.middle);
        let normal = if up { DVec3::Z } else { -DVec3::Z };
        prop_assert!(region.normal.distance(normal) < 1e-12);
        prop_assert!((region.reach_mm - outer).abs() < 1e-9);
        prop_assert_eq!(region.edge, None);
    }

    /// Two rings on each other: the discs' common areas, added and subtracted.
    #[test]
    fn rings_share_what_their_discs_share(
        inner in prop::array::uniform2(0.5..4.0f64), width in prop::array::uniform2(0.5..8.0f64),
        shift in prop::array::uniform2(-8.0..8.0f64), angle in 0.0..std::f64::consts::TAU
    ) {
        let outer = [inner[0] + width[0], inner[1] + width[1]];
        let (below, above) = (ring(inner[0], outer[0], true), ring(inner[1], outer[1], false));
        let shift = DVec2::from(shift);
        let place = DAffine3::from_rotation_translation(DQuat::from_rotation_z(angle), shift.extend(0.0));
        let d = shift.length();
        let wanted = lens(outer[0], outer[1], d) - lens(inner[0], outer[1], d) - lens(outer[0], inner[1], d)
            + lens(inner[0], inner[1], d);
        let common = below.common_mm2(&above, &place);
        // Arcs of 15° are followed to 1/256 of what their chords leave out, which is 1.2 % of a disc.
        let slack = 1e-4 * PI * (outer[0] * outer[0] + outer[1] * outer[1]);
        prop_assert!((common - wanted).abs() < slack, "{common} {wanted}");
    }
}
