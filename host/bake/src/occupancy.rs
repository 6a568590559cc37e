//! The voxmap: which voxels the exact surface crosses, two bits each.
//!
//! The textbook baseline (McNeely, Puterbaugh & Troy 1999): *surface* voxels are those the surface crosses, *proximity* voxels the layer around them
//! outside, *interior* voxels the rest of the solid. The paper scan-converts polygons; here the exact surface decides, so that the measured error is
//! the method's own. The force layer is not moved outward by two voxels, as the paper does to keep parts a voxel apart: parts with a small clearance
//! could then never meet.
//!
//! The grid is placed so that the largest plane faces across x, y and z run through voxel centres: there the tangent-plane depth is exact, which is
//! the method's best case. Cost: an exact query for each voxel of a stored brick, in parallel, and a few tens where the surface passes close to a
//! voxel's boundary.
//!
//! A surface voxel names the faces that cross it, as section 5.2 of Faas 2010 does: there a cube of the voxel's size is collided with each face, here
//! the nearest points to the voxel's centre and corners identify the faces. A face that is nearest to none of the nine, or only outside the voxel, is
//! not named.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use mortise_protocol::image::{
    BRICK_CELLS, BrickRecord, CELLS_PER_BRICK, FORMAT_OCCUPANCY, FieldRecord, GridEntry, Group, NO_FACE,
    Nearby, VOXEL_BRICK_BYTES, Voxel,
};
use rayon::prelude::*;

use crate::bounds::Class;
use crate::bricks::{self, Packed};
use crate::distance::{ExactSurface, Nearest, Scratch};
use crate::error::BakeError;
use crate::field::{BakedField, NearSurface, append_aligned, check_brick_count};
use crate::free_form_error::FreeFormError;
use crate::grid::Grid;

/// Layers of proximity voxels around the surface voxels, as in the paper.
pub const PROXIMITY_LAYERS: u32 = 1;
/// Bisections of a voxel after which an undecided cube counts as crossed.
const HALVINGS: u32 = 5;
/// Distance of the surface at which a voxel can still count as crossed, in voxels: the diagonal of its smallest subdivision.
pub const CROSSING_TOLERANCE_CELLS: f64 = 1.733 / (1 << HALVINGS) as f64;

/// Most faces named by a voxel.
const FACES: usize = 3;

/// Voxels of one brick, x fastest.
pub(crate) struct Voxels {
    pub kinds: [Voxel; CELLS_PER_BRICK],
    /// Faces that cross its surface voxels, nearest first, filled up with [`NO_FACE`].
    pub faces: [[u16; FACES]; CELLS_PER_BRICK],
}

/// Classifies the voxels near `surface`. `part` names it in errors; `progress` as for [`crate::bake_field`]. The result does not depend on the
/// number of threads.
pub fn bake_occupancy(
    surface: &mut ExactSurface,
    cell_mm: f64,
    part: &str,
    progress: &(dyn Fn(usize, usize) -> ControlFlow<()> + Sync),
) -> Result<BakedField, BakeError> {
    let layers = f64::from(PROXIMITY_LAYERS);
    let mut grid = Grid::over(surface.shape(), cell_mm, (layers + 2.0) * cell_mm, surface.chord);
    // The field's sample layers lie on planes; moved by half a voxel, the voxel centres do.
    grid.origin_m = grid.origin_m.map(|x| x - 0.5 * grid.cell_m);
    // Distance from the surface through a crossed voxel to the far side of the layers, with a small margin.
    let reach = (3f64.sqrt() * layers + 0.1) * grid.cell();
    let near = NearSurface::find(surface, &grid, reach, cell_mm, part, progress)?;
    let surface = &*surface;
    let done = AtomicUsize::new(0);
    let crossed: Option<Vec<Voxels>> = near
        .stored
        .par_iter()
        .map(|&at| {
            let voxels = voxels(surface, &grid, at);
            let n = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(n, near.stored.len()).is_continue().then_some(voxels)
        })
        .collect();
    let crossed = crossed.ok_or(BakeError::Cancelled)?;
    let mut places = vec![None; grid.entries() as usize];
    for (i, &at) in near.stored.iter().enumerate() {
        places[grid.index(at)] = Some(i);
    }
    let kinds: Vec<[Voxel; CELLS_PER_BRICK]> = (near.stored.par_iter().zip(&crossed))
        .map(|(&at, voxels)| with_proximity(&grid, &places, &crossed, at, &voxels.kinds))
        .collect();
    let packed = pack(&grid, &near, &kinds, &crossed);
    check_brick_count(packed.bricks.len(), cell_mm, part)?;
    Ok(packed)
}

