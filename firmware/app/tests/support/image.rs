//! The smallest scene images that pass every check.

use std::vec::Vec;

use bytemuck::{bytes_of, cast_slice};
use mortise_protocol::image::*;

/// A fixed part 0 and a grabbable part 1, both of an empty shape; `tag` makes images differ.
pub fn two_parts(tag: u8) -> Vec<u8> {
    parts(2, tag)
}

/// `count` parts, all but the first grabbable.
pub fn parts(count: usize, tag: u8) -> Vec<u8> {
    let parts: Vec<PartRecord> = (0..count)
        .map(|i| PartRecord {
            shape: 0,
            flags: if i == 0 { 0 } else { PART_GRABBABLE },
            position: [0.0, 0.0, f32::from(tag) * 1e-3],
            orientation: [0.0, 0.0, 0.0, 1.0],
        })
        .collect();
    let shape = ShapeRecord {
        radius: 0.01,
        volume: 1e-6,
        inertia: [1e-11, 1e-11, 1e-11, 0.0, 0.0, 0.0],
        ..Default::default()
    };
    let field = FieldRecord {
        cell: 1e-3,
        scale: 1e-5,
        band: 1e-3,
        brick_dims: [1, 1, 1],
        format: FORMAT_I8,
        ..Default::default()
    };
    let grid = GridEntry::Empty {
        inside: false,
        cells: 100,
    }
    .to_bits();
    let mut header = Header {
        magic: MAGIC,
        layout: LAYOUT_VERSION,
        ..Default::default()
    };
    let mut body = Vec::new();
    let mut section = |bytes: &[u8], count: usize| {
        let offset = (size_of::<Header>() + body.len()) as u32;
        body.extend_from_slice(bytes);
        body.resize(body.len().next_multiple_of(4), tag);
        Section {
            offset,
            count: count as u32,
        }
    };
    header.parts = section(cast_slice(&parts), count);
    header.shapes = section(bytes_of(&shape), 1);
    header.fields = section(bytes_of(&field), 1);
    header.nodes = section(&[], 0);
    header.points = section(&[], 0);
    header.faces = section(&[], 0);
    header.patches = section(&[], 0);
    header.bricks = section(&[], 0);
    header.palette = section(&[], 0);
    header.grid = section(bytes_of(&grid), 1);
    header.edges = section(&[], 0);
    header.spans = section(&[], 0);
    // Some bytes of its own, so that it spans sectors and does not end on a flash word.
    header.blob = section(&[tag; 1001], 1001);
    header.length = (size_of::<Header>() + body.len()) as u32;
    let mut bytes = bytes_of(&header).to_vec();
    bytes.extend_from_slice(&body);
    seal(&mut bytes);
    bytes
}

/// Sets the header's checksum.
pub fn seal(bytes: &mut [u8]) {
    let crc = CRC.checksum(&bytes[20..]);
    bytes[16..20].copy_from_slice(&crc.to_le_bytes());
}
