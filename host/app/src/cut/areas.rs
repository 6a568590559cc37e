//! The areas in which a plane cuts placed parts, as meshes in the plane's coordinates. Pure.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2};
use mortise_brep::CadModel;
use mortise_inspect::{CutPlane, Fineness, Loop, Section, Solid, section};

use super::gaps::{self, Following, Gaps, Placed};
use crate::display::extent::Extent;
use crate::display::mesh::{Segment, ShapeMesh, Vertex};

/// The area in which a plane cuts one part.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Index of the part.
    pub part: usize,
    /// The area and its border, in the plane's coordinates, z = 0; what is cut of open shells is among the segments, and has no area.
    pub mesh: ShapeMesh,
    /// Number of lines in which open shells are cut.
    pub open_lines: usize,
    /// Area, mm².
    pub area_mm2: f64,
}

/// The areas of all parts that a plane cuts.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Number of the document.
    pub generation: u64,
    /// The plane.
    pub plane: CutPlane,
    /// One area for each part that is cut, in the order of the parts.
    pub areas: Vec<Arc<Area>>,
    /// The gaps along their borders, once they are computed.
    pub gaps: Option<Gaps>,
}

impl Cut {
    /// Plane to world, mm.
    pub fn pose(&self) -> DAffine3 {
        pose(&self.plane)
    }

    /// The part whose area contains the point `at` of the plane, among those that are not `hidden`.
    pub fn part_at(&self, at: DVec2, hidden: &[bool]) -> Option<usize> {
        let is_hidden = |part: usize| hidden.get(part).is_some_and(|hidden| *hidden);
        let found = (self.areas.iter()).find(|area| !is_hidden(area.part) && area.contains(at))?;
        Some(found.part)
    }

    /// Parts of which open shells are cut, which encloses no area.
    pub fn open_parts(&self) -> impl Iterator<Item = usize> + '_ {
        (self.areas.iter())
            .filter(|area| area.open_lines > 0)
            .map(|area| area.part)
    }
}

impl Area {
    /// Whether the area contains the point `at` of the plane. Cost: linear in its triangles.
    pub fn contains(&self, at: DVec2) -> bool {
        let corner = |i: u32| {
            let [x, y, _] = self.mesh.vertices[i as usize].position;
            DVec2::new(x.into(), y.into())
        };
        (self.mesh.indices.chunks_exact(3)).any(|t| {
            let [a, b, c] = [corner(t[0]), corner(t[1]), corner(t[2])];
            [(a, b), (b, c), (c, a)]
                .iter()
                .all(|&(p, q)| (q - p).perp_dot(at - p) >= 0.0)
        })
    }
}

/// Plane to world, mm.
pub fn pose(plane: &CutPlane) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols(plane.x, plane.y, plane.normal),
        translation: plane.origin,
    }
}

/// Cuts parts, and keeps what it can for the next time: solids for a document, areas for parts at rest.
#[derive(Default)]
pub struct Cutter {
    generation: Option<u64>,
    /// By shape.
    solids: HashMap<usize, Arc<Solid>>,
    plane: Option<CutPlane>,
    /// By part, with the pose at which it was cut; `None`: not cut.
    known: HashMap<usize, (DAffine3, Option<Arc<Area>>)>,
}

impl Cutter {
    /// The areas in which `plane` cuts the parts of `model` at `poses`, with borders at most `sag_mm` off the exact curves.
    pub fn cut(
        &mut self,
        generation: u64,
        model: &CadModel,
        poses: &[DAffine3],
        plane: CutPlane,
        sag_mm: f64,
    ) -> Cut {
        if self.generation != Some(generation) {
            *self = Self {
                generation: Some(generation),
                ..Self::default()
            };
        }
        if self.plane != Some(plane) {
            self.known.clear();
            self.plane = Some(plane);
        }
        let mut areas = Vec::new();
        for (index, (part, pose)) in model.parts.iter().zip(poses).enumerate() {
            if let Some((at, area)) = self.known.get(&index)
                && at == pose
            {
                areas.extend(area.clone());
                continue;
            }
            let Some(shape) = model.shapes.get(part.shape) else {
                continue;
            };
            let solid = self
                .solids
                .entry(part.shape)
                .or_insert_with(|| Arc::new(Solid::new(shape)));
            let found = section(solid, pose, &plane, Fineness::Exact(sag_mm));
            let area = (!found.is_empty()).then(|| Arc::new(area(index, &found, &plane)));
            areas.extend(area.clone());
            self.known.insert(index, (*pose, area));
        }
        Cut {
            generation,
            plane,
            areas,
            gaps: None,
        }
    }

