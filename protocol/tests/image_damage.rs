//! For any bytes, opening an image either refuses them or makes every access in bounds.

use crate::scene::{self, Aligned};
use mortise_protocol::image::*;

/// xorshift64*: the same damage in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Accesses everything that an image gives access to; returns a value that depends on all of it.
fn use_everything(image: &SceneImage<'_>, random: &mut Random) -> f32 {
    let mut sum = 0.0;
    for i in 0..image.parts().len() {
        sum += image.shape_of_part(i).record.radius;
    }
    for i in 0..image.shape_count() {
        let shape = image.shape(i);
        let mut node = 0;
        while node < shape.nodes.len() {
            let n = &shape.nodes[node];
            for p in &shape.points[n.first_point as usize..][..n.point_count as usize] {
                sum += shape.faces[usize::from(p.face)].sense;
                if p.edge_face != NO_FACE {
                    sum += shape.faces[usize::from(p.edge_face)].sense;
                }
                sum += oct_decode(p.normal)[0];
                if p.span != NO_SPAN {
                    sum += shape.spans[usize::from(p.span)].round;
                }
            }
            node = if random.below(2) == 0 {
                node + 1
            } else {
                n.skip as usize
            };
        }
        let record = *shape.field.record();
        for _ in 0..40 {
            let p = core::array::from_fn(|axis| {
                let cells = f32::from(record.brick_dims[axis]) * 8.0;
                let u = random.below(1 << 16) as f32 / 65536.0;
                record.origin[axis] + record.cell * (u * (cells + 2.0) - 1.0)
            });
            match shape.field.lookup(p) {
                Lookup::Near(s) => {
                    assert!(
                        s.distance.is_finite() && s.gradient.iter().all(|g| g.is_finite()),
                        "{s:?}"
                    );
                    sum += s.distance + f32::from(s.face);
                }
                Lookup::Far { bound, .. } => {
                    assert!(!bound.is_nan());
                    sum += shape.field.bound(p);
                }
            }
            let voxel = shape.field.voxel(p);
            assert!(
                !voxel.bound.is_nan() && voxel.center.iter().zip(p).all(|(c, p)| !c.is_nan() || p.is_nan())
            );
            sum += voxel.bound + f32::from(voxel.faces[0]);
        }
    }
    assert!(image.energy(image.energy_count()).is_none());
    for i in 0..image.energy_count() {
        let energy = image.energy(i).expect("counted");
        let record = energy.record;
        for part in [record.moving, record.fixed] {
            sum += image.shape_of_part(usize::from(part)).record.radius;
        }
        for k in 0..40 {
            let charge = energy.charges.get(k).map_or([1.0, -0.5], |c| c.charge);
            // Out to a step beyond the lattice on all sides, and on nodes.
            let place = record.size.map(|n| {
                let at = random.below(1 << 16) as f32 / 65536.0 * (f32::from(n) + 1.0) - 1.0;
                if k % 4 == 0 { at.round() } else { at }
            });
            if let Some((value, slope)) = energy.at(place, charge) {
                let most = 256.0 * (charge[0].abs() + charge[1].abs());
                assert!(value.abs() <= most || !most.is_finite(), "{value} at {place:?}");
                sum += value + slope[0] + slope[1] + slope[2];
            }
        }
    }
    sum
}

/// Damage that the checksum detects is refused.
#[test]
fn damage_is_refused() {
    for good in [scene::bytes(), scene::energy_bytes()] {
        damage(&good);
    }
}

fn damage(good: &[u8]) {
    let mut random = Random(1);
    for _ in 0..20_000 {
        let mut aligned = Aligned::new(good);
        let at = random.below(good.len());
        aligned.bytes_mut()[at] ^= 1 << random.below(8);
        assert!(SceneImage::open(aligned.bytes()).is_err(), "byte {at}");
    }
    for length in 0..good.len() {
        let aligned = Aligned::new(&good[..length]);
        assert!(SceneImage::open(aligned.bytes()).is_err(), "cut to {length}");
    }
}

