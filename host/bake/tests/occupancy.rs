//! Voxels against the closed form: those that the surface crosses, those that it does not, and their distance bounds.

use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::sync::LazyLock;

use crate::common::*;
use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, BakeReport, CROSSING_TOLERANCE_CELLS, Method, PROXIMITY_LAYERS, bake};
use mortise_brep::Shape;
use mortise_protocol::image::{Field, SceneImage, VOXEL_BRICK_BYTES, Voxel};
use proptest::prelude::*;

/// A baked voxmap, with every voxel read back through the board's query.
struct Map {
    field: Field<'static>,
    report: BakeReport,
    /// Cells along x, y, z.
    size: [usize; 3],
    voxels: Vec<Voxel>,
    cell: f64,
}

impl Map {
    fn of(shape: Shape, cell_mm: f64) -> Self {
        let options = BakeOptions {
            method: Method::Occupancy,
            cell_mm: Some(cell_mm),
            image_limit_bytes: 16 << 20,
            ..BakeOptions::default()
        };
        let model = model(vec![("part", shape, DAffine3::IDENTITY)]);
        let baked = bake(&model, &options, &|_| ControlFlow::Continue(())).unwrap();
        let bytes = Box::leak(Box::new(AlignedBytes::new(&baked.image))).bytes();
        let field = SceneImage::open(bytes).unwrap().shape(0).field;
        assert!(field.is_occupancy());
        let size = field.record().brick_dims.map(|d| 8 * usize::from(d));
        let mut map = Self {
            field,
            report: baked.report,
            size,
            voxels: Vec::new(),
            cell: 1e3 * f64::from(field.record().cell),
        };
        map.voxels = (0..size.iter().product())
            .map(|i| {
                let center = map.center(map.place(i));
                field.voxel((center / 1e3).as_vec3().to_array()).voxel
            })
            .collect();
        map
    }

    fn place(&self, i: usize) -> [usize; 3] {
        let [w, h, _] = self.size;
        [i % w, i / w % h, i / w / h]
    }

    /// Centre of a voxel, mm.
    fn center(&self, at: [usize; 3]) -> DVec3 {
        let origin = DVec3::from_array(self.field.record().origin.map(f64::from)) * 1e3;
        origin + (DVec3::from_array(at.map(|x| x as f64)) + 0.5) * self.cell
    }

    fn at(&self, [x, y, z]: [usize; 3]) -> Voxel {
        self.voxels[x + self.size[0] * (y + self.size[1] * z)]
    }

    fn is_surface(&self, at: [i64; 3]) -> bool {
        (0..3).all(|a| at[a] >= 0 && (at[a] as usize) < self.size[a])
            && self.at(at.map(|x| x as usize)) == Voxel::Surface
    }
}

const CELL: f64 = 1.0;
static BLOCK: LazyLock<Map> = LazyLock::new(|| Map::of(block_with_hole([25.0, 20.0], 30.0, 9.375, 32), CELL));
static SPHERE: LazyLock<Map> = LazyLock::new(|| Map::of(sphere(10.0, 24), 0.7));

fn block(p: DVec3) -> f64 {
    block_distance([25.0, 20.0], 30.0, 9.375, p)
}

fn ball(p: DVec3) -> f64 {
    p.length() - 10.0
}

/// Compares every voxel with samples of the distance inside it: `STEPS`³ of them, so that every point of it is within half a diagonal of a sample.
fn compare(map: &Map, distance: fn(DVec3) -> f64) {
    const STEPS: usize = 9;
    let spacing = map.cell / STEPS as f64;
    let missed = spacing * 0.75f64.sqrt();
    let tolerance = CROSSING_TOLERANCE_CELLS * map.cell;
    let mut counts = [0usize; 4];
    for i in 0..map.voxels.len() {
        let at = map.place(i);
        let center = map.center(at);
        let voxel = map.at(at);
        counts[voxel as usize] += 1;
        let middle = distance(center);
        let near = (0..27).any(|i| {
            let [x, y, z] = at.map(|x| x as i64);
            map.is_surface([x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1])
        });
        if middle.abs() > 2.7 * map.cell {
            // The surface is farther away than any corner of any neighbour: 1.5·√3.
            assert_eq!(
                voxel,
                if middle < 0.0 {
                    Voxel::Interior
                } else {
                    Voxel::Free
                },
                "{center}"
            );
            continue;
        }
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..STEPS.pow(3) {
            let step = |n: usize| (n % STEPS) as f64 + 0.5 - 0.5 * STEPS as f64;
            let p = center + spacing * DVec3::new(step(k), step(k / STEPS), step(k / STEPS / STEPS));
            low = low.min(distance(p));
            high = high.max(distance(p));
        }
        if low < 0.0 && high > 0.0 {
            assert_eq!(voxel, Voxel::Surface, "{center}: {low} to {high}");
        }
        match voxel {
            // The surface is within the tolerance of some point of the cube, which is within half a step of a sample.
            Voxel::Surface => assert!(
                low <= missed + tolerance && high >= -missed - tolerance,
                "{center}: {low} to {high}"
            ),
            Voxel::Interior => assert!(high < 0.0, "{center}: {high}"),
            Voxel::Proximity => assert!(low > 0.0 && near, "{center}: {low}"),
            Voxel::Free => assert!(low > 0.0 && !near, "{center}: {low}"),
        }
    }
    assert!(counts.iter().all(|&n| n > 500), "{counts:?}");
}

