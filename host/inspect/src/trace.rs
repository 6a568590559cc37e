//! Chains in which a plane crosses a mesh.
//!
//! A vertex in the plane counts as above it, so that a plane through vertices, edges or faces cuts as one infinitesimally lower does: every crossed triangle
//! has exactly two crossed sides, and every crossed edge of a closed mesh belongs to as many chains that arrive as depart. Chains are followed by these
//! edges, not by positions.
//!
//! Orientation: seen against the plane's normal the solid is on the left. Cost: linear in the triangles.

use std::collections::HashMap;

use glam::DVec3;
use mortise_brep::Mesh;

use crate::plane::CutPlane;

/// Height up to which a vertex is in the plane, mm: without that the crossings of its edges would differ by rounding.
const LEVEL_MM: f64 = 1e-9;
/// The same as a share of the distance from the plane's origin, of which the height is computed.
const ROUNDING: f64 = 1e-14;

/// A crossing of the plane with an edge of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Position, mm.
    pub point: DVec3,
    /// Face of the side that departs from here; of the last point of an open chain the face of the side that arrives.
    pub face: u32,
}

/// A sequence of crossings.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Crossings in order.
    pub crossings: Vec<Crossing>,
    /// Whether the last is joined to the first.
    pub closed: bool,
    /// Whether it belongs to a shell that bounds no solid.
    pub open_shell: bool,
}

/// A side: from one crossing to the next.
struct Side {
    from: u32,
    to: u32,
    face: u32,
    open_shell: bool,
}

/// The chains in which `plane` crosses `mesh`; `open` tells for each triangle whether its shell is open.
pub fn trace(mesh: &Mesh, open: &[bool], plane: &CutPlane) -> Vec<Chain> {
    let height = |&v: &DVec3| {
        let h = plane.height(v);
        if h.abs() <= LEVEL_MM + ROUNDING * (v - plane.origin).length() {
            0.0
        } else {
            h
        }
    };
    let heights: Vec<f64> = mesh.vertices.iter().map(height).collect();
    let mut points = Vec::new();
    let mut known: HashMap<[u32; 2], u32> = HashMap::new();
    let mut crossing = |a: u32, b: u32| {
        let key = [a.min(b), a.max(b)];
        *known.entry(key).or_insert_with(|| {
            let [a, b] = key.map(|v| v as usize);
            let share = heights[a] / (heights[a] - heights[b]);
            let (from, to) = (mesh.vertices[a], mesh.vertices[b]);
            // Both ends exactly: a vertex in the plane is the crossing of all its edges.
            points.push(if share >= 1.0 {
                to
            } else {
                from + (to - from) * share
            });
            points.len() as u32 - 1
        })
    };
    let mut sides = Vec::new();
    for (i, t) in mesh.triangles.iter().enumerate() {
        let above = t.map(|v| heights[v as usize] >= 0.0);
        if above[0] == above[1] && above[1] == above[2] {
            continue;
        }
        let side = |up: bool| {
            (0..3)
                .map(|k| (k, (k + 1) % 3))
                .find(|&(k, n)| above[k] != up && above[n] == up)
                .map(|(k, n)| (t[k], t[n]))
        };
        let (Some(down), Some(up)) = (side(false), side(true)) else {
            continue;
        };
        sides.push(Side {
            from: crossing(down.0, down.1),
            to: crossing(up.0, up.1),
            face: mesh.triangle_face[i],
            open_shell: open[i],
        });
    }
    follow(&sides, &points)
}

/// Joins sides to chains: open ones first, from their starts.
fn follow(sides: &[Side], points: &[DVec3]) -> Vec<Chain> {
    let mut departing: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
    let mut balance = vec![0i32; points.len()];
    for (i, side) in sides.iter().enumerate().rev() {
        departing[side.from as usize].push(i as u32);
        balance[side.from as usize] += 1;
        balance[side.to as usize] -= 1;
    }
    let starts = (0..points.len()).flat_map(|n| std::iter::repeat_n(n, balance[n].max(0) as usize));
    let all = sides.iter().map(|side| side.from as usize);
    let mut chains = Vec::new();
    for start in starts.chain(all) {
        let mut at = start;
        let mut crossings = Vec::new();
        let mut last = None;
        while let Some(i) = departing[at].pop() {
            let side = &sides[i as usize];
            crossings.push(Crossing {
                point: points[at],
                face: side.face,
            });
            at = side.to as usize;
            last = Some(side);
            if at == start && balance[start] <= 0 {
                break;
            }
        }
        let Some(last) = last else { continue };
        let closed = at == start;
        if !closed {
            crossings.push(Crossing {
                point: points[at],
                face: last.face,
            });
        }
        chains.push(Chain {
            crossings,
            closed,
            open_shell: last.open_shell,
        });
    }
    chains
}