/// Damage with a valid checksum (a faulty or hostile writer) is refused, or harmless.
#[test]
fn sealed_damage_never_leads_out_of_bounds() {
    sealed_damage(&scene::bytes());
    sealed_damage(&scene::occupancy_bytes());
}

fn sealed_damage(good: &[u8]) {
    let records = {
        let aligned = Aligned::new(good);
        let image = SceneImage::open(aligned.bytes()).unwrap();
        image.header().blob.offset as usize
    };
    let mut random = Random(2);
    let (mut opened, mut refused) = (0, 0);
    let mut sum = 0.0;
    for round in 0..60_000 {
        let mut aligned = Aligned::new(good);
        for _ in 0..=random.below(4) {
            // Mostly records: samples may be anything.
            let range = if random.below(10) == 0 {
                good.len()
            } else {
                records
            };
            let at = 20 + random.below(range - 20);
            let bytes = aligned.bytes_mut();
            match round % 3 {
                0 => bytes[at] ^= 1 << random.below(8),
                1 => bytes[at] = random.next() as u8,
                _ => {
                    let at = at & !3;
                    let odd =
                        [0, 1, 0x7fff_ffff, u32::MAX, 0x7f80_0000, 0x0000_ffff, 0x8000_0000][random.below(7)];
                    bytes[at..at + 4].copy_from_slice(&odd.to_le_bytes());
                }
            }
        }
        aligned.seal();
        match SceneImage::open(aligned.bytes()) {
            Ok(image) => {
                opened += 1;
                sum += use_everything(&image, &mut random);
            }
            Err(_) => refused += 1,
        }
    }
    // Both outcomes occur.
    assert!(
        opened > 1000 && refused > 1000,
        "{opened} opened, {refused} refused, {sum}"
    );
}

