//! The cone of translations that contacts leave: {v : n·v ≥ 0 for every contact normal n}.
//!
//! It is the sum of its lineality space (directions free both ways) and the cone of its extreme rays (free one way). In three dimensions an extreme ray
//! lies in as many independent planes n·v = 0 as the cone's dimension less one, so the rays are found by enumeration of pairs of normals: the double
//! description of Motzkin et al. (1953) without its incremental part. Cost: the cube of the number of distinct normals.

use glam::DVec3;

/// Angle below which two directions are the same, radians: ten times the default tolerance of a contact's directions would hide real tapers, a tenth of it
/// is rounding of exchange files.
const SAME_RAD: f64 = 1e-4;
/// A direction may point into a contact by this sine.
const INTO: f64 = 1e-6;
/// Most distinct normals: beyond, the ones nearest to others are left out, which a check of the motion replaces.
const MOST_NORMALS: usize = 160;

/// Directions that contact normals leave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cone {
    /// Orthonormal basis of the directions free both ways.
    pub lines: Vec<DVec3>,
    /// Unit extreme rays, perpendicular to `lines`: free one way.
    pub rays: Vec<DVec3>,
}

impl Cone {
    /// Whether no direction is free.
    pub fn is_point(&self) -> bool {
        self.lines.is_empty() && self.rays.is_empty()
    }
}

/// The cone left by `normals` (unit length, pointing towards the moving part).
pub fn cone(normals: &[DVec3]) -> Cone {
    let mut distinct: Vec<DVec3> = Vec::new();
    for &n in normals {
        if distinct.len() < MOST_NORMALS && distinct.iter().all(|m| m.cross(n).length() > SAME_RAD || m.dot(n) < 0.0) {
            distinct.push(n);
        }
    }
    let lines = lineality(&distinct);
    let holds = |v: DVec3| distinct.iter().all(|n| n.dot(v) >= -INTO);
    let mut rays: Vec<DVec3> = Vec::new();
    let mut keep = |v: DVec3| {
        let Some(v) = lines.iter().fold(v, |v, l| v - *l * l.dot(v)).try_normalize() else { return };
        if holds(v) && rays.iter().all(|r| r.dot(v) < 1.0 - SAME_RAD * SAME_RAD) {
            rays.push(v);
        }
    };
    match lines[..] {
        [] => {
            for (i, a) in distinct.iter().enumerate() {
                for b in &distinct[i + 1..] {
                    if let Some(v) = a.cross(*b).try_normalize() {
                        keep(v);
                        keep(-v);
                    }
                }
            }
        }
        [line] => {
            for n in &distinct {
                if let Some(v) = n.cross(line).try_normalize() {
                    keep(v);
                    keep(-v);
                }
            }
        }
        [_, _] => distinct.iter().for_each(|&n| keep(n)),
        _ => {}
    }
    Cone { lines, rays }
}