    /// The gaps along the borders of `cut`, which this has made of `model` at `poses`. Open shells, which have no inside, are left out.
    pub fn gaps(&self, cut: &Cut, model: &CadModel, poses: &[DAffine3], how: Following) -> Gaps {
        let placed: Vec<Placed<'_>> = (model.parts.iter().zip(poses).enumerate())
            .filter_map(|(part, (of, pose))| {
                let shape = model.shapes.get(of.shape).filter(|shape| shape.closed)?;
                let Extent { center, radius } = Extent::of_points(shape.mesh.vertices.iter().copied());
                Some(Placed {
                    part,
                    solid: self.solids.get(&of.shape)?,
                    pose: *pose,
                    ball: (pose.transform_point3(center), radius),
                })
            })
            .collect();
        let mut bands = Vec::new();
        for area in &cut.areas {
            let Some(own) = placed.iter().find(|placed| placed.part == area.part) else {
                continue;
            };
            for side in &area.mesh.segments {
                let ends = [side.a, side.b]
                    .map(|[x, y, _]| cut.plane.from_plane(DVec2::new(f64::from(x), f64::from(y))));
                gaps::along(ends, *own, &placed, cut.plane, how, &mut bands);
            }
        }
        Gaps {
            range_mm: how.range_mm,
            bands,
        }
    }
}

fn area(part: usize, section: &Section, plane: &CutPlane) -> Area {
    let flat = |p: DVec2| [p.x as f32, p.y as f32, 0.0];
    let vertices = (section.cap.points.iter())
        .map(|&p| Vertex {
            position: flat(p),
            normal: [0.0, 0.0, 1.0],
            color: [0; 4],
            face: u32::MAX,
        })
        .collect();
    let indices = section.cap.triangles.iter().flatten().copied().collect();
    let mut segments = Vec::new();
    for (lines, closed) in [(&section.loops, true), (&section.open, false)] {
        for line in lines {
            segments.extend(sides(line, closed, plane).map(|[a, b]| Segment {
                a: flat(a),
                b: flat(b),
                faces: [u32::MAX; 2],
            }));
        }
    }
    Area {
        part,
        mesh: ShapeMesh {
            vertices,
            indices,
            segments,
            closed: false,
        },
        open_lines: section.open.len(),
        area_mm2: section.area_mm2(),
    }
}

