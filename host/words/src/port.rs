//! Extrusion ports of round profile: shafts and bores, with the interval that they occupy on their axis (Jung 2003, section 3).

use glam::{DAffine3, DVec3};
use mortise_brep::{Shape, Surface};
use mortise_mating::{Side, Tolerances, merge};

/// Smallest share of a full turn that a cylindrical patch must have, so that it holds a shaft on its axis: a little more than a half.
const ROUND: f64 = 0.55;
/// Largest angle between the axes of two connected ports, radians.
const PARALLEL: f64 = 2e-3;
/// Smallest common length of two connected ports, mm.
const COMMON_MM: f64 = 0.1;
/// Largest interference of two connected ports, mm on the radius: rounding of files.
const PRESSED_MM: f64 = 2e-3;

/// A shaft (male) or bore (female).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Port {
    /// Point on the axis.
    pub origin: DVec3,
    /// Unit vector of the axis.
    pub direction: DVec3,
    /// Radius, mm.
    pub radius: f64,
    /// Start of its interval on the axis, from `origin`, mm.
    pub low: f64,
    /// End of its interval.
    pub high: f64,
    /// Whether it is a shaft.
    pub male: bool,
}

impl Port {
    /// The same port placed by `placement`.
    pub fn placed(&self, placement: &DAffine3) -> Self {
        Self {
            origin: placement.transform_point3(self.origin),
            direction: placement.transform_vector3(self.direction),
            ..*self
        }
    }

    /// Length of its interval, mm.
    pub fn length(&self) -> f64 {
        self.high - self.low
    }

    /// Middle of its interval.
    pub fn middle(&self) -> DVec3 {
        self.origin + self.direction * ((self.low + self.high) / 2.0)
    }

    /// Whether radii of a shaft and a bore allow an insertion: the shaft is no larger, and smaller by at most 0.6 mm or an eighth of the bore.
    pub fn takes(&self, other: &Self) -> bool {
        let (shaft, bore) = if self.male { (self, other) } else { (other, self) };
        let gap = bore.radius - shaft.radius;
        shaft.male && !bore.male && gap >= -PRESSED_MM && gap <= f64::max(0.6, bore.radius / 8.0)
    }

    /// Common interval of two connected ports, on this one's axis from its origin: one in the other, coaxial within their gap.
    pub fn connected(&self, other: &Self) -> Option<(f64, f64)> {
        let gap = (self.radius - other.radius).abs();
        let aligned = self.direction.cross(other.direction).length() <= PARALLEL;
        if !self.takes(other) || !aligned {
            return None;
        }
        let offset = other.middle() - self.middle();
        if offset.reject_from_normalized(self.direction).length() > gap + 0.01 {
            return None;
        }
        let (low, high) = other.interval_on(self);
        let common = (self.low.max(low), self.high.min(high));
        (common.1 - common.0 > COMMON_MM).then_some(common)
    }

    /// Its interval on the axis of `of`, from the origin there.
    pub fn interval_on(&self, of: &Self) -> (f64, f64) {
        let at = |s: f64| (self.origin + self.direction * s - of.origin).dot(of.direction);
        let (a, b) = (at(self.low), at(self.high));
        (a.min(b), a.max(b))
    }
}

/// Ports of a shape, in its frame: cylindrical patches of more than half a turn. Cost: one merge of the shape's faces.
pub fn ports(shape: &Shape) -> Vec<Port> {
    let mut out = Vec::new();
    for merged in merge(shape, &Tolerances::default()) {
        let Surface::Cylinder { frame, radius } = merged.surface else {
            continue;
        };
        let patches = merged.patches.iter().max().map_or(0, |&last| last + 1);
        for patch in 0..patches {
            let of_patch = |face: u32| {
                merged
                    .faces
                    .iter()
                    .zip(&merged.patches)
                    .any(|(&f, &p)| f == face && p == patch)
            };
            let area: f64 = (0..shape.faces.len() as u32)
                .filter(|&face| of_patch(face))
                .map(|face| shape.faces[face as usize].area_mm2)
                .sum();
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for (triangle, &face) in shape.mesh.triangles.iter().zip(&shape.mesh.triangle_face) {
                if !of_patch(face) {
                    continue;
                }
                for &v in triangle {
                    let s = (shape.mesh.vertices[v as usize] - frame.origin).dot(frame.z);
                    low = low.min(s);
                    high = high.max(s);
                }
            }
            if area < ROUND * std::f64::consts::TAU * radius * (high - low) || !low.is_finite() {
                continue;
            }
            out.push(Port {
                origin: frame.origin,
                direction: frame.z,
                radius,
                low,
                high,
                male: merged.side == Side::Convex,
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(radius: f64, male: bool, low: f64, high: f64) -> Port {
        Port {
            origin: DVec3::ZERO,
            direction: DVec3::Z,
            radius,
            low,
            high,
            male,
        }
    }

    #[test]
    fn a_shaft_in_a_bore_is_connected_over_their_common_length() {
        let (shaft, bore) = (port(5.0, true, 0.0, 30.0), port(5.1, false, -10.0, 20.0));
        assert_eq!(shaft.connected(&bore), Some((0.0, 20.0)));
        assert_eq!(bore.connected(&shaft), Some((0.0, 20.0)));
        let aside = DAffine3::from_translation(DVec3::new(0.2, 0.0, 0.0));
        assert_eq!(shaft.placed(&aside).connected(&bore), None);
        let away = DAffine3::from_translation(DVec3::new(0.0, 0.0, 20.5));
        assert_eq!(shaft.placed(&away).connected(&bore), None);
        assert_eq!(port(6.0, true, 0.0, 30.0).connected(&bore), None);
    }

    #[test]
    fn the_sense_of_an_axis_does_not_matter() {
        let (shaft, bore) = (port(5.0, true, 0.0, 30.0), port(5.1, false, -10.0, 20.0));
        let turned = DAffine3::from_rotation_x(std::f64::consts::PI);
        let (low, high) = shaft.connected(&bore.placed(&turned)).unwrap();
        assert!(
            (low - 0.0).abs() < 1e-9 && (high - 10.0).abs() < 1e-9,
            "{low} {high}"
        );
    }
}
