//! Threads: which parts have one, and where it holds.
//!
//! Exchange files leave most threads out (cosmetic ones). A part has one by the catalogue, by its name, or by helical surfaces. Of the bores that a screw passes one
//! holds it: that of a nut, else a blind one, else of those narrowest for the shaft the one farthest from the head; the others only guide it.

use glam::{DAffine3, DVec3};
use mortise_brep::Surface;

use crate::assembly::Assembly;
use crate::fits::Fit;

/// Words in the name of a part that has a thread which the model leaves out.
const THREADED: [&str; 8] = [
    "screw", "bolt", "nut", "stud", "schraube", "mutter", "threaded", "gewinde",
];
/// Clearances that differ by less are the same, mm.
const SAME_MM: f64 = 0.02;

/// Whether a part has a thread by the catalogue, or else by its name.
pub(crate) fn is_threaded(assembly: &Assembly, part: usize) -> bool {
    let stated = assembly.stated.thread(part);
    stated.unwrap_or_else(|| is_named_threaded(assembly.name(part)))
}

/// Whether a part's name says that it has a thread.
fn is_named_threaded(name: &str) -> bool {
    let lower = name.to_lowercase();
    lower
        .split(|c: char| !c.is_alphabetic())
        .any(|word| THREADED.iter().any(|t| word.trim_end_matches('s') == *t))
}

/// Whether a part has free-form faces that coil about one of its cylinders' axes: a modelled thread.
pub(crate) fn helical(assembly: &Assembly, part: usize) -> bool {
    let shape = assembly.body(part).surface().shape();
    let mesh = &shape.mesh;
    shape
        .faces
        .iter()
        .enumerate()
        .filter(|(_, f)| f.surface == Surface::Spline)
        .any(|(id, _)| {
            let points: Vec<DVec3> = (mesh.triangles.iter().zip(&mesh.triangle_face))
                .filter(|(_, face)| **face as usize == id)
                .flat_map(|(t, _)| t.map(|v| mesh.vertices[v as usize]))
                .collect();
            assembly.surfaces(part).iter().any(|m| match m.surface {
                Surface::Cylinder { frame, .. } => crate::helix::winds(&points, frame.origin, frame.z),
                _ => false,
            })
        })
}

/// Of each fit whether a thread holds in it.
pub(crate) fn holds(assembly: &Assembly, fits: &[Fit]) -> Vec<bool> {
    let threaded: Vec<bool> = (0..assembly.count())
        .map(|part| is_threaded(assembly, part))
        .collect();
    let has_fit = |part: usize| fits.iter().any(|fit| fit.parts.contains(&part));
    let modelled: Vec<bool> = (0..assembly.count())
        .map(|part| has_fit(part) && helical(assembly, part))
        .collect();
    let is_modelled = |fit: &Fit| fit.parts.iter().all(|&part| modelled[part]);
    let mut held: Vec<bool> = (fits.iter())
        .map(|fit| fit.is_round && (threaded[fit.parts[1]] || is_modelled(fit)))
        .collect();
    for (screw, _) in threaded.iter().enumerate().filter(|(_, is)| **is) {
        let own = |i: &usize| fits[*i].is_round && fits[*i].parts[0] == screw;
        let own: Vec<usize> = (0..fits.len()).filter(own).collect();
        if own.iter().any(|&i| held[i]) {
            continue;
        }
        if let Some(last) = last(assembly, screw, fits, &own) {
            held[last] = true;
        }
    }
    held
}

/// The fit in which a screw without a nut holds.
fn last(assembly: &Assembly, screw: usize, fits: &[Fit], own: &[usize]) -> Option<usize> {
    let is_blind = |i: &&usize| !fits[**i].is_through;
    let blind: Vec<usize> = own.iter().filter(is_blind).copied().collect();
    let of = if blind.is_empty() { own } else { &blind };
    let narrowest = (of.iter())
        .map(|&i| fits[i].clearance_mm)
        .fold(f64::INFINITY, f64::min);
    // A head makes its end the heavier one.
    let shape = assembly.body(screw).surface().shape();
    let heavy = assembly.placement(screw).transform_point3(shape.center_of_mass);
    let (low, high) = assembly.bounds(screw, DAffine3::IDENTITY);
    let from_head = (low + high) / 2.0 - heavy;
    let along = |&i: &usize| (fits[i].center - heavy).dot(from_head);
    (of.iter().copied())
        .filter(|&i| fits[i].clearance_mm <= narrowest + SAME_MM)
        .max_by(|a, b| along(a).total_cmp(&along(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_threaded_parts() {
        for name in ["screw_1", "M6 Bolt", "flange/nuts", "Schraube 3"] {
            assert!(is_named_threaded(name), "{name}");
        }
        for name in ["minute", "nutshell", "rod", "bolted plate", "donut"] {
            assert!(!is_named_threaded(name), "{name}");
        }
    }
}
