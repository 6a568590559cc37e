//! Geometric energies of an image: the golden bytes read back, and the density between nodes.

use crate::scene::{self, Aligned};
use mortise_protocol::image::*;
use proptest::prelude::*;

const GOLDEN: &[u8] = include_bytes!("golden/energy.scene");

#[test]
fn golden_energies_read_back() {
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let (records, charges, _) = scene::energies();
    assert_eq!(image.energy_count(), 2);
    let energy = image.energy(0).unwrap();
    assert_eq!((energy.record, energy.charges), (&records[0], charges.as_slice()));
    let none = image.energy(1).unwrap();
    assert_eq!((none.record, none.charges.len()), (&records[1], 0));
    assert_eq!(none.at([0.0; 3], [1.0, 0.0]).unwrap().0, -128.0);
    assert!(image.energy(2).is_none());
}

/// An image without energies has none, and its other bytes are those of the image that has them, but for length, checksum and place.
#[test]
fn energies_leave_the_rest_of_an_image_alone() {
    let without = scene::bytes();
    let aligned = Aligned::new(&without);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    assert_eq!((image.header().energies, image.energy_count()), (0, 0));
    assert!(image.energy(0).is_none());
    assert_eq!(GOLDEN[..12], without[..12]);
    assert_eq!(GOLDEN[24..without.len()], without[24..]);
}

/// Density at a place (steps) by the definition, in double precision: each node weighted by one less its distances. `None` beyond the lattice.
fn by_hand(place: [f64; 3]) -> Option<[f64; 2]> {
    let (records, _, nodes) = scene::energies();
    let size = records[0].size.map(usize::from);
    if (0..3).any(|a| !(0.0..(size[a] - 1) as f64).contains(&place[a])) {
        return None;
    }
    let mut sum = [0.0; 2];
    for (i, node) in nodes.iter().enumerate() {
        let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
        let weight: f64 = (0..3)
            .map(|a| (1.0 - (place[a] - at[a] as f64).abs()).max(0.0))
            .product();
        sum = [0, 1].map(|k| sum[k] + weight * f64::from(node[k]));
    }
    Some(sum)
}

#[test]
fn the_density_between_nodes_is_trilinear_and_ends_with_the_lattice() {
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let energy = image.energy(0).unwrap();
    for place in [
        [0.0, 0.0, 0.0],
        [0.5, 0.5, 0.5],
        [1.0, 0.0, 0.0],
        [2.25, 1.75, 0.125],
        [2.9, 0.1, 0.95],
        [0.0, 1.5, 0.999],
    ] {
        let [re, im] = by_hand(place).unwrap();
        for charge in [[1.0f32, 0.0], [0.0, 1.0], [0.3, -0.7]] {
            let (value, _) = energy.at(place.map(|x| x as f32), charge).unwrap();
            let wanted = re * f64::from(charge[0]) - im * f64::from(charge[1]);
            assert!(
                (f64::from(value) - wanted).abs() < 1e-4,
                "{value} {wanted} at {place:?}"
            );
        }
    }
    // The last layers belong to no cell.
    for axis in 0..3 {
        let last = f32::from(energy.record.size[axis] - 1);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN];
        for beyond in [last, last + 0.5, 65_536.0, 4.3e9, -1e-6, -1.0]
            .into_iter()
            .chain(odd)
        {
            let mut place = [0.25; 3];
            place[axis] = beyond;
            assert!(energy.at(place, [1.0, 1.0]).is_none(), "{place:?}");
        }
    }
    assert!(
        energy
            .at([0.25; 3], [0.0, 0.0])
            .is_some_and(|(value, _)| value == 0.0)
    );
}

/// What makes an energy gets the same answers outside of an image, and none for a lattice of another size.
#[test]
fn an_energy_outside_of_an_image_is_the_same() {
    let (records, charges, nodes) = scene::energies();
    let aligned = Aligned::new(GOLDEN);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let (inside, outside) = (
        image.energy(0).unwrap(),
        Energy::new(&records[0], &charges, &nodes),
    );
    let place = [1.3, 0.4, 0.7];
    assert_eq!(
        inside.at(place, [1.0, 2.0]),
        outside.unwrap().at(place, [1.0, 2.0])
    );
    assert!(Energy::new(&records[0], &charges, &nodes[1..]).is_none());
    assert!(Energy::new(&records[1], &[], &nodes).is_none());
    let bent = EnergyRecord {
        way: [0.0; 3],
        ..records[0]
    };
    assert!(Energy::new(&bent, &charges, &nodes).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Along an axis within a cell the value is linear, so the difference over any step is the slope up to rounding: 2⁻²² of 255 units over 0.25.
    #[test]
    fn the_slope_is_the_derivative_within_a_cell(
        cell in (0usize..3, 0usize..2, 0usize..1),
        inside in prop::array::uniform3(0.0f32..0.5),
        axis in 0usize..3,
        step in 0.25f32..0.4999,
        charge in prop::array::uniform2(-1.0f32..1.0),
    ) {
        let aligned = Aligned::new(GOLDEN);
        let image = SceneImage::open(aligned.bytes()).unwrap();
        let energy = image.energy(0).unwrap();
        let cell = [cell.0, cell.1, cell.2];
        let from: [f32; 3] = core::array::from_fn(|a| cell[a] as f32 + inside[a]);
        let mut to = from;
        to[axis] += step;
        let (before, slope) = energy.at(from, charge).unwrap();
        let (after, _) = energy.at(to, charge).unwrap();
        let derivative = (after - before) / (to[axis] - from[axis]);
        prop_assert!((derivative - slope[axis]).abs() < 2e-3, "{derivative} {slope:?}");
        let [re, im] = by_hand(from.map(f64::from)).unwrap();
        let wanted = re * f64::from(charge[0]) - im * f64::from(charge[1]);
        prop_assert!((f64::from(before) - wanted).abs() < 2e-4, "{before} {wanted}");
    }
}
