//! The scene image's reader: for any bytes, opening refuses the image or every access stays inside, and every distance is a number.
//!
//! The checksum is made valid, because a faulty or hostile writer also writes a valid one.
#![no_main]

use std::ops::Range;

use libfuzzer_sys::fuzz_target;
use mortise_protocol::image::{CRC, Lookup, NO_FACE, SceneImage, oct_decode};

fuzz_target!(|data: &[u8]| {
    let mut words = vec![0u32; data.len() / 4];
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
    let length = bytes.len();
    bytes.copy_from_slice(&data[..length]);
    seal(bytes);
    if let Ok(image) = SceneImage::open(bytes) {
        use_everything(&image);
    }
});

/// Sets the correct length and checksum.
fn seal(bytes: &mut [u8]) {
    let length = bytes.len() as u32;
    if let Some(place) = bytes.get_mut(LENGTH).filter(|_| length >= 20) {
        place.copy_from_slice(&length.to_le_bytes());
        let crc = CRC.checksum(&bytes[CRC_AT.end..]);
        bytes[CRC_AT].copy_from_slice(&crc.to_le_bytes());
    }
}

/// Offset of the length in the header, after magic and layout.
const LENGTH: Range<usize> = 12..16;
const CRC_AT: Range<usize> = 16..20;

fn use_everything(image: &SceneImage<'_>) {
    for i in 0..image.parts().len() {
        let _ = image.shape_of_part(i).record.radius;
    }
    for i in 0..image.shape_count() {
        let shape = image.shape(i);
        let mut node = 0;
        // Both paths through the tree: into each node, and past it.
        while let Some(n) = shape.nodes.get(node) {
            for p in &shape.points[n.first_point as usize..][..n.point_count as usize] {
                let _ = shape.faces[usize::from(p.face)].sense;
                if p.edge_face != NO_FACE {
                    let _ = shape.faces[usize::from(p.edge_face)].sense;
                }
                let _ = oct_decode(p.normal);
            }
            assert!(n.skip as usize > node, "a walk must end");
            node += 1;
        }
        let record = *shape.field.record();
        for step in 0..64u32 {
            let p = core::array::from_fn(|axis| {
                let cells = f32::from(record.brick_dims[axis]) * 8.0;
                let part = (step >> (2 * axis) & 3) as f32 / 3.0;
                record.origin[axis] + record.cell * (part * (cells + 2.0) - 1.0)
            });
            match shape.field.lookup(p) {
                Lookup::Near(s) => {
                    assert!(s.distance.is_finite() && s.gradient.iter().all(|g| g.is_finite()));
                }
                Lookup::Far { bound, .. } => assert!(!bound.is_nan()),
            }
            let _ = shape.field.voxel(p);
        }
    }
}
