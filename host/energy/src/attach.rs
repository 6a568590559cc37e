//! Energies in a scene image: appended behind all that it has, so that the rest keeps its bytes.

use std::mem::{offset_of, size_of};

use bytemuck::{bytes_of, cast_slice};
use mortise_protocol::image::{
    CRC, ChargeRecord, EnergyBlock, EnergyRecord, Header, ImageError, SceneImage, Section,
};

use crate::baked::BakedEnergy;

/// An energy and the parts of the image that it acts between.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Index of the moving part.
    pub moving: u16,
    /// Index of the fixed part.
    pub fixed: u16,
    /// The energy.
    pub energy: BakedEnergy,
}

/// Why an image cannot take energies.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// It is none, or the energies name parts that it does not have.
    #[error("the scene image cannot take the energies: {0}")]
    Image(#[from] ImageError),
    /// It has energies already.
    #[error("the scene image has energies already: bake it anew")]
    Present,
}

/// Bytes that these energies add to an image.
pub fn bytes(energies: &[Placed]) -> usize {
    let of = |placed: &Placed| {
        let energy = &placed.energy;
        size_of::<EnergyRecord>()
            + size_of_val(energy.charges.as_slice())
            + size_of_val(energy.nodes.as_slice())
    };
    size_of::<EnergyBlock>() + energies.iter().map(of).sum::<usize>().next_multiple_of(4)
}

/// The image with these energies.
///
/// # Errors
/// [`AttachError`]; an image is never half written.
pub fn attach(image: &[u8], energies: &[Placed]) -> Result<Vec<u8>, AttachError> {
    let mut header = *SceneImage::open(cast_slice(&aligned(image)))?.header();
    if header.energies != 0 {
        return Err(AttachError::Present);
    }
    let mut bytes = image[..header.length as usize].to_vec();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    header.energies = bytes.len() as u32;
    let (mut records, mut charges, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    for placed in energies {
        records.push(EnergyRecord {
            moving: placed.moving,
            fixed: placed.fixed,
            first_node: nodes.len() as u32,
            first_charge: charges.len() as u32,
            charge_count: placed.energy.charges.len() as u32,
            ..placed.energy.record
        });
        charges.extend_from_slice(&placed.energy.charges);
        nodes.extend_from_slice(&placed.energy.nodes);
    }
    let mut at = bytes.len() + size_of::<EnergyBlock>();
    let mut section = |count: usize, size: usize| {
        let section = Section {
            offset: at as u32,
            count: count as u32,
        };
        at += (count * size).next_multiple_of(4);
        section
    };
    let block = EnergyBlock {
        energies: section(records.len(), size_of::<EnergyRecord>()),
        charges: section(charges.len(), size_of::<ChargeRecord>()),
        nodes: section(nodes.len(), size_of::<[i8; 2]>()),
    };
    bytes.extend_from_slice(bytes_of(&block));
    for part in [
        cast_slice(&records),
        cast_slice(&charges),
        cast_slice::<_, u8>(&nodes),
    ] {
        bytes.extend_from_slice(part);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    }
    header.length = bytes.len() as u32;
    bytes[..size_of::<Header>()].copy_from_slice(bytes_of(&header));
    let crc = CRC.checksum(&bytes[20..]);
    let crc_at = offset_of!(Header, crc);
    bytes[crc_at..crc_at + 4].copy_from_slice(&crc.to_le_bytes());
    // Of the caller's part numbers nothing is known before.
    SceneImage::open(cast_slice(&aligned(&bytes)))?;
    Ok(bytes)
}

/// The bytes as words, aligned as a reader needs them; bytes beyond the last word are no image's.
fn aligned(bytes: &[u8]) -> Vec<u32> {
    bytes
        .chunks_exact(4)
        .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
        .collect()
}
