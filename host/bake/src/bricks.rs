//! One brick: 9³ exact samples and the nearest face of each of its 8³ cells.

use glam::DVec3;
use mortise_protocol::image::{BRICK_CELLS, BRICK_SAMPLES, CELLS_PER_BRICK, NO_FACE};

use crate::distance::{ExactSurface, Scratch};
use crate::field::{FieldOptions, SampleFormat, brick_bytes};
use crate::grid::Grid;

/// A brick before it is placed in the image.
pub(crate) struct Brick {
    /// Samples as stored, x fastest.
    pub samples: Vec<u8>,
    /// 0, 4 or 8.
    pub index_bits: u16,
    /// Palette indices as stored; empty for 0 bits.
    pub indices: Vec<u8>,
    /// Faces, ascending.
    pub palette: Vec<u16>,
}

/// Samples brick `at` of `grid`.
pub(crate) fn bake_brick(surface: &ExactSurface, grid: &Grid, options: &FieldOptions, at: [u32; 3]) -> Brick {
    let mut scratch = Scratch::default();
    let units_per_mm = options.units_per_cell() / grid.cell();
    let mut samples = Vec::with_capacity(brick_bytes(options.format));
    let mut faces = [NO_FACE; BRICK_SAMPLES * BRICK_SAMPLES * BRICK_SAMPLES];
    let mut within = f64::INFINITY;
    let mut i = 0;
    for z in 0..BRICK_SAMPLES {
        for y in 0..BRICK_SAMPLES {
            for x in 0..BRICK_SAMPLES {
                let p = grid.sample(at, [x, y, z]);
                let mut value = options.format.max();
                if let Some(nearest) = surface.query(p, within, &mut scratch) {
                    value = quantise(nearest.distance * units_per_mm, options.format);
                    faces[i] = nearest.face as u16;
                    // The next sample along x is one cell away; a new row starts afresh.
                    within = if x + 1 < BRICK_SAMPLES {
                        nearest.distance.abs() + grid.cell() * (1.0 + 1e-9)
                    } else {
                        f64::INFINITY
                    };
                }
                match options.format {
                    SampleFormat::Int8 => samples.push(value as i8 as u8),
                    SampleFormat::Int16 => samples.extend((value as i16).to_le_bytes()),
                }
                i += 1;
            }
        }
    }
    let cells = cell_faces(surface, grid, at, &faces, &mut scratch);
    let (palette, index_bits, indices) = pack_faces(&cells);
    Brick {
        samples,
        index_bits,
        indices,
        palette,
    }
}

/// Rounds to the format's range, halves away from zero. A hundred-thousandth of a unit is rounded off first, so that the same distance
/// computed at another place (off by rounding, far less than that) gives the same sample.
fn quantise(units: f64, format: SampleFormat) -> f64 {
    let snapped = (units * 1e5).round() / 1e5;
    snapped.round().clamp(-format.max(), format.max())
}

/// Nearest face of each cell: that of its corners where they agree, else that of its centre.
fn cell_faces(
    surface: &ExactSurface,
    grid: &Grid,
    at: [u32; 3],
    samples: &[u16],
    scratch: &mut Scratch,
) -> [u16; CELLS_PER_BRICK] {
    let mut cells = [NO_FACE; CELLS_PER_BRICK];
    let mut i = 0;
    for z in 0..BRICK_CELLS {
        for y in 0..BRICK_CELLS {
            for x in 0..BRICK_CELLS {
                let corner = |c: usize| {
                    let (x, y, z) = (x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
                    samples[x + BRICK_SAMPLES * (y + BRICK_SAMPLES * z)]
                };
                let first = corner(0);
                cells[i] = if (1..8).all(|c| corner(c) == first) {
                    first
                } else {
                    let center = grid.sample(at, [x, y, z]) + DVec3::splat(grid.cell() / 2.0);
                    surface
                        .query(center, f64::INFINITY, scratch)
                        .map_or(NO_FACE, |n| n.face as u16)
                };
                i += 1;
            }
        }
    }
    cells
}

/// Palette, bits and packed indices. More than 256 faces in one brick: the most frequent 255 keep theirs, the others become
/// [`NO_FACE`].
fn pack_faces(cells: &[u16; CELLS_PER_BRICK]) -> (Vec<u16>, u16, Vec<u8>) {
    let mut palette = cells.to_vec();
    palette.sort_unstable();
    palette.dedup();
    if palette.len() > 256 {
        let count = |face: u16| cells.iter().filter(|&&c| c == face).count();
        palette.sort_by_key(|&face| (std::cmp::Reverse(count(face)), face));
        palette.truncate(255);
        palette.push(NO_FACE);
        palette.sort_unstable();
        palette.dedup();
    }
    let index = |face: u16| palette.binary_search(&face).unwrap_or(palette.len() - 1) as u8;
    match palette.len() {
        0 | 1 => (palette, 0, Vec::new()),
        2..=16 => {
            let indices = cells
                .chunks_exact(2)
                .map(|pair| index(pair[0]) | index(pair[1]) << 4)
                .collect();
            (palette, 4, indices)
        }
        _ => {
            let indices = cells.iter().map(|&face| index(face)).collect();
            (palette, 8, indices)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_faces_keep_the_frequent_ones() {
        let mut cells = [0u16; CELLS_PER_BRICK];
        for (i, c) in cells.iter_mut().enumerate() {
            *c = if i < 200 { 7 } else { 1000 + i as u16 };
        }
        let (palette, bits, indices) = pack_faces(&cells);
        assert_eq!((palette.len(), bits, indices.len()), (256, 8, 512));
        assert_eq!(palette[usize::from(indices[0])], 7);
        assert_eq!(palette[usize::from(indices[511])], NO_FACE);
    }

    #[test]
    fn four_bits_put_the_first_cell_low() {
        let mut cells = [3u16; CELLS_PER_BRICK];
        cells[1] = 9;
        let (palette, bits, indices) = pack_faces(&cells);
        assert_eq!((palette, bits), (vec![3, 9], 4));
        assert_eq!((indices.len(), indices[0], indices[1]), (256, 0x10, 0));
    }
}
