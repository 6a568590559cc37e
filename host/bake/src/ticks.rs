//! Worst-case ticks of a planned scene: points near when a part sits in everything it fits into.

use std::collections::BTreeMap;

use glam::DVec3;
use mortise_brep::{CadModel, Surface};

use crate::cost::TickCost;
use crate::distance::ExactSurface;
use crate::fits::Fit;
use crate::made::Made;
use crate::plan::PartTick;
use crate::scene::Scene;
use crate::shell::Pointshell;

/// Inputs of the estimate.
pub(crate) struct Ticks<'a> {
    pub model: &'a CadModel,
    pub scene: &'a Scene,
    /// Surface of each shape.
    pub surfaces: Vec<&'a ExactSurface>,
    /// Fits of shapes that can meet.
    pub fits: &'a [((usize, usize), Vec<Fit>)],
}

impl Ticks<'_> {
    /// Worst-case tick of each part that may be grabbed, the costliest first: it sits in everything it fits into, or lies flat, whichever has more
    /// points near.
    pub fn of(&self, made: &Made) -> Vec<PartTick> {
        let scene = self.scene;
        let counts: Vec<FacePoints> = (made.shells.iter().zip(&self.surfaces))
            .map(|(shell, surface)| FacePoints::of(shell, surface))
            .collect();
        let flats: Vec<usize> = (0..counts.len()).map(|i| self.flats(&counts, i)).collect();
        // Parts of one shape meet the same shapes.
        let mut of_shape: Vec<Option<TickCost>> = vec![None; counts.len()];
        let mut ticks: Vec<PartTick> = (0..scene.parts.len())
            .filter(|&i| scene.grabbable[i])
            .map(|i| {
                let (part, own) = scene.parts[i];
                let cost = *of_shape[own].get_or_insert_with(|| {
                    let met: Vec<usize> = (0..scene.parts.len())
                        .filter(|&j| j != i)
                        .map(|j| scene.parts[j].1)
                        .collect();
                    // On a larger flat at most as much of its border is near as of the smaller one's.
                    let flat = met.iter().map(|&other| 2 * flats[own].min(flats[other])).max();
                    let all = made.shells[own].points.len()
                        + met.iter().map(|&o| made.shells[o].points.len()).sum::<usize>();
                    let near = self.fitted(&counts, own, &met).max(flat.unwrap_or(0)).min(all);
                    TickCost::of(near as u64, all as u64)
                });
                PartTick {
                    name: self.model.parts[part].name.clone(),
                    cost,
                }
            })
            .collect();
        ticks.sort_by_key(|t| std::cmp::Reverse(t.cost.instructions));
        ticks
    }

    /// Number of points near when a part of shape `own` sits in all of the parts of shapes `met` that it fits: each bore holds one pin; a pin is in as many
    /// bores as its length has place for.
    fn fitted(&self, counts: &[FacePoints], own: usize, met: &[usize]) -> usize {
        // For each own face, whether it is hollow, and the matching face with most points of each partner: points and length.
        let mut held: BTreeMap<u32, (bool, Vec<(usize, f64)>)> = BTreeMap::new();
        for &other in met {
            let fits = self.fits.iter().find(|(pair, _)| *pair == (own, other));
            let mut most: BTreeMap<u32, (bool, (usize, f64))> = BTreeMap::new();
            for fit in fits.map_or(&[][..], |(_, fits)| fits) {
                let theirs = (counts[other].on(fit.faces[1]), counts[other].length(fit.faces[1]));
                let entry = most.entry(fit.faces[0]).or_insert((fit.hollow, theirs));
                if theirs.0 > entry.1.0 {
                    entry.1 = theirs;
                }
            }
            for (face, (hollow, theirs)) in most {
                held.entry(face).or_insert((hollow, Vec::new())).1.push(theirs);
            }
        }
        let near = |(face, (hollow, theirs)): (u32, (bool, Vec<(usize, f64)>))| {
            let own_points = counts[own].on(face);
            if hollow {
                own_points + theirs.iter().map(|&(points, _)| points).max().unwrap_or(0)
            } else {
                // Bores are beside one another: a point is in one of them, or where two meet.
                theirs.len().min(2) * own_points + around(counts[own].length(face), theirs)
            }
        };
        held.into_iter().map(near).sum()
    }

    /// Number of points around the flat that has most.
    fn flats(&self, counts: &[FacePoints], shape: usize) -> usize {
        let faces = self.surfaces[shape].shape().faces.iter().enumerate();
        let flats = faces.filter(|(_, f)| matches!(f.surface, Surface::Plane { .. }));
        flats.map(|(i, _)| counts[shape].on(i as u32)).max().unwrap_or(0)
    }
}

