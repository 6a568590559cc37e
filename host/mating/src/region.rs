//! Regions of planes that a shape's faces cover: what a plane port can take (Jung, "Task-level assembly modeling in virtual environments", 2003, section 3).

use glam::{DAffine3, DVec3};
use mortise_brep::{Curve, Shape, Surface};

use crate::merge::MergedSurface;
use crate::overlap::{Chart, Drawing};
use crate::tiles::{ShapeTiles, Tiles};

/// Connected faces of a shape in one plane. Lengths mm, in the shape's frame.
pub struct PlaneRegion {
    /// Centre of area.
    pub middle: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
    /// Area, mm².
    pub area_mm2: f64,
    /// Largest distance of its points from the middle.
    pub reach_mm: f64,
    /// Unit direction of its longest straight edge.
    pub edge: Option<DVec3>,
    tiles: Tiles,
    chart: Chart,
    drawing: Drawing,
}

impl PlaneRegion {
    /// Area common with `other`, seen along the normal, when `place` brings the other's frame to this one's, mm². Arcs are followed to 1/256 of what a chord leaves out.
    ///
    /// Cost: one clip for each pair of triangles whose boxes meet.
    pub fn common_mm2(&self, other: &Self, place: &DAffine3) -> f64 {
        let moved = self.chart.draw(&other.tiles, place);
        self.chart.common(&self.drawing, &moved).0
    }
}

/// The regions of a shape's merged planes, in their order.
///
/// Cost: as the tessellation of the planes.
pub fn plane_regions(shape: &Shape, surfaces: &[MergedSurface]) -> Vec<PlaneRegion> {
    let of_shape = ShapeTiles::new(shape);
    let mut regions = Vec::new();
    for surface in surfaces {
        let Surface::Plane { frame } = surface.surface else {
            continue;
        };
        let patches = surface.patches.iter().max().map_or(0, |&last| last + 1);
        for patch in 0..patches {
            let faces: Vec<u32> = (surface.faces.iter().zip(&surface.patches))
                .filter(|(_, of)| **of == patch)
                .map(|(face, _)| *face)
                .collect();
            let (mut coarse, mut fine) = (Tiles::default(), Tiles::default());
            for &face in &faces {
                coarse.append(of_shape.face(face).coarse);
                fine.append(of_shape.fine(face));
            }
            let Some(chart) = Chart::new(&surface.surface) else {
                continue;
            };
            let (area_mm2, middle) = chart.draw(&fine, &DAffine3::IDENTITY).area_and_middle();
            if !middle.is_finite() {
                continue;
            }
            let middle = chart.point(middle);
            regions.push(PlaneRegion {
                middle,
                reach_mm: (fine.corners.iter())
                    .map(|corner| corner.distance(middle))
                    .fold(0.0, f64::max),
                normal: frame.z,
                area_mm2,
                edge: longest_edge(shape, &faces),
                drawing: chart.draw(&coarse, &DAffine3::IDENTITY),
                tiles: coarse,
                chart,
            });
        }
    }
    regions
}

/// Direction of the longest straight edge of some faces; edges between two of them are none of theirs.
fn longest_edge(shape: &Shape, faces: &[u32]) -> Option<DVec3> {
    (shape.edges.iter())
        .filter(|edge| edge.faces.iter().filter(|face| faces.contains(face)).count() == 1)
        .filter_map(|edge| match edge.curve {
            Curve::Line { direction, .. } => Some((edge.length_mm, direction)),
            _ => None,
        })
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, direction)| direction)
}
