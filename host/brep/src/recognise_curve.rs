//! Recognition of lines and circles in spline curves.
//!
//! A line runs through the ends of its samples. A circle lies in the plane perpendicular to the direction in which its samples extend least, about
//! the centre of the linear least squares 2 c·p + k = p² (Kåsa 1976), which is exact for an exact circle. The largest distance of a sample decides.

use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::{Curve, Frame};

/// The line or circle within `within` mm of all samples; `None` when there is none.
pub fn curve(samples: &[DVec3], within: f64) -> Option<Curve> {
    if samples.len() < 5 || within.is_nan() || within <= 0.0 {
        return None;
    }
    line(samples, within).or_else(|| circle(samples, within))
}

fn line(samples: &[DVec3], within: f64) -> Option<Curve> {
    let origin = *samples.first()?;
    let direction = (*samples.last()? - origin).try_normalize()?;
    let near = samples
        .iter()
        .all(|&p| (p - origin).reject_from_normalized(direction).length() <= within);
    // A curve that reverses its direction is not a line, however near.
    let onward = samples.windows(2).all(|w| (w[1] - w[0]).dot(direction) > 0.0);
    (near && onward).then_some(Curve::Line { origin, direction })
}

fn circle(samples: &[DVec3], within: f64) -> Option<Curve> {
    let count = samples.len() as f64;
    let mean = samples.iter().sum::<DVec3>() / count;
    let size = samples.iter().map(|p| p.distance(mean)).fold(0.0, f64::max);
    let local: Vec<DVec3> = samples.iter().map(|&p| p - mean).collect();
    let spread = local.iter().fold(Matrix3::zeros(), |sum, v| {
        let v = Vector3::new(v.x, v.y, v.z);
        sum + v * v.transpose()
    });
    let eigen = SymmetricEigen::new(spread);
    let (smallest, _) = eigen.eigenvalues.argmin();
    let column = eigen.eigenvectors.column(smallest);
    let z = DVec3::new(column[0], column[1], column[2]).try_normalize()?;
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    let (mut m, mut b) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    for p in &local {
        let row = Vector3::new(2.0 * p.dot(x), 2.0 * p.dot(y), size);
        m += row * row.transpose();
        b += row * p.length_squared();
    }
    let found = m.lu().solve(&b)?;
    let origin = mean + x * found[0] + y * found[1];
    let radius = samples.iter().map(|p| p.distance(origin)).sum::<f64>() / count;
    let off = |p: &DVec3| {
        let d = *p - origin;
        (d.reject_from_normalized(z).length() - radius).hypot(d.dot(z))
    };
    let sound = radius.is_finite() && radius < 1e3 * size && samples.iter().all(|p| off(p) <= within);
    sound.then_some(Curve::Circle {
        frame: Frame { origin, x, y, z },
        radius,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Points of an arc yield its circle; the same arc bent out of its plane or out of round does not.
        #[test]
        fn an_arc_is_a_circle_and_a_bent_one_is_not(
            axis in prop::array::uniform3(-1.0f64..1.0),
            center in prop::array::uniform3(-50.0f64..50.0),
            radius in 0.5f64..80.0,
            turn in 0.3f64..std::f64::consts::TAU,
        ) {
            let z = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
            let (x, c) = (z.any_orthonormal_vector(), DVec3::from(center));
            let y = z.cross(x);
            let arc = |bend: f64| -> Vec<DVec3> {
                (0..32).map(|i| {
                    let t = turn * f64::from(i) / 31.0;
                    c + (x * t.cos() + y * t.sin()) * radius + z * (bend * (3.0 * t).sin())
                }).collect()
            };
            let Some(Curve::Circle { frame, radius: found }) = curve(&arc(0.0), 1e-6) else {
                return Err(TestCaseError::fail("no circle"));
            };
            // Rounding of coordinates near 100 mm, magnified by the shortness of the arc: (2/0.3)⁴.
            prop_assert!((found - radius).abs() < 1e-7 && frame.origin.distance(c) < 1e-7);
            prop_assert!(frame.z.cross(z).length() < 1e-7);
            prop_assert!(curve(&arc(1e-2), 1e-6).is_none());
        }
    }

    #[test]
    fn a_straight_curve_is_a_line_and_one_that_turns_back_is_not() {
        let at = |t: f64| DVec3::new(1.0, 2.0, 3.0) + DVec3::new(1.0, -1.0, 0.5) * t;
        let line: Vec<DVec3> = (0..9).map(|i| at(f64::from(i).powi(2))).collect();
        assert!(matches!(curve(&line, 1e-6), Some(Curve::Line { .. })));
        let back: Vec<DVec3> = [0.0, 2.0, 1.0, 3.0, 4.0, 5.0].map(at).to_vec();
        assert_eq!(curve(&back, 1e-6), None);
    }
}
