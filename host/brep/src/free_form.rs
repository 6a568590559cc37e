//! Free-form faces and edges from the kernel's numbers, if these are consistent with their shape.

use crate::kernel::{RawCurve, RawFreeForms, RawSpline};
use crate::{Curve, FineCurve, Shape, SplineSurface, Surface};
use glam::DVec3;

/// Adds to `shape` the splines under its [`Surface::Spline`] faces and the finer points of its [`Curve::Other`] edges.
pub fn add(shape: &mut Shape, raw: RawFreeForms) {
    let is_spline = |face: u32| {
        shape
            .faces
            .get(face as usize)
            .is_some_and(|f| f.surface == Surface::Spline)
    };
    let splines = raw.splines.into_iter().filter(|s| is_spline(s.face));
    shape.splines = splines.filter_map(spline).collect();
    let curves = raw.curves.into_iter().filter_map(curve);
    shape.curves = curves
        .filter(|c| {
            let edge = shape.edges.get(c.edge as usize);
            edge.is_some_and(|e| e.curve == Curve::Other && e.polyline.len() == c.between.len() + 1)
        })
        .collect();
}

/// `None` when the counts are inconsistent or the numbers do not define a surface.
fn spline(raw: RawSpline) -> Option<SplineSurface> {
    let knots = [raw.knots_u, raw.knots_v];
    let degrees = raw.degrees;
    let poles = raw.poles.as_chunks::<4>().0.to_vec();
    let mut count = 1;
    for (knots, degree) in knots.iter().zip(degrees) {
        let degree = degree as usize;
        let n = knots.len().checked_sub(degree + 1).filter(|&n| n > degree)?;
        let rising = knots.windows(2).all(|w| w[0] <= w[1]) && knots[degree] < knots[n];
        if degree == 0 || !rising || !knots.iter().all(|k| k.is_finite()) {
            return None;
        }
        count *= n;
    }
    let sound = poles.iter().flatten().all(|c| c.is_finite()) && poles.iter().all(|p| p[3] > 0.0);
    (sound && count == poles.len()).then_some(SplineSurface {
        face: raw.face,
        degrees,
        knots,
        poles,
        deviation_mm: raw.deviation,
    })
}

fn curve(raw: RawCurve) -> Option<FineCurve> {
    let mut points = raw.points.as_chunks::<3>().0.iter().map(|&p| DVec3::from(p));
    let between: Vec<Vec<DVec3>> = raw
        .counts
        .iter()
        .map(|&n| points.by_ref().take(n as usize).collect())
        .collect();
    let sound = !between.is_empty() && between.iter().flatten().all(|p| p.is_finite());
    sound.then_some(FineCurve {
        edge: raw.edge,
        between,
    })
}
