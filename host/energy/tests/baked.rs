//! Energies for a scene image: where their minimum is, that their stiffness majorises them, and that an image takes them whole.

use std::f64::consts::TAU;
use std::io::Write as _;

use glam::{DAffine3, DVec3};
use mortise_brep::load_step;
use mortise_energy::{AttachError, BakedEnergy, Placed, attach, bytes, moved, of_fit};
use mortise_fit::{Fit, FitOptions, find, part_named};
use mortise_protocol::image::{ENERGY_DEPTHS, SceneImage};
use mortise_shapes::Designed;

/// A scene of three parts without energies.
const IMAGE: &[u8] = include_bytes!("../../../protocol/tests/golden/tiny.scene");
/// Excess over the majoriser that steps of the slope in the lattice make, over the depth.
const SLACK: f64 = 2e-4;

/// The energy of a random pair, its fit, and the placement of the fixed part.
fn energy(seed: u64) -> (BakedEnergy, Fit, DAffine3) {
    let mut file = tempfile::Builder::new().suffix(".step").tempfile().unwrap();
    file.write_all(Designed::random(seed).text().as_bytes()).unwrap();
    let model = load_step(file.path()).unwrap();
    let [moving, fixed] = ["moving", "fixed"].map(|name| part_named(&model, name).unwrap());
    let fits = find(&model, moving, fixed, &FitOptions::default()).unwrap().fits;
    let fit = fits.into_iter().find(|fit| fit.path.is_some()).unwrap();
    (
        of_fit(&model, moving, fixed, &fit).unwrap(),
        fit,
        model.parts[fixed].placement,
    )
}

/// The words of an image, aligned as a board has them.
fn words(image: &[u8]) -> Vec<u32> {
    let four = |word: &[u8]| u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
    image.chunks_exact(4).map(four).collect()
}

/// From 1 to 4 mm aside, at and above the mouth, it draws towards the way.
fn drawn_in(energy: &BakedEnergy, place: &dyn Fn(f64) -> DAffine3, length_mm: f64, into: DVec3) {
    let (u, v) = into.any_orthonormal_pair();
    for height in [0.0, 1.0, 2.0, 4.0] {
        for aside in [1.0, 2.0, 3.0, 4.0] {
            for direction in 0..16 {
                let (sin, cos) = (TAU * f64::from(direction) / 16.0).sin_cos();
                let at = |d: f64| {
                    let aside = DAffine3::from_translation((u * cos + v * sin) * d);
                    energy
                        .at(&(aside * place(length_mm + height)), DVec3::ZERO)
                        .energy
                };
                assert!(
                    at(aside + 0.1) > at(aside - 0.1),
                    "{height} mm above, {aside} mm aside, direction {direction}"
                );
            }
        }
    }
}

#[test]
fn the_minimum_is_on_the_way_and_the_stiffness_majorises() {
    let (energy, fit, fixed) = energy(3);
    let path = fit.path.as_ref().unwrap();
    let seat = fixed.inverse() * fit.placement;
    let into = fixed.inverse().transform_vector3(path.direction);
    assert!((energy.at(&seat, DVec3::ZERO).energy + 1.0).abs() < 1e-6);
    let place = |travel: f64| DAffine3::from_translation(-into * travel) * seat;
    let mut before = f64::NEG_INFINITY;
    for step in 0..=10 {
        let travel = 0.1 * f64::from(step) * path.length_mm;
        let (aside, tilt) = energy.minimum(&place(travel));
        assert!(aside < 0.15 && tilt < 0.015, "{travel}: {aside} mm, {tilt} rad");
        let now = energy.at(&place(travel), DVec3::ZERO).energy;
        assert!(now > before, "{travel}: it falls all the way in");
        before = now;
    }
    for step in 1..=60 {
        let travel = 0.05 * f64::from(step);
        let there = energy.at(&place(travel), DVec3::ZERO).energy;
        assert!(there > -1.0, "{travel} mm before the fit: {there}");
    }
    drawn_in(&energy, &place, path.length_mm, into);
    let record = &energy.record;
    let axis = DVec3::from_array(record.way.map(f64::from));
    let mut random = fastrand::Rng::with_seed(1);
    let mut signed = || 2.0 * random.f64() - 1.0;
    let mut exceeded = 0;
    for _ in 0..1000 {
        let pose = place(0.5 * (1.0 + signed()) * path.length_mm);
        let about = pose.transform_point3(energy.middle());
        let moved = |pose: &DAffine3, by: DVec3| moved(pose, by, DVec3::ZERO, about);
        let aside = DVec3::new(signed(), signed(), signed());
        let pose = moved(&pose, 2.0 * aside);
        let by = 0.6 * DVec3::new(signed(), signed(), signed());
        let here = energy.at(&pose, about);
        let there = energy.at(&moved(&pose, by), about).energy;
        let depth = (-here.energy).clamp(0.0, 1.0) * (ENERGY_DEPTHS - 1) as f64;
        let at = |row: &[f32; ENERGY_DEPTHS]| {
            let share = depth - depth.floor();
            let [below, above] = [depth.floor(), depth.ceil()].map(|i| f64::from(row[i as usize]));
            1e-6 * (below + share * (above - below))
        };
        let along = axis.dot(by) * axis.dot(by);
        let stiff = at(&record.across) * (by.length_squared() - along) + at(&record.along) * along;
        let excess = there - (here.energy + here.slope.dot(by) + 0.5 * stiff);
        exceeded += u32::from(excess > SLACK);
    }
    // Sampled by the baker at other poses: what a thousand new ones show beyond is rare.
    assert!(exceeded <= 5, "{exceeded} of 1000");
}

#[test]
fn an_image_takes_energies_whole_and_once() {
    let (energy, ..) = energy(9);
    let placed = [0, 2].map(|moving| Placed {
        moving,
        fixed: 1,
        energy: energy.clone(),
    });
    let image = attach(IMAGE, &placed).unwrap();
    assert_eq!(image.len(), IMAGE.len().next_multiple_of(4) + bytes(&placed));
    let aligned = words(&image);
    let scene = SceneImage::open(bytemuck::cast_slice(&aligned)).unwrap();
    assert_eq!(scene.energy_count(), 2);
    for (index, placed) in placed.iter().enumerate() {
        let found = scene.energy(index).unwrap();
        assert_eq!((found.record.moving, found.record.fixed), (placed.moving, 1));
        assert_eq!(found.charges, energy.charges);
        let steps = energy.record.size.map(|n| 0.4 * f32::from(n));
        let own =
            mortise_protocol::image::Energy::new(&energy.record, &energy.charges, &energy.nodes).unwrap();
        assert_eq!(found.at(steps, [1.0, -0.5]), own.at(steps, [1.0, -0.5]));
    }
    // All that it had before but the header keeps its bytes.
    assert_eq!(image[128..IMAGE.len()], IMAGE[128..]);
    assert!(matches!(attach(&image, &placed), Err(AttachError::Present)));
    let strange = Placed {
        moving: 7,
        fixed: 1,
        energy: energy.clone(),
    };
    assert!(matches!(attach(IMAGE, &[strange]), Err(AttachError::Image(_))));
    assert!(matches!(attach(b"no image", &placed), Err(AttachError::Image(_))));
}
