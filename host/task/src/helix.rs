//! Recognition of helical surfaces from their points: height grows evenly with the angle about an axis.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Least turn of a helical face, radians, and largest deviation of its middle line from even growth, as a share of the pitch.
const LEAST_TURN: f64 = PI;
const DEVIATION: f64 = 0.25;
/// Fewest points.
const FEWEST: usize = 24;
/// Smallest and largest pitch, as a share of the mean radius.
const PITCH: [f64; 2] = [0.02, 3.0];

/// Whether `points` of a face wind about the line through `origin` along the unit vector `axis`: some pitch p exists, the same for all points within
/// [`DEVIATION`], with z = p·φ/2π + constant. Heights are only known up to whole pitches, because an angle is only known up to whole turns: z/p − φ/2π
/// must be the same up to whole numbers. The pitch is the one with the largest resultant of these phases.
pub fn winds(points: &[DVec3], origin: DVec3, axis: DVec3) -> bool {
    if points.len() < FEWEST {
        return false;
    }
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let polar: Vec<(f64, f64, f64)> = points.iter().map(|&p| {
        let d = p - origin;
        (d.dot(y).atan2(d.dot(x)), d.dot(axis), d.dot(x).hypot(d.dot(y)))
    }).collect();
    let mean = polar.iter().map(|p| p.2).sum::<f64>() / polar.len() as f64;
    let (low, high) = polar.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let mut angles: Vec<f64> = polar.iter().map(|p| p.0).collect();
    angles.sort_by(f64::total_cmp);
    let gap = angles.windows(2).map(|w| w[1] - w[0]).fold(angles[0] + TAU - angles[angles.len() - 1], f64::max);
    if TAU - gap < LEAST_TURN || mean < 1e-6 {
        return false;
    }
    // Steps of an eighth of a turn over the face's height.
    let least = PITCH[0] * mean;
    let most = (PITCH[1] * mean).min(2.0 * (high - low));
    let steps = ((high - low) * 8.0 * (1.0 / least)).min(4000.0) as usize;
    let mut best = 0.0f64;
    for hand in [-1.0, 1.0] {
        for i in 1..=steps {
            let frequency = (1.0 / most) + (1.0 / least - 1.0 / most) * i as f64 / steps as f64;
            let (mut c, mut s) = (0.0, 0.0);
            for &(angle, z, _) in &polar {
                let phase = TAU * z * frequency - hand * angle;
                c += phase.cos();
                s += phase.sin();
            }
            best = best.max(c.hypot(s) / polar.len() as f64);
        }
    }
    // Phases spread evenly within ± DEVIATION·2π have the resultant sin(2π·DEVIATION)/(2π·DEVIATION).
    best > (TAU * DEVIATION).sin() / (TAU * DEVIATION)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coil(pitch: f64, width: f64, turns: f64) -> Vec<DVec3> {
        (0..400).map(|i| {
            let t = f64::from(i % 100) / 100.0 * turns * TAU;
            let across = f64::from(i / 100) / 3.0 * width;
            DVec3::new(5.0 * t.cos(), 5.0 * t.sin(), pitch * t / TAU + across)
        }).collect()
    }

    #[test]
    fn a_flank_winds_and_a_cylinder_does_not() {
        assert!(winds(&coil(1.5, 0.4, 3.0), DVec3::ZERO, DVec3::Z));
        let cylinder: Vec<DVec3> = (0..400).map(|i| {
            let t = f64::from(i % 20) / 20.0 * TAU;
            DVec3::new(5.0 * t.cos(), 5.0 * t.sin(), f64::from(i / 20) * 0.5)
        }).collect();
        assert!(!winds(&cylinder, DVec3::ZERO, DVec3::Z));
        let plane: Vec<DVec3> = (0..400).map(|i| DVec3::new(f64::from(i % 20) - 9.5, f64::from(i / 20) - 9.5, 0.0)).collect();
        assert!(!winds(&plane, DVec3::ZERO, DVec3::Z));
    }
}