/// Upper bound of the points of bores (points and length each) that are side by side around a pin of length `pin`: of those with most points on their length
/// until they fill the pin, and once more of the two with most points, which may extend over its ends.
fn around(pin: f64, mut bores: Vec<(usize, f64)>) -> usize {
    let all: usize = bores.iter().map(|(points, _)| points).sum();
    bores.sort_by_key(|&(points, _)| std::cmp::Reverse(points));
    let at_ends: usize = bores.iter().take(2).map(|(points, _)| points).sum();
    let density = |&(points, length): &(usize, f64)| points as f64 / length.max(1e-9);
    bores.sort_by(|a, b| density(b).total_cmp(&density(a)));
    let mut filled = 0.0;
    let on_pin = bores.iter().take_while(|(_, length)| {
        let is_full = filled >= pin;
        filled += length;
        !is_full
    });
    all.min(at_ends + on_pin.map(|(points, _)| points).sum::<usize>())
}

/// Number of points on each face of a shape, borders included, and the face's length along its axis.
struct FacePoints {
    counts: Vec<usize>,
    lengths: Vec<f64>,
}

impl FacePoints {
    fn of(shell: &Pointshell, surface: &ExactSurface) -> Self {
        let faces = &surface.shape().faces;
        let mut counts = vec![0; faces.len()];
        let mut spans = vec![[f64::INFINITY, f64::NEG_INFINITY]; faces.len()];
        let mut add = |face: u16, position: DVec3| {
            let face = usize::from(face);
            let Some(count) = counts.get_mut(face) else { return };
            *count += 1;
            if let Some(along) = along(&faces[face].surface, position) {
                spans[face] = [spans[face][0].min(along), spans[face][1].max(along)];
            }
        };
        for point in &shell.points {
            add(point.face, point.position);
            if point.edge_face != point.face && point.edge_face != mortise_protocol::image::NO_FACE {
                add(point.edge_face, point.position);
            }
        }
        let length = |(face, [low, high]): (usize, [f64; 2])| match faces[face].surface {
            Surface::Sphere { radius, .. } => 2.0 * radius,
            _ => (high - low).max(0.0),
        };
        let lengths = spans.into_iter().enumerate().map(length).collect();
        Self { counts, lengths }
    }

    fn on(&self, face: u32) -> usize {
        self.counts.get(face as usize).copied().unwrap_or(0)
    }

    /// mm; 0 for a face without an axis.
    fn length(&self, face: u32) -> f64 {
        self.lengths.get(face as usize).copied().unwrap_or(0.0)
    }
}

/// Place of a point along the axis of a round face, mm.
fn along(surface: &Surface, position: DVec3) -> Option<f64> {
    match surface {
        Surface::Cylinder { frame, .. } | Surface::Cone { frame, .. } => {
            Some((position - frame.origin).dot(frame.z))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::around;

    proptest! {
        /// Against all choices of bores that lie on the pin, and of two over its ends.
        #[test]
        fn no_bores_around_a_pin_have_more_points(
            pin in 1.0f64..20.0,
            bores in prop::collection::vec((0usize..100, 0.5f64..30.0), 0..9),
        ) {
            let mut most = 0;
            for chosen in 0u32..1 << bores.len() {
                let of = |i: &usize| chosen >> i & 1 == 1;
                let mut lengths: Vec<f64> = (0..bores.len()).filter(of).map(|i| bores[i].1).collect();
                lengths.sort_by(f64::total_cmp);
                // The two longest extend over the ends.
                lengths.truncate(lengths.len().saturating_sub(2));
                if lengths.iter().sum::<f64>() <= pin {
                    most = most.max((0..bores.len()).filter(of).map(|i| bores[i].0).sum());
                }
            }
            let all: usize = bores.iter().map(|bore| bore.0).sum();
            let bound = around(pin, bores.clone());
            prop_assert!(bound >= most && bound <= all, "{bound} {most}");
        }
    }

    /// Nuts of 5 mm on a bolt of 23 mm: four whole ones and one more that begins on it, and one over each end.
    #[test]
    fn as_many_nuts_are_on_a_bolt_as_it_has_place_for() {
        assert_eq!(around(23.0, vec![(30, 5.0); 82]), 7 * 30);
    }
}
