//! Worst-case ticks of a planned scene: points near when a part sits in everything it fits into.

use std::collections::BTreeMap;

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
        let counts: Vec<FacePoints> = made.shells.iter().map(FacePoints::of).collect();
        let flats: Vec<usize> = (0..counts.len()).map(|i| self.flats(&counts, i)).collect();
        let mut ticks: Vec<PartTick> = (0..scene.parts.len())
            .filter(|&i| scene.grabbable[i])
            .map(|i| {
                let (part, own) = scene.parts[i];
                let met: Vec<usize> = (0..scene.parts.len())
                    .filter(|&j| j != i)
                    .map(|j| scene.parts[j].1)
                    .collect();
                // On a larger flat at most as much of its border is near as of the smaller one's.
                let flat = met.iter().map(|&other| 2 * flats[own].min(flats[other])).max();
                let all = made.shells[own].points.len()
                    + met.iter().map(|&o| made.shells[o].points.len()).sum::<usize>();
                let near = self.fitted(&counts, own, &met).max(flat.unwrap_or(0)).min(all);
                PartTick {
                    name: self.model.parts[part].name.clone(),
                    cost: TickCost::of(near as u64, all as u64),
                }
            })
            .collect();
        ticks.sort_by_key(|t| std::cmp::Reverse(t.cost.instructions));
        ticks
    }

    /// Number of points near when a part of shape `own` sits in all of the parts of shapes `met` that it fits: each bore holds one pin; a pin may be
    /// in a bore of each other part.
    fn fitted(&self, counts: &[FacePoints], own: usize, met: &[usize]) -> usize {
        // For each own face, whether it is hollow, and the point count of the largest matching face of each partner.
        let mut held: BTreeMap<u32, (bool, Vec<usize>)> = BTreeMap::new();
        for &other in met {
            let fits = self.fits.iter().find(|(pair, _)| *pair == (own, other));
            let mut most: BTreeMap<u32, (bool, usize)> = BTreeMap::new();
            for fit in fits.map_or(&[][..], |(_, fits)| fits) {
                let points = counts[other].on(fit.faces[1]);
                let entry = most.entry(fit.faces[0]).or_insert((fit.hollow, 0));
                entry.1 = entry.1.max(points);
            }
            for (face, (hollow, points)) in most {
                held.entry(face).or_insert((hollow, Vec::new())).1.push(points);
            }
        }
        let near = |(face, (hollow, theirs)): (u32, (bool, Vec<usize>))| {
            let own = counts[own].on(face);
            if hollow {
                own + theirs.iter().max().unwrap_or(&0)
            } else {
                theirs.len() * own + theirs.iter().sum::<usize>()
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

/// Number of points on each face of a shape, borders included.
struct FacePoints(Vec<usize>);

impl FacePoints {
    fn of(shell: &Pointshell) -> Self {
        let mut counts = Vec::new();
        let mut add = |face: u16| {
            let face = usize::from(face);
            if counts.len() <= face {
                counts.resize(face + 1, 0);
            }
            counts[face] += 1;
        };
        for point in &shell.points {
            add(point.face);
            if point.edge_face != point.face && point.edge_face != mortise_protocol::image::NO_FACE {
                add(point.edge_face);
            }
        }
        Self(counts)
    }

    fn on(&self, face: u32) -> usize {
        self.0.get(face as usize).copied().unwrap_or(0)
    }
}
