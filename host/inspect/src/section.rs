//! Plane section of a placed solid.

use glam::{DAffine3, DVec2, DVec3};

use crate::cap::{self, Cap};
use crate::curve;
use crate::plane::CutPlane;
use crate::solid::Solid;
use crate::trace::{Chain, trace};

/// How closely a section follows the exact surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fineness {
    /// The tessellation's facets as they are: within the shape's deflection.
    Facets,
    /// On the exact surfaces, with sides that sag at most this much, mm, and at most half a percent of their length.
    Exact(f64),
}

/// A closed loop of a section, or a piece of a line where an open shell is cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    /// Points in order, mm, in the assembly's frame. Seen against the plane's normal the solid is on the left.
    pub points: Vec<DVec3>,
    /// For each point the face that the side from it to the next one is on.
    pub faces: Vec<u32>,
}

/// Section of a placed solid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Outlines of the solid: closed loops.
    pub loops: Vec<Loop>,
    /// Lines in which open shells are cut, loops of them included: what they enclose is no solid, and has no cap.
    pub open: Vec<Loop>,
    /// The area inside the loops, in the plane's coordinates.
    pub cap: Cap,
}

impl Section {
    /// Whether nothing is cut.
    pub fn is_empty(&self) -> bool {
        self.loops.is_empty() && self.open.is_empty()
    }

    /// Area of the cap, mm².
    pub fn area_mm2(&self) -> f64 {
        self.cap.area()
    }

    /// Area by the loops alone, mm²: that of the cap where no loops overlap.
    pub fn loop_area_mm2(&self, plane: &CutPlane) -> f64 {
        self.loops.iter().map(|l| signed_area(&flat(l, plane))).sum()
    }
}

/// Cuts `solid` at `pose` (shape to assembly) by `plane`, in the assembly's frame. A vertex in the plane counts as above: along a face the section is the one
/// infinitesimally below. Loops without area, as a plane leaves that touches an edge, are left out.
pub fn section(solid: &Solid, pose: &DAffine3, plane: &CutPlane, fineness: Fineness) -> Section {
    let local = plane.seen_from(pose);
    let mut found = Section::default();
    for chain in trace(&solid.shape().mesh, solid.open(), &local) {
        let chain = match fineness {
            Fineness::Facets => chain,
            Fineness::Exact(sag_mm) => curve::exact(&chain, solid.surface(), local.normal, sag_mm),
        };
        let is_outline = chain.closed && !chain.open_shell;
        let line = placed(&chain, pose);
        if !is_outline {
            if line.points.len() > 1 {
                found.open.push(line);
            }
        } else if line.points.len() > 2 {
            found.loops.push(line);
        }
    }
    let loops: Vec<Vec<DVec2>> = found.loops.iter().map(|l| flat(l, plane)).collect();
    found.cap = cap::cap(&loops);
    found
}

/// The chain in the assembly's frame, without sides of no length.
fn placed(chain: &Chain, pose: &DAffine3) -> Loop {
    let mut line = Loop {
        points: Vec::new(),
        faces: Vec::new(),
    };
    for c in &chain.crossings {
        let p = pose.transform_point3(c.point);
        if line.points.last() == Some(&p) {
            // The side that departs is on the later face.
            if let Some(face) = line.faces.last_mut() {
                *face = c.face;
            }
            continue;
        }
        line.points.push(p);
        line.faces.push(c.face);
    }
    if chain.closed && line.points.len() > 1 && line.points.first() == line.points.last() {
        line.points.pop();
        line.faces.pop();
    }
    line
}

fn flat(l: &Loop, plane: &CutPlane) -> Vec<DVec2> {
    l.points.iter().map(|&p| plane.to_plane(p)).collect()
}

fn signed_area(points: &[DVec2]) -> f64 {
    // About the first point: coordinates may be large.
    let Some(&o) = points.first() else { return 0.0 };
    points
        .windows(2)
        .map(|w| (w[0] - o).perp_dot(w[1] - o) / 2.0)
        .sum()
}