/// Every byte of what leads to the energies, and of them, in turn with every value.
#[test]
fn sealed_damage_of_energies_never_leads_out_of_bounds() {
    let good = scene::energy_bytes();
    let at = Aligned::new(&good);
    let image = SceneImage::open(at.bytes()).unwrap();
    let energies = image.header().energies as usize;
    let mut random = Random(3);
    let (mut opened, mut refused, mut sum) = (0, 0, 0.0);
    for place in (20..24).chain(energies..good.len()) {
        for value in 0..=u8::MAX {
            let mut aligned = Aligned::new(&good);
            aligned.bytes_mut()[place] = value;
            aligned.seal();
            match SceneImage::open(aligned.bytes()) {
                Ok(image) => {
                    opened += 1;
                    sum += use_everything(&image, &mut random);
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(
        opened > 10_000 && refused > 10_000,
        "{opened} opened, {refused} refused, {sum}"
    );
}

/// An energy that names no such part, charge or node, or has a number that is none, is refused.
#[test]
fn energies_that_lead_nowhere_are_refused() {
    let records = scene::energies().0;
    let good = scene::energy_bytes();
    let aligned = Aligned::new(&good);
    let block = SceneImage::open(aligned.bytes()).unwrap().header().energies as usize;
    let first = block + size_of::<EnergyBlock>();
    let refused = |change: &dyn Fn(&mut EnergyRecord)| {
        let mut record = records[0];
        change(&mut record);
        let mut other = Aligned::new(&good);
        other.bytes_mut()[first..first + size_of::<EnergyRecord>()]
            .copy_from_slice(bytemuck::bytes_of(&record));
        other.seal();
        match SceneImage::open(other.bytes()) {
            Ok(_) => false,
            Err(error) => {
                error
                    == ImageError::Record {
                        section: 13,
                        index: 0,
                    }
            }
        }
    };
    assert!(!refused(&|_| {}));
    assert!(refused(&|r| r.moving = 3) && refused(&|r| r.fixed = 3) && refused(&|r| r.fixed = r.moving));
    assert!(refused(&|r| r.first_charge = 1) && refused(&|r| r.charge_count = u32::MAX));
    assert!(refused(&|r| r.first_node = 1) && refused(&|r| r.size = [5, 3, 2]));
    assert!(refused(&|r| r.size = [u16::MAX; 3]) && refused(&|r| r.size = [24, 1, 1]));
    for bad in [f32::NAN, f32::INFINITY, 0.0, -0.002, f32::from_bits(1)] {
        assert!(
            refused(&|r| r.step = bad) && refused(&|r| r.largest_force = bad),
            "{bad}"
        );
    }
    for bad in [f32::NAN, f32::INFINITY, -1.0] {
        assert!(
            refused(&|r| r.across[7] = bad) && refused(&|r| r.along[0] = bad),
            "{bad}"
        );
        assert!(refused(&|r| r.turning[3] = bad), "{bad}");
    }
    assert!(refused(&|r| r.origin[1] = f32::NAN) && refused(&|r| r.way = [0.0, 0.6, 0.81]));
    // The block itself: within the header, beyond the end, at no multiple of 4.
    for at in [4, good.len() as u32 - 20, u32::MAX - 3, block as u32 + 2] {
        let mut other = Aligned::new(&good);
        other.bytes_mut()[20..24].copy_from_slice(&at.to_le_bytes());
        other.seal();
        let error = SceneImage::open(other.bytes()).unwrap_err();
        assert_eq!(error, ImageError::Section { section: 13 }, "{at}");
    }
}

/// A brick without samples is opened only where every cell names a surface that gives the distance.
#[test]
fn a_brick_without_samples_needs_surfaces() {
    let good = scene::bytes();
    let aligned = Aligned::new(&good);
    let image = SceneImage::open(aligned.bytes()).unwrap();
    let shape = image.shape(1);
    // Over the brick without samples: the queries that know no surfaces give a bound that excludes nothing.
    let p = [0.020, 0.001, 0.001];
    let Place::Cell(cell) = shape.field.place(p) else {
        panic!("no cell");
    };
    assert!(!cell.has_samples());
    assert_eq!(shape.field.nearby(&cell), Nearby::Face(1));
    assert_eq!((shape.field.bound(p), shape.field.distance(&cell)), (0.0, 0.0));
    let header = image.header();
    let brick = header.bricks.offset as usize + 3 * size_of::<BrickRecord>();
    let entry = header.palette.offset as usize + 2 * 5;
    let kind = header.faces.offset as usize + 3 * size_of::<FaceRecord>();
    let refused = |change: &dyn Fn(&mut [u8])| {
        let mut other = Aligned::new(&good);
        change(other.bytes_mut());
        other.seal();
        SceneImage::open(other.bytes()).is_err()
    };
    assert!(!refused(&|_| {}));
    // A patch answers too; there is one.
    assert!(!refused(&|bytes| bytes[entry] = 2));
    // No such surface; a face that is only the nearest; none; a face without closed form.
    assert!(refused(&|bytes| bytes[entry] = 3));
    assert!(refused(&|bytes| bytes[entry + 1] |= 0x40));
    assert!(refused(&|bytes| bytes[entry..entry + 2].fill(0xff)));
    assert!(refused(&|bytes| bytes[kind] = surface_kind::OTHER as u8));
    // Indices beyond the palette.
    assert!(refused(&|bytes| bytes[brick + 14] = 4));
}

/// The order of checks determines the remedy: a different layout is reported before damage.
#[test]
fn refusals_name_the_reason() {
    let good = scene::bytes();
    let mut other = Aligned::new(&good);
    other.bytes_mut()[8..12].copy_from_slice(&99u32.to_le_bytes());
    assert_eq!(
        SceneImage::open(other.bytes()).unwrap_err(),
        ImageError::Layout {
            expected: LAYOUT_VERSION,
            found: 99
        }
    );
    let mut other = Aligned::new(&good);
    other.bytes_mut()[0] = b'X';
    assert_eq!(SceneImage::open(other.bytes()).unwrap_err(), ImageError::BadMagic);
    let misaligned = Aligned::new(&[&[0u8][..], &good].concat());
    assert_eq!(
        SceneImage::open(&misaligned.bytes()[1..]).unwrap_err(),
        ImageError::Misaligned
    );
}
