//! The classic pointshell: a point at the centre of every voxel the surface crosses.
//!
//! The textbook baseline (McNeely, Puterbaugh & Troy 1999; Faas & Vance 2010): points lie on the voxel grid, up to half a voxel's diagonal from the
//! surface. Their normals are those of the voxels: the direction in which the 26 surrounding voxels are more free and less solid. Shrinking moves
//! each point inward along its normal by up to a voxel, which recovers clearance lost to voxelisation. Only moving parts have points: the method
//! tests one direction. A point names the faces that cross its voxel, two of them at most. Cost: a few tens of exact queries for each voxel, in
//! parallel.

use std::collections::HashMap;

use glam::DVec3;
use mortise_protocol::image::{BRICK_CELLS, Voxel};
use rayon::prelude::*;

use crate::bounds::{Class, classify};
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::positions;
use crate::grid::Grid;
use crate::occupancy::{place, voxels};
use crate::shell::{Pointshell, ShellPoint};

/// Integer coordinates of a voxel, from the grid's origin.
type Place = [i64; 3];

/// Most grid entries: with more, a shell would have millions of points.
const MAX_ENTRIES: u64 = 1 << 20;

/// Makes one point for each voxel of `voxel_mm` that `surface` crosses, moved inward by `shrink_percent` of a voxel. `part` names it in errors.
///
/// # Errors
/// [`BakeError::CellTooSmall`] when there would be more voxels than any board can hold.
pub fn classic_pointshell(
    surface: &ExactSurface,
    voxel_mm: f64,
    shrink_percent: f64,
    part: &str,
) -> Result<Pointshell, BakeError> {
    // Same grid as the voxmap's: plane faces run through voxel centres.
    let mut grid = Grid::over(surface.shape(), voxel_mm, 3.0 * voxel_mm, surface.chord);
    grid.origin_m = grid.origin_m.map(|x| x - 0.5 * grid.cell_m);
    if grid.entries() > MAX_ENTRIES {
        let ratio = (grid.entries() as f64 / MAX_ENTRIES as f64).cbrt() * 1.1;
        return Err(BakeError::CellTooSmall {
            part: part.to_owned(),
            cell_mm: voxel_mm,
            what: format!("{} blocks of voxels, at most {MAX_ENTRIES}", grid.entries()),
            enough_mm: voxel_mm * ratio,
        });
    }
    // Distance from the surface through a crossed voxel to the far side of its neighbours.
    let classes = classify(surface, &grid, (2.0 * 3f64.sqrt()) * grid.cell(), &|| true);
    let near: Vec<[u32; 3]> = positions(&grid)
        .filter(|&at| classes[grid.index(at)] == Class::Stored)
        .collect();
    let bricks: Vec<Vec<(Place, Voxel, [u16; 2])>> = near
        .par_iter()
        .map(|&at| {
            let voxels = voxels(surface, &grid, at);
            let of = |(i, (kind, faces)): (usize, (Voxel, [u16; 3]))| {
                let own = place(i);
                let along = |axis: usize| i64::from(at[axis]) * BRICK_CELLS as i64 + own[axis] as i64;
                ([along(0), along(1), along(2)], kind, [faces[0], faces[1]])
            };
            let each = voxels.kinds.into_iter().zip(voxels.faces);
            each.enumerate().map(of).collect()
        })
        .collect();
    let kinds: HashMap<Place, Voxel> = (bricks.iter().flatten())
        .map(|&(at, kind, _)| (at, kind))
        .collect();
    let crossed: Vec<(Place, [u16; 2])> = bricks
        .into_iter()
        .flatten()
        .filter(|&(_, kind, _)| kind == Voxel::Surface)
        .map(|(at, _, faces)| (at, faces))
        .collect();
    let inward = shrink_percent / 100.0 * grid.cell();
    let (points, offsets): (Vec<ShellPoint>, Vec<f64>) = crossed
        .par_iter()
        .filter_map(|&(at, [face, edge_face])| {
            let center = grid.at(DVec3::from_array(at.map(|x| x as f64 + 0.5)));
            let nearest = surface.nearest(center)?;
            let exact = (center - nearest.point) * nearest.distance.signum();
            let normal = voxel_normal(&kinds, at).or(exact.try_normalize())?;
            let point = ShellPoint {
                position: center - normal * inward,
                normal,
                face,
                edge_face,
                span: None,
            };
            Some((point, nearest.distance - inward))
        })
        .unzip();
    Ok(Pointshell {
        face_points: points.len(),
        points,
        offsets,
        ..Pointshell::default()
    })
}

/// Normal that points away from the solid voxels and towards the free ones, each weighted by the inverse square of its distance; `None` where they
/// cancel (a wall of one voxel).
fn voxel_normal(kinds: &HashMap<Place, Voxel>, at: Place) -> Option<DVec3> {
    let mut sum = DVec3::ZERO;
    for z in -1..=1 {
        for y in -1..=1 {
            for x in -1..=1 {
                let weight = match kinds.get(&[at[0] + x, at[1] + y, at[2] + z]) {
                    Some(Voxel::Interior) => -1.0,
                    Some(Voxel::Surface) => 0.0,
                    _ => 1.0,
                };
                let step = DVec3::new(x as f64, y as f64, z as f64);
                sum += step * (weight / step.length_squared().max(1.0));
            }
        }
    }
    (sum.length() > 1e-6).then(|| sum.normalize())
}
