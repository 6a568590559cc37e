//! Warnings of parts that can need more than a tick's budget, so that contact is deeper than it would be with every point.
//!
//! A tick that cannot look at all points near takes every second, fourth or eighth of them, and the error bound of the pointshell grows by a factor of four
//! at each step.

use std::collections::HashSet;

use mortise_protocol::parameter::ParameterId;

use crate::distance::ExactSurface;
use crate::fits::{Fit, fits};
use crate::made::{EPSILON_PER_CELL, Made};
use crate::options::{BakeOptions, Method, PointshellKind};
use crate::plan::PartTick;
use crate::scene::Scene;
use crate::ticks::Ticks;

/// Depth that left-out points may cost without a warning, mm: that of 10 N on one point.
const DEEP_MM: f64 = 0.05;

/// Fits of round faces between shapes that can meet: they follow from the shapes, in no time.
pub(crate) fn round_fits(scene: &Scene, prepared: &[ExactSurface]) -> Vec<((usize, usize), Vec<Fit>)> {
    let pairs = (0..prepared.len()).flat_map(|a| scene.met_by(a).into_iter().map(move |b| (a, b)));
    pairs
        .map(|(a, b)| ((a, b), fits(&prepared[a], &prepared[b])))
        .filter(|(_, found)| !found.is_empty())
        .collect()
}

/// One warning for each shape whose parts may be grabbed and can need more than the default budget, at a depth that matters. `ticks` are those of `counted`.
pub(crate) fn overloads(
    counted: &Ticks<'_>,
    ticks: &[PartTick],
    each: &[BakeOptions],
    made: &Made,
) -> Vec<String> {
    let judged =
        |o: &BakeOptions| o.method == Method::DistanceField && o.shell == PointshellKind::ErrorBounded;
    if !each.iter().all(judged) {
        return Vec::new();
    }
    let scene = counted.scene;
    let budget = f64::from(ParameterId::PointBudget.row().default);
    let cell = |shape: usize| f64::from(made.fields[shape].record.cell) * 1000.0;
    let epsilon = |shape: usize| each[shape].epsilon_mm.unwrap_or(cell(shape) / EPSILON_PER_CELL);
    let mut warned = HashSet::new();
    let warning = |tick: &PartTick| {
        let times = tick.cost.lookups as f64 / budget;
        let is_own = |part: &&(usize, usize)| counted.model.parts[part.0].name == tick.name;
        let &(_, own) = scene.parts.iter().find(is_own).filter(|_| times > 1.0)?;
        if !warned.insert(own) {
            return None;
        }
        let shapes = scene.met_by(own).into_iter().chain([own]);
        let bound = shapes.map(epsilon).fold(0.0, f64::max);
        if bound * 4f64.powf(times.log2().ceil()) <= DEEP_MM {
            return None;
        }
        let place = crowded(counted.fits, own, made).map_or_else(String::new, |[x, y, z]| {
            format!(", most of them on one of its faces, at {x:.2} {y:.2} {z:.2} mm")
        });
        let equal = scene.parts.iter().filter(|&&(_, shape)| shape == own).count();
        let others = match equal {
            1 => String::new(),
            equal => format!(" and {} of the same shape", equal - 1),
        };
        Some(format!(
            "part \"{}\"{others}: {} points are near where it sits in what it fits or lies flat{place}; a tick needs {} field queries for them, more than its \
             budget of {budget}, and leaves points out, so that contact there may be deeper by over {:.0} µm; a coarser accuracy, or larger cells, \
             has fewer points",
            tick.name,
            tick.cost.points,
            tick.cost.lookups,
            1000.0 * DEEP_MM,
        ))
    };
    ticks.iter().filter_map(warning).collect()
}

/// A point of the face that fits and has most points, of this shape, mm; `None` where no face fits.
fn crowded(fits: &[((usize, usize), Vec<Fit>)], own: usize, made: &Made) -> Option<[f64; 3]> {
    let faces = (fits.iter())
        .filter(|((a, _), _)| *a == own)
        .flat_map(|(_, found)| found.iter().map(|fit| fit.faces[0]));
    let on = |face: u32| {
        let points = made.shells[own].points.iter();
        points.filter(move |point| u32::from(point.face) == face)
    };
    let most = faces.max_by_key(|&face| on(face).count())?;
    let middle = on(most).nth(on(most).count() / 2)?;
    Some(middle.position.to_array())
}