#[test]
fn voxels_are_what_the_surface_makes_them() {
    assert_eq!(PROXIMITY_LAYERS, 1, "the tests look one layer round");
    compare(&BLOCK, block);
    compare(&SPHERE, ball);
}

#[test]
fn the_largest_planes_run_through_voxel_centres() {
    let top = BLOCK.field.voxel([-0.02, 0.015, 0.03]);
    assert_eq!(top.voxel, Voxel::Surface);
    // Single precision of 30 mm, twice.
    assert!((top.center[2] - 0.03).abs() < 8e-9, "{top:?}");
    assert_eq!(BLOCK.field.voxel([-0.02, 0.015, 0.031]).voxel, Voxel::Proximity);
    assert_eq!(BLOCK.field.voxel([-0.02, 0.015, 0.029]).voxel, Voxel::Interior);
}

#[test]
fn a_brick_takes_128_bytes() {
    assert_eq!(VOXEL_BRICK_BYTES, 128);
    for map in [&*BLOCK, &*SPHERE] {
        let shape = &map.report.shapes[0];
        assert_eq!(shape.method, Method::Occupancy);
        // Four bits a voxel where several faces cross a brick; there are fewer than 16 sets of faces.
        assert_eq!((shape.bytes.samples % 128, shape.bytes.indices % 256), (0, 0));
        assert!(shape.bytes.samples <= 128 * shape.bricks, "{shape:?}");
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let options = BakeOptions {
        method: Method::Occupancy,
        cell_mm: Some(2.0),
        ..BakeOptions::default()
    };
    let model = model(vec![("part", sphere(10.0, 24), DAffine3::IDENTITY)]);
    let alone = one
        .install(|| bake(&model, &options, &|_| ControlFlow::Continue(())))
        .unwrap();
    let many = bake(&model, &options, &|_| ControlFlow::Continue(())).unwrap();
    assert_eq!(alone.image, many.image);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// Every point of the surface lies in a voxel marked as surface.
    #[test]
    fn the_surface_lies_in_surface_voxels(a in 0.0f64..TAU, z in -1.0f64..1.0, t in 0.0f64..30.0) {
        let u = DVec3::new((1.0 - z * z).sqrt() * a.cos(), (1.0 - z * z).sqrt() * a.sin(), z);
        let on_ball = SPHERE.field.voxel((u / 100.0).as_vec3().to_array());
        prop_assert_eq!(on_ball.voxel, Voxel::Surface);
        let wall = DVec3::new(9.375 * a.cos(), 9.375 * a.sin(), t) / 1e3;
        let on_wall = BLOCK.field.voxel(wall.as_vec3().to_array());
        prop_assert_eq!(on_wall.voxel, Voxel::Surface);
        // The wall crosses this voxel; at a rim another face may be nearer to its centre.
        prop_assert!(on_wall.faces.contains(&6), "{:?}", on_wall);
    }

    /// No surface voxel is nearer than the bound, inside the grid and outside.
    #[test]
    fn bounds_are_true(p in prop::array::uniform3(-16.0f64..16.0)) {
        let asked = DVec3::from_array(p);
        let stored = (asked / 1e3).as_vec3();
        let bound = 1e3 * f64::from(SPHERE.field.voxel(stored.to_array()).bound);
        let culling = 1e3 * f64::from(SPHERE.field.bound(stored.to_array()));
        let p = stored.as_dvec3() * 1e3;
        let half = 0.5 * SPHERE.cell;
        let nearest = (0..SPHERE.voxels.len())
            .filter(|&i| SPHERE.voxels[i] == Voxel::Surface)
            .map(|i| ((p - SPHERE.center(SPHERE.place(i))).abs() - half).max(DVec3::ZERO).length())
            .fold(f64::INFINITY, f64::min);
        // Single precision of a position of 16 mm and of the bound.
        prop_assert!(bound <= nearest + 4e-6, "{} > {}", bound, nearest);
        prop_assert!(culling <= nearest + 4e-6, "{} > {}", culling, nearest);
    }
}
