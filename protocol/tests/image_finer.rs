//! Finer bricks: the distance in them, and what an image with wrong ones is refused for.

use crate::scene::{self, Aligned};
use mortise_protocol::image::*;

/// The distance to a plane is interpolated exactly, but for rounding: half a unit of the level's samples, in a coarse brick half of 256 units.
#[test]
fn every_level_gives_the_distance() {
    let aligned = Aligned::new(&scene::finer_bytes());
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let field = image.shape(0).field;
    let unit = 1e-3 / 4096.0;
    let mut seen = [0; 3];
    for i in 0..20_000 {
        let r = |step: f32| (i as f32 * step).fract();
        // All over the grid, over the finer brick, and over the one in it.
        let (low, edge) = [
            ([0.0; 3], 8.0),
            ([3.0, 2.0, 2.0], 1.0),
            ([3.875, 2.0, 2.25], 0.125),
        ][i % 3];
        let at: [f32; 3] = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(r);
        let p: [f32; 3] = std::array::from_fn(|a| (low[a] + at[a] * edge * 0.999) * 1e-3);
        let Place::Cell(cell) = field.place(p) else {
            panic!("{p:?} is in the grid");
        };
        let level = (1.0 / cell.scale()).log(8.0).round() as usize;
        seen[level] += 1;
        let Lookup::Near(found) = field.lookup(p) else {
            panic!("{p:?} is in a brick");
        };
        let error = [0.5 * unit, 128.0 * unit / 8.0, 0.5 * unit / 64.0][level] + 2e-9;
        let exact = p[2] - 0.0023;
        if exact.abs() < 7e-3 * cell.scale() {
            assert!(
                (found.distance - exact).abs() <= error,
                "{p:?}: {found:?}, {exact}"
            );
            // Two samples are a cell apart.
            let slope = 2.0 * error / (1e-3 * cell.scale());
            assert!((found.gradient[2] - 1.0).abs() <= slope, "{p:?}: {found:?}");
        }
        assert_eq!(found.nearby, Nearby::Roughly(0));
    }
    assert!(seen.iter().all(|&count| count > 4000), "{seen:?}");
}

#[test]
fn a_finer_brick_has_a_smaller_number_and_is_whole() {
    let good = scene::finer_bytes();
    let aligned = Aligned::new(&good);
    let header = *SceneImage::open(aligned.bytes()).unwrap().header();
    let number = |palette: usize| header.palette.offset as usize + 2 * (1 + 3 * palette + 2);
    let brick = |index: usize| header.bricks.offset as usize + index * size_of::<BrickRecord>();
    let refused = |change: &dyn Fn(&mut [u8])| {
        let mut other = Aligned::new(&good);
        change(other.bytes_mut());
        other.seal();
        SceneImage::open(other.bytes()).is_err()
    };
    assert!(!refused(&|_| {}));
    // In the coarsest brick any smaller one may stand; in the middle one only the finest.
    assert!(!refused(&|bytes| bytes[number(1)] = 0));
    for wrong in [1, 2, 3] {
        assert!(refused(&|bytes| bytes[number(0)] = wrong), "{wrong}");
    }
    assert!(refused(&|bytes| bytes[number(1)] = 2));
    assert!(refused(&|bytes| bytes[number(1) + 1] = 0x80));
    // Coarse is 0 or 1, in 16 bits only.
    assert!(refused(&|bytes| bytes[brick(1) + 15] = 2));
    assert!(refused(
        &|bytes| bytes[header.fields.offset as usize + 30] = FORMAT_I8 as u8
    ));
}

/// An index beyond the palette's entries may meet any words: more levels than there can be, numbers of no brick. The query stays in the image and ends.
#[test]
fn any_words_end() {
    let good = scene::finer_bytes();
    let aligned = Aligned::new(&good);
    let header = *SceneImage::open(aligned.bytes()).unwrap().header();
    let words = header.palette.offset as usize..;
    for seed in 0..2000u32 {
        let mut other = Aligned::new(&good);
        // The words of the last palette; those of its entries stay.
        let own = &mut other.bytes_mut()[words.clone()][2 * 6..2 * 22];
        let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
        for word in own.chunks_exact_mut(2) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let finer = Nearby::finer_bits((state >> 20 & 15) as u16);
            let bits = [
                finer,
                0x8000 | (state >> 20 & 15) as u16,
                (state >> 16 & 7) as u16,
                NO_FACE,
            ];
            word.copy_from_slice(&bits[(state >> 28 & 3) as usize].to_le_bytes());
        }
        let indices = header.blob.offset as usize;
        let all = other.bytes_mut();
        let end = indices + header.blob.count as usize;
        all[end - CELLS_PER_BRICK / 2..end].fill(seed as u8);
        other.seal();
        if let Ok(image) = SceneImage::open(other.bytes()) {
            let field = image.shape(0).field;
            for i in 0..64 {
                let p = [i & 3, i >> 2 & 3, i >> 4].map(|k| k as f32 * 2.3e-3);
                let _ = (field.lookup(p), field.bound(p));
            }
        }
    }
}
