//! Written images open; damaged ones are rejected or harmless, for any damage, even with a valid checksum.

use std::ops::ControlFlow;

use crate::common::*;
use glam::DAffine3;
use mortise_bake::{BakeOptions, SampleFormat, bake};
use mortise_protocol::image::{CRC, Lookup, SceneImage};
use proptest::prelude::*;

/// Queries points all over every shape of an image.
fn look_everywhere(image: &SceneImage<'_>) {
    for i in 0..image.parts().len() {
        let shape = image.shape_of_part(i);
        let record = *shape.field.record();
        for k in 0..200u16 {
            let p = core::array::from_fn(|axis| {
                let turn = [0.819_172_5f32, 0.671_043_6, 0.549_700_5][axis] * f32::from(k);
                record.origin[axis]
                    + record.cell * (turn.fract() * 9.0 * f32::from(record.brick_dims[axis]) - 1.0)
            });
            if let Lookup::Near(s) = shape.field.lookup(p) {
                assert!(s.distance.is_finite());
            }
            assert!(!shape.field.bound(p).is_nan());
        }
        for p in shape.points {
            let _ = shape.faces[usize::from(p.face)];
        }
        let mut node = 0;
        while node < shape.nodes.len() {
            let n = &shape.nodes[node];
            let _ = &shape.points[n.first_point as usize..][..n.point_count as usize];
            node = n.skip as usize;
        }
    }
}

thread_local! {
    static IMAGE: Vec<u8> = {
        let parts = model(vec![
            ("block", block_with_hole([12.0, 12.0], 10.0, 4.0, 16), DAffine3::IDENTITY),
            ("ball", sphere(3.9, 12), DAffine3::IDENTITY),
        ]);
        let options = BakeOptions {
            cell_mm: Some(1.5),
            epsilon_mm: Some(0.2),
            format: SampleFormat::Int8,
            ..BakeOptions::default()
        };
        bake(&parts, &options, &|_| ControlFlow::Continue(())).unwrap().image
    };
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn damage_is_refused_or_harmless(
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u32>(), 0..4usize), 1..5),
        seal in prop::bool::weighted(0.8),
    ) {
        IMAGE.with(|good| {
            let mut bytes = good.clone();
            // The records precede the samples; most damage is placed there.
            let records = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
            for (at, value, kind) in &hits {
                let range = if *kind == 0 { bytes.len() } else { records };
                let at = (20 + at.index(range - 24)) & !3;
                match kind {
                    0 | 1 => bytes[at] ^= 1 << (value % 8),
                    2 => bytes[at..at + 4].copy_from_slice(&value.to_le_bytes()),
                    _ => bytes[at..at + 2].copy_from_slice(&(*value as u16).to_le_bytes()),
                }
            }
            let changed = bytes != *good;
            if seal {
                let crc = CRC.checksum(&bytes[20..]);
                bytes[16..20].copy_from_slice(&crc.to_le_bytes());
            }
            let aligned = AlignedBytes::new(&bytes);
            match SceneImage::open(aligned.bytes()) {
                Ok(image) => {
                    prop_assert!(seal || !changed);
                    look_everywhere(&image);
                }
                Err(error) => prop_assert!(!error.to_string().contains('\n')),
            }
            Ok(())
        })?;
    }
}

#[test]
fn the_writers_image_opens() {
    IMAGE.with(|good| {
        let aligned = AlignedBytes::new(good);
        look_everywhere(&SceneImage::open(aligned.bytes()).unwrap());
    });
}