/// Orthonormal basis of the directions perpendicular to all of `normals`.
fn lineality(normals: &[DVec3]) -> Vec<DVec3> {
    let Some(&first) = normals.first() else {
        return vec![DVec3::X, DVec3::Y, DVec3::Z];
    };
    let across = |n: &DVec3| n.cross(first).length();
    let Some(second) = normals.iter().max_by(|a, b| across(a).total_cmp(&across(b))).filter(|n| across(n) > 10.0 * SAME_RAD) else {
        let x = first.any_orthonormal_vector();
        return vec![x, first.cross(x)];
    };
    let line = first.cross(*second).normalize();
    if normals.iter().all(|n| n.dot(line).abs() <= 10.0 * SAME_RAD) { vec![line] } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ring(from_deg: f64, span_deg: f64) -> Vec<DVec3> {
        (0..=36)
            .map(|i| {
                let a = (from_deg + span_deg * f64::from(i) / 36.0).to_radians();
                DVec3::new(a.cos(), a.sin(), 0.0)
            })
            .collect()
    }

    #[test]
    fn a_full_bore_leaves_its_axis_both_ways() {
        let c = cone(&ring(0.0, 360.0));
        assert_eq!((c.lines.len(), c.rays.len()), (1, 0));
        assert!(c.lines[0].z.abs() > 1.0 - 1e-12);
    }

    #[test]
    fn a_half_bore_is_left_one_way() {
        // Normals from 0° to 180°: only +y leaves, along with the axis.
        let c = cone(&ring(0.0, 180.0));
        assert_eq!((c.lines.len(), c.rays.len()), (1, 1), "{c:?}");
        assert!(c.rays[0].y > 1.0 - 1e-9);
    }

    #[test]
    fn a_third_of_a_bore_leaves_a_wedge() {
        // Normals from 30° to 150°: the wedge of half angle 30° about +y.
        let c = cone(&ring(30.0, 120.0));
        assert_eq!((c.lines.len(), c.rays.len()), (1, 2), "{c:?}");
        for r in &c.rays {
            assert!((r.y - 30f64.to_radians().cos()).abs() < 1e-9, "{r}");
        }
    }

    #[test]
    fn planes_leave_half_spaces_wedges_and_corners() {
        assert_eq!(cone(&[]).lines.len(), 3);
        let half = cone(&[DVec3::Z]);
        assert_eq!((half.lines.len(), half.rays.clone()), (2, vec![DVec3::Z]));
        assert_eq!(cone(&[DVec3::Z, DVec3::NEG_Z]).lines.len(), 2);
        assert!(cone(&[DVec3::Z, DVec3::NEG_Z]).rays.is_empty());
        assert_eq!(cone(&[DVec3::X, DVec3::Y, DVec3::Z]).rays.len(), 3);
        assert!(cone(&[DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(-1.0, -1.0, -1.0).normalize()]).is_point());
    }

    /// Whether `v` is a sum of lines and non-negative rays: by Carathéodory three rays are enough.
    fn spanned(c: &Cone, v: DVec3) -> bool {
        let v = c.lines.iter().fold(v, |v, l| v - *l * l.dot(v));
        let near = |w: DVec3| w.length() < 1e-6;
        if near(v) {
            return true;
        }
        let r = &c.rays;
        for i in 0..r.len() {
            if near(v - r[i] * r[i].dot(v).max(0.0)) {
                return true;
            }
            for j in 0..i {
                let n = r[i].cross(r[j]);
                if n.length() > 1e-9 && (v.dot(n.normalize())).abs() < 1e-6 {
                    let (a, b) = (v.cross(r[j]).dot(n) / n.length_squared(), r[i].cross(v).dot(n) / n.length_squared());
                    if a >= -1e-6 && b >= -1e-6 {
                        return true;
                    }
                }
                for k in 0..j {
                    let d = r[i].dot(r[j].cross(r[k]));
                    if d.abs() > 1e-9 {
                        let x = [v.dot(r[j].cross(r[k])) / d, r[i].dot(v.cross(r[k])) / d, r[i].dot(r[j].cross(v)) / d];
                        if x.iter().all(|&x| x >= -1e-6) {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }

    proptest! {
        /// Every direction that violates no contact is a sum of what was found, and what was found violates none.
        #[test]
        fn the_cone_is_the_set_of_free_directions(
            normals in prop::collection::vec(prop::array::uniform3(-3i32..=3), 1..7),
            v in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let normals: Vec<DVec3> = normals.iter()
                .filter_map(|n| DVec3::from_array(n.map(f64::from)).try_normalize())
                .collect();
            let c = cone(&normals);
            for n in &normals {
                for r in &c.rays { prop_assert!(n.dot(*r) >= -1e-5, "{n} {r}"); }
                for l in &c.lines { prop_assert!(n.dot(*l).abs() <= 2e-3, "{n} {l}"); }
            }
            let v = DVec3::from_array(v).normalize_or_zero();
            let free = normals.iter().all(|n| n.dot(v) >= 0.0);
            if free { prop_assert!(spanned(&c, v), "{v} of {c:?}"); }
        }
    }
}