/// State of each voxel of brick `at`: crossed, inside or outside (free for now).
pub(crate) fn voxels(surface: &ExactSurface, grid: &Grid, at: [u32; 3]) -> Voxels {
    let mut scratch = Scratch::default();
    let mut kinds = [Voxel::Free; CELLS_PER_BRICK];
    let mut faces = [[NO_FACE; FACES]; CELLS_PER_BRICK];
    for (i, kind) in kinds.iter_mut().enumerate() {
        let [x, y, z] = place(i);
        let center = grid.sample(at, [x, y, z]) + DVec3::splat(0.5 * grid.cell());
        let Some(nearest) = surface.query(center, f64::INFINITY, &mut scratch) else {
            continue;
        };
        let half = 0.5 * grid.cell();
        *kind = if crosses(surface, center, half, HALVINGS, &mut scratch) {
            faces[i] = crossing(surface, center, half, &nearest, &mut scratch);
            Voxel::Surface
        } else if nearest.distance < 0.0 {
            Voxel::Interior
        } else {
            Voxel::Free
        };
    }
    Voxels { kinds, faces }
}

/// Faces that cross the voxel of half edge `half` about `center`, starting with that of its `nearest` point.
fn crossing(
    surface: &ExactSurface,
    center: DVec3,
    half: f64,
    nearest: &Nearest,
    scratch: &mut Scratch,
) -> [u16; FACES] {
    let mut faces = [nearest.face as u16, NO_FACE, NO_FACE];
    let mut count = 1;
    // The surface crosses the voxel or its tolerance: its distance from a corner is at most the diagonal, plus a small margin.
    let within = 2.1 * half * 3f64.sqrt();
    for corner in 0..8 {
        let side = |axis: u32| if corner >> axis & 1 == 0 { -half } else { half };
        let Some(other) = surface.query(center + DVec3::new(side(0), side(1), side(2)), within, scratch)
        else {
            continue;
        };
        let face = other.face as u16;
        let inside = (other.point - center).abs().max_element() <= half + 1e-6;
        if inside && count < FACES && !faces[..count].contains(&face) {
            faces[count] = face;
            count += 1;
        }
    }
    faces
}

/// Palette of a brick's voxels. Where one face crosses all crossed voxels, it applies to the whole brick and takes no bytes.
fn named(voxels: &Voxels) -> Packed {
    let own = |faces: &[u16; FACES]| match *faces {
        [NO_FACE, ..] => Nearby::Unknown,
        faces if (faces.iter()).any(|&face| face != NO_FACE && face > Nearby::MAX_FACES) => Nearby::Unknown,
        [face, NO_FACE, _] => Nearby::Face(face),
        [a, b, NO_FACE] => Group::new(&[&[a], &[b]]).map_or(Nearby::Unknown, Nearby::Convex),
        [a, b, c] => Group::new(&[&[a], &[b], &[c]]).map_or(Nearby::Unknown, Nearby::Convex),
    };
    let mut cells = [Nearby::Unknown; CELLS_PER_BRICK];
    for (cell, faces) in cells.iter_mut().zip(&voxels.faces) {
        *cell = own(faces);
    }
    let mut crossed = voxels.faces.iter().filter(|faces| faces[0] != NO_FACE).map(own);
    if let Some(first) = crossed.next()
        && crossed.all(|other| other == first)
    {
        cells = [first; CELLS_PER_BRICK];
    }
    bricks::pack(&cells)
}

/// Whether the surface meets the cube of half edge `half` about `center`, boundary included. By bisection: a cube is rejected when the surface is
/// beyond its corners, and accepted when its centre's nearest point lies in it; cubes still undecided after `halvings` are accepted.
fn crosses(surface: &ExactSurface, center: DVec3, half: f64, halvings: u32, scratch: &mut Scratch) -> bool {
    let corner = half * 3f64.sqrt() * (1.0 + 1e-9);
    if surface.at_least(center, corner).is_none_or(|far| far > corner) {
        return false;
    }
    let Some(nearest) = surface.query(center, corner, scratch) else {
        return false;
    };
    if nearest.distance.abs() > corner {
        return false;
    }
    // Margin of a nanometre: planes that lie on a voxel's boundary belong to both sides regardless of rounding.
    if halvings == 0 || (nearest.point - center).abs().max_element() <= half + 1e-6 {
        return true;
    }
    let quarter = 0.5 * half;
    (0..8).any(|corner: u32| {
        let side = |axis: u32| {
            if corner >> axis & 1 == 0 {
                -quarter
            } else {
                quarter
            }
        };
        let child = center + DVec3::new(side(0), side(1), side(2));
        crosses(surface, child, quarter, halvings - 1, scratch)
    })
}

/// Coordinates in the brick of voxel `i`.
pub(crate) fn place(i: usize) -> [usize; 3] {
    [
        i % BRICK_CELLS,
        i / BRICK_CELLS % BRICK_CELLS,
        i / (BRICK_CELLS * BRICK_CELLS),
    ]
}

