//! A ball in a bore of the same diameter: they touch along a circle.

use std::f64::consts::TAU;

use mortise_brep::Frame;

use crate::overlap::{Chart, Drawing};
use crate::sphere::SphereDrawing;

/// Number of sampled directions: the length is accurate to one part in 360.
const STEPS: u32 = 360;

/// Length of the circle around the bore's axis at `height` that lies in both faces, mm.
pub(crate) fn length(
    chart: &Chart,
    bore: &Drawing,
    ball: &SphereDrawing,
    frame: &Frame,
    radius: f64,
    height: f64,
) -> f64 {
    let touching = (0..STEPS)
        .filter(|&i| {
            // Offset from the multiples of a degree, where modellers put seams.
            let angle = TAU * (f64::from(i) + 0.381_966) / f64::from(STEPS) - TAU / 2.0;
            let direction = frame.x * angle.cos() + frame.y * angle.sin();
            chart.holds(bore, angle, height) && ball.holds(direction)
        })
        .count();
    TAU * radius * touching as f64 / f64::from(STEPS)
}
