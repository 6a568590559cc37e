//! Geometric energies in the user's cache folder: their bytes, and the name under which those of a fit are found again. Pure.

use bytemuck::{bytes_of, cast_slice, pod_collect_to_vec, pod_read_unaligned};
use mortise_energy::BakedEnergy;
use mortise_fit::Fit;
use mortise_protocol::image::{ChargeRecord, Energy, EnergyRecord};
use sha2::{Digest as _, Sha256};

use super::document::{Document, digits};

/// Name of the energy of a part in a fit: all that it depends on. `None` where the contents of the file are not known.
pub fn name(document: &Document, moving: usize, against: usize, fit: &Fit) -> Option<String> {
    if document.sha256.is_empty() {
        return None;
    }
    let groups = [moving, against].map(|part| document.groups().of(part));
    let of = format!("{} {moving} {against} {groups:?} {fit:?}", document.sha256);
    Some(format!("energy-{}", digits(Sha256::new_with_prefix(of))))
}

/// The bytes of an energy.
pub fn to_bytes(energy: &BakedEnergy) -> Vec<u8> {
    let mut bytes = bytes_of(&energy.record).to_vec();
    bytes.extend(energy.deviation.to_le_bytes());
    bytes.extend((energy.charges.len() as u32).to_le_bytes());
    bytes.extend_from_slice(cast_slice(&energy.charges));
    bytes.extend_from_slice(cast_slice(&energy.nodes));
    bytes
}

/// The energy with these bytes; `None` where they are no usable one's.
pub fn from_bytes(bytes: &[u8]) -> Option<BakedEnergy> {
    let (record, rest) = bytes.split_at_checked(size_of::<EnergyRecord>())?;
    let (deviation, rest) = rest.split_first_chunk::<8>()?;
    let (count, rest) = rest.split_first_chunk::<4>()?;
    let count = (u32::from_le_bytes(*count) as usize).checked_mul(size_of::<ChargeRecord>())?;
    let (charges, nodes) = rest.split_at_checked(count)?;
    let energy = BakedEnergy {
        record: pod_read_unaligned(record),
        charges: pod_collect_to_vec(charges),
        nodes: nodes
            .chunks_exact(2)
            .map(|node| [node[0] as i8, node[1] as i8])
            .collect(),
        deviation: f64::from_le_bytes(*deviation),
    };
    let is_usable = Energy::new(&energy.record, &energy.charges, &energy.nodes).is_some();
    (is_usable && nodes.len().is_multiple_of(2)).then_some(energy)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use glam::DAffine3;
    use mortise_fit::Clearance;

    use super::*;

    fn energy() -> BakedEnergy {
        BakedEnergy {
            record: EnergyRecord {
                step: 1e-3,
                size: [2, 3, 4],
                largest_force: 90.0,
                way: [0.0, 0.0, -1.0],
                ..EnergyRecord::default()
            },
            charges: (0..5)
                .map(|i| ChargeRecord {
                    at: [i as f32, 0.5, -1.0],
                    charge: [0.25, i as f32],
                })
                .collect(),
            nodes: (0..24).map(|i| [i - 12, 3 * i]).collect(),
            deviation: 0.07,
        }
    }

    #[test]
    fn an_energy_comes_back_from_its_bytes() {
        let energy = energy();
        let back = from_bytes(&to_bytes(&energy)).expect("its own bytes");
        assert_eq!(
            (back.record, back.charges, back.nodes, back.deviation),
            (energy.record, energy.charges, energy.nodes, energy.deviation)
        );
    }

    #[test]
    fn bytes_of_another_length_are_no_energy() {
        let whole = to_bytes(&energy());
        for length in 0..whole.len() {
            assert!(from_bytes(&whole[..length]).is_none(), "{length} bytes");
        }
        let longer: Vec<u8> = whole.iter().chain(&[1, 2]).copied().collect();
        assert!(from_bytes(&longer).is_none());
    }

    #[test]
    fn the_name_differs_by_file_parts_and_fit() {
        let mut document = Document::sample(0, &|_| ControlFlow::Continue(())).expect("the sample");
        let fit = |z: f64| Fit {
            placement: DAffine3::from_translation(glam::DVec3::new(0.0, 0.0, z)),
            score: 0.5,
            area_mm2: 1.0,
            clearance: Clearance {
                min_mm: 0.0,
                median_mm: 0.0,
                max_mm: 0.0,
            },
            residual_mm: 0.0,
            freedom: 1,
            faces: Vec::new(),
            path: None,
        };
        let name_of = |document: &Document, parts: [usize; 2], z: f64| {
            name(document, parts[0], parts[1], &fit(z)).expect("a file with contents")
        };
        let first = name_of(&document, [1, 0], 1.0);
        assert_eq!(first, name_of(&document, [1, 0], 1.0));
        assert_ne!(first, name_of(&document, [0, 1], 1.0));
        assert_ne!(first, name_of(&document, [1, 0], 1.1));
        document.sha256.push('0');
        assert_ne!(first, name_of(&document, [1, 0], 1.0));
        document.sha256.clear();
        assert_eq!(name(&document, 1, 0, &fit(1.0)), None);
    }
}