/// The voxels of brick `at`, with free ones within [`PROXIMITY_LAYERS`] of a surface voxel (corners included) marked as proximity.
fn with_proximity(
    grid: &Grid,
    places: &[Option<usize>],
    crossed: &[Voxels],
    at: [u32; 3],
    kinds: &[Voxel; CELLS_PER_BRICK],
) -> [Voxel; CELLS_PER_BRICK] {
    let layers = i64::from(PROXIMITY_LAYERS);
    let bricks = BRICK_CELLS as i64;
    let is_surface = |voxel: [i64; 3]| {
        let brick = voxel.map(|v| v.div_euclid(bricks));
        let outside = (0..3).any(|a| brick[a] < 0 || brick[a] >= i64::from(grid.dims[a]));
        if outside {
            return false;
        }
        let [x, y, z] = voxel.map(|v| v.rem_euclid(bricks) as usize);
        places[grid.index(brick.map(|b| b as u32))]
            .is_some_and(|i| crossed[i].kinds[x + BRICK_CELLS * (y + BRICK_CELLS * z)] == Voxel::Surface)
    };
    let mut out = *kinds;
    for (i, kind) in out.iter_mut().enumerate() {
        let own = place(i);
        let first = |axis: usize| i64::from(at[axis]) * bricks + own[axis] as i64;
        let around = |axis: usize| first(axis) - layers..=first(axis) + layers;
        if *kind == Voxel::Free
            && around(2).any(|z| around(1).any(|y| around(0).any(|x| is_surface([x, y, z]))))
        {
            *kind = Voxel::Proximity;
        }
    }
    out
}

/// Packs bricks into arrays and stores equal ones once; bricks of one uniform kind need no voxels.
fn pack(
    grid: &Grid,
    near: &NearSurface,
    kinds: &[[Voxel; CELLS_PER_BRICK]],
    crossed: &[Voxels],
) -> BakedField {
    let empty = |inside, cells| GridEntry::Empty { inside, cells }.to_bits();
    let mut grid_entries: Vec<u16> = near
        .classes
        .iter()
        .map(|class| match *class {
            // From the surface to the surface voxels: a voxel's diagonal.
            Class::Empty { inside, cells } => empty(inside, cells.saturating_sub(2)),
            Class::Stored => 0,
        })
        .collect();
    let mut bricks: Vec<BrickRecord> = Vec::new();
    let mut palette: Vec<u16> = Vec::new();
    let mut blob: Vec<u8> = Vec::new();
    let mut by_bytes: HashMap<Vec<u8>, u32> = HashMap::new();
    let mut by_palette: HashMap<Vec<u16>, u32> = HashMap::new();
    let mut by_record: HashMap<(u32, u32, u32, u8), u16> = HashMap::new();
    let mut sample_bytes = 0;
    let mut stored_entries = 0;
    for ((&at, kinds), voxels) in near.stored.iter().zip(kinds).zip(crossed) {
        let all = |kind| kinds.iter().all(|&k| k == kind);
        let entry = &mut grid_entries[grid.index(at)];
        if all(Voxel::Free) {
            *entry = empty(false, PROXIMITY_LAYERS as u16);
            continue;
        }
        if all(Voxel::Interior) {
            *entry = empty(true, 0);
            continue;
        }
        stored_entries += 1;
        let mut bytes = vec![0; VOXEL_BRICK_BYTES];
        for (i, &kind) in kinds.iter().enumerate() {
            bytes[i / 4] |= (kind as u8) << (2 * (i % 4));
        }
        let samples = *by_bytes.entry(bytes).or_insert_with_key(|bytes| {
            sample_bytes += bytes.len();
            append_aligned(&mut blob, bytes)
        });
        let named = named(voxels);
        let indices = if named.index_bits == 0 {
            0
        } else {
            *by_bytes
                .entry(named.indices)
                .or_insert_with_key(|bytes| append_aligned(&mut blob, bytes))
        };
        let palette_at = *by_palette.entry(named.palette).or_insert_with_key(|run| {
            palette.extend_from_slice(run);
            (palette.len() - run.len()) as u32
        });
        let record = (samples, indices, palette_at, named.index_bits);
        let number = *by_record.entry(record).or_insert_with(|| {
            bricks.push(BrickRecord {
                samples,
                indices,
                palette: palette_at,
                palette_len: named.palette_len,
                index_bits: named.index_bits,
                coarse: 0,
            });
            // Numbers past the limit wrap here; the caller rejects such a field.
            (bricks.len() - 1) as u16
        });
        *entry = GridEntry::Brick(number).to_bits();
    }
    BakedField {
        rough_mm: 0.0,
        finer_bricks: 0,
        groups: Vec::new(),
        record: FieldRecord {
            origin: grid.origin_m,
            cell: grid.cell_m,
            scale: grid.cell_m,
            band: PROXIMITY_LAYERS as f32 * grid.cell_m,
            brick_dims: grid.dims.map(|d| d as u16),
            format: FORMAT_OCCUPANCY,
            first_grid: 0,
            first_brick: 0,
            brick_count: bricks.len() as u32,
        },
        grid: grid_entries,
        sample_bytes,
        bricks,
        palette,
        patches: Vec::new(),
        free_form: FreeFormError::default(),
        blob,
        stored_entries,
        sign_disagreements: near.sign_disagreements,
        sign_tests: near.sign_tests,
        unproven_cells: 0,
        unproven_at: None,
    }
}