/// Sides of a line in the plane's coordinates.
fn sides<'a>(line: &'a Loop, closed: bool, plane: &'a CutPlane) -> impl Iterator<Item = [DVec2; 2]> + 'a {
    let n = line.points.len();
    let count = if closed { n } else { n.saturating_sub(1) };
    (0..count).map(move |i| [i, (i + 1) % n].map(|k| plane.to_plane(line.points[k])))
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::DVec3;

    use super::*;
    use crate::session::document::Document;

    /// The sample: a block of 50 × 50 × 40 mm with a bore of 18.75 mm, below z = 0, and a peg of 17.75 mm above.
    #[test]
    fn the_sample_is_cut_where_it_is_solid() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut cutter = Cutter::default();
        let plane = CutPlane::new(DVec3::new(0.0, 0.0, -10.0), DVec3::Z).expect("a plane");
        let cut = cutter.cut(1, &document.model, &document.poses, plane, 1e-3);
        let at = |x: f64, y: f64| cut.part_at(plane.to_plane(DVec3::new(x, y, -10.0)), &[]);
        assert_eq!(
            (at(20.0, 20.0), at(0.0, 0.0), at(40.0, 0.0)),
            (Some(0), None, None)
        );
        assert!(cut.areas.iter().all(|area| area.part == 0) && cut.open_parts().next().is_none());
        let want = 2500.0 - std::f64::consts::PI * 9.375 * 9.375;
        assert!(
            (cut.areas[0].area_mm2 - want).abs() < 1.0,
            "{}",
            cut.areas[0].area_mm2
        );
    }

    #[test]
    fn only_what_moved_is_cut_again() {
        let document = Document::sample(1, &|_| ControlFlow::Continue(())).expect("the sample");
        let mut cutter = Cutter::default();
        let plane = CutPlane::new(DVec3::ZERO, DVec3::Y).expect("a plane");
        let first = cutter.cut(1, &document.model, &document.poses, plane, 1e-3);
        assert_eq!(first.areas.len(), 2);
        let mut poses = document.poses.clone();
        poses[1].translation.z += 5.0;
        let second = cutter.cut(1, &document.model, &poses, plane, 1e-3);
        assert!(Arc::ptr_eq(&first.areas[0], &second.areas[0]));
        assert!(!Arc::ptr_eq(&first.areas[1], &second.areas[1]));
        poses[1].translation.y += 100.0;
        assert_eq!(cutter.cut(1, &document.model, &poses, plane, 1e-3).areas.len(), 1);
    }

    /// Sag of the borders, mm: far more than the error allowed.
    const SAG_MM: f64 = 0.02;

    /// The sample with its peg of 17.75 mm in the bore of 18.75 mm, moved aside, cut at `origin` across `normal`, and the gaps there.
    fn cut_gaps(aside: f64, origin: DVec3, normal: DVec3) -> (Cut, Gaps) {
        let mut document = Document::sample(2, &|_| ControlFlow::Continue(())).expect("the sample");
        document.poses[1].translation += DVec3::new(aside, 0.0, -55.0);
        let plane = CutPlane::new(origin, normal).expect("a plane");
        let mut cutter = Cutter::default();
        let cut = cutter.cut(2, &document.model, &document.poses, plane, SAG_MM);
        let how = Following {
            range_mm: 1.5,
            longest_mm: 0.4,
        };
        let gaps = cutter.gaps(&cut, &document.model, &document.poses, how);
        (cut, gaps)
    }

    /// Ends of bands in the world, with part and distance, well inside the bore.
    fn ends(cut: &Cut, gaps: &Gaps) -> Vec<(usize, DVec3, f64)> {
        (gaps.bands.iter())
            .flat_map(|band| [0, 1].map(|i| (band, i)))
            .map(|(band, i)| {
                let at = cut.plane.from_plane(band.ends[i]);
                (band.parts[0], at, band.distances_mm[i])
            })
            .filter(|(_, at, _)| (-30.0..=-2.0).contains(&at.z))
            .collect()
    }

    #[test]
    fn around_a_peg_the_gap_is_exact_where_the_border_is_a_polygon() {
        let (cut, gaps) = cut_gaps(0.0, DVec3::new(0.0, 0.0, -10.0), DVec3::Z);
        let ends = ends(&cut, &gaps);
        for part in [0, 1] {
            let own: Vec<_> = ends.iter().filter(|end| end.0 == part).collect();
            assert!(own.len() > 100, "{}", own.len());
            let worst = own.iter().map(|end| (end.2 - 0.5).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-6, "part {part}: {worst} mm");
        }
        assert!(gaps.bands.iter().all(|b| b.parts == [0, 1] || b.parts == [1, 0]));
        let longest = (gaps.bands.iter()).map(|b| b.ends[0].distance(b.ends[1]));
        assert!(longest.fold(0.0, f64::max) <= 0.4);
    }

    #[test]
    fn a_peg_aside_overlaps_on_one_side_by_what_it_leaves_less_on_the_other() {
        let (cut, gaps) = cut_gaps(0.75, DVec3::ZERO, DVec3::Y);
        let peg: Vec<_> = (ends(&cut, &gaps).into_iter()).filter(|end| end.0 == 1).collect();
        for (x, want) in [(9.625, -0.25), (-8.125, 1.25)] {
            let side: Vec<_> = peg.iter().filter(|end| (end.1.x - x).abs() < 1e-6).collect();
            assert!(side.len() > 40, "{x}: {}", side.len());
            assert!(
                side.iter().all(|end| (end.2 - want).abs() < 1e-6),
                "{x}: {side:?}"
            );
        }
    }

    #[test]
    fn nothing_far_is_followed() {
        let (_, gaps) = cut_gaps(60.0, DVec3::ZERO, DVec3::Y);
        assert_eq!(gaps.bands, []);
    }
}
