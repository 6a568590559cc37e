//! What a scene demands of its shapes: the surfaces that can be reached, the fits between them, and each shape's requirements.

use glam::DAffine3;
use mortise_brep::CadModel;
use rayon::prelude::*;

use crate::choice::Demand;
use crate::distance::ExactSurface;
use crate::fits::{Fit, fits};
use crate::placed_fits::placed_fits;
use crate::scene::Scene;
use crate::voids::{others, without_hollows};

/// Most pairs of placed parts in which the fits of two shapes are looked for.
const MOST_PLACEMENTS: usize = 16;

/// The surface of a shape without hollows that nothing can reach, and the faces left out.
pub(crate) fn reached_surface(model: &CadModel, scene: &Scene, number: usize) -> (ExactSurface, Vec<u32>) {
    let shape = &model.shapes[scene.shapes[number]];
    let beside = || {
        let own = scene.parts.iter().filter(|part| part.1 == number);
        own.flat_map(|part| others(model, part.0)).collect()
    };
    match without_hollows(shape, beside) {
        Some((filled, left_out)) => (ExactSurface::new(&filled), left_out),
        None => (ExactSurface::new(shape), Vec::new()),
    }
}

/// Fits of all shapes that can meet.
pub(crate) fn all_fits(
    model: &CadModel,
    scene: &Scene,
    prepared: &[ExactSurface],
) -> Vec<((usize, usize), Vec<Fit>)> {
    let pairs: Vec<(usize, usize)> = (0..prepared.len())
        .flat_map(|a| scene.met_by(a).into_iter().map(move |b| (a, b)))
        .collect();
    let of = |&(a, b): &(usize, usize)| {
        let mut found = fits(&prepared[a], &prepared[b]);
        for to_b in placements(model, scene, a, b) {
            for fit in placed_fits(&prepared[a], &prepared[b], &to_b) {
                if !found.iter().any(|other| other.faces == fit.faces) {
                    found.push(fit);
                }
            }
        }
        (!found.is_empty()).then_some(((a, b), found))
    };
    pairs.par_iter().filter_map(of).collect()
}

/// Requirements of a shape.
pub(crate) fn demand(
    scene: &Scene,
    number: usize,
    surface: &ExactSurface,
    fits: &[((usize, usize), Vec<Fit>)],
    left_out: Vec<u32>,
) -> Demand {
    let own: Vec<(u32, f64, String)> = (fits.iter())
        .filter(|((a, _), _)| *a == number)
        .flat_map(|((_, b), found)| {
            let name = &scene.names[*b];
            found
                .iter()
                .map(move |fit| (fit.faces[0], fit.difference, name.clone()))
        })
        .collect();
    Demand::new(&scene.names[number], surface, &own, left_out)
}

/// Transforms from parts of shape `a` to parts of shape `b` as placed in the model.
fn placements(model: &CadModel, scene: &Scene, a: usize, b: usize) -> Vec<DAffine3> {
    let of = |shape: usize| scene.parts.iter().filter(move |part| part.1 == shape);
    (of(a).flat_map(|own| of(b).map(move |other| (own.0, other.0))))
        .filter(|(own, other)| own != other)
        .take(MOST_PLACEMENTS)
        .map(|(own, other)| model.parts[other].placement.inverse() * model.parts[own].placement)
        .collect()
}
