//! Scenes and operator models for the tests.
#![allow(dead_code, reason = "each test file uses its share")]

pub mod hand;
pub mod image;
pub mod solids;

use image::{Image, Writer};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};
use solids::{Block, Peg};

pub const UPRIGHT: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
/// Radius of the thesis' hole, m.
pub const HOLE: f64 = 9.375e-3;
/// Half the height of the block with the hole, m.
pub const BLOCK_HALF: f64 = 10e-3;
/// Half the length of the peg, m.
pub const PEG_HALF: f64 = 15e-3;

/// Fixed block (part 0) with the thesis' 18.75 mm hole and a peg (part 1) of the given diametral clearance, its lower end `engaged`
/// below the block's top.
pub fn hole_and_peg(clearance: f64, engaged: f64) -> Image {
    hole_and_peg_in(Writer::new(0.5e-3), clearance, engaged)
}

/// As [`hole_and_peg`], with exact surfaces.
pub fn exact_hole_and_peg(clearance: f64, engaged: f64) -> Image {
    hole_and_peg_in(Writer::exact(0.5e-3), clearance, engaged)
}

/// As [`hole_and_peg`], in voxmaps.
pub fn hole_and_peg_in_voxels(clearance: f64, engaged: f64) -> Image {
    hole_and_peg_in(Writer::voxmaps(0.5e-3), clearance, engaged)
}

fn hole_and_peg_in(mut w: Writer, clearance: f64, engaged: f64) -> Image {
    let block = w.shape(&Block {
        half: [15e-3, 15e-3, BLOCK_HALF],
        hole: HOLE,
        around: 128,
        across: 7,
    });
    let peg = w.shape(&Peg {
        radius: HOLE - 0.5 * clearance,
        half_length: PEG_HALF,
        around: 128,
        rings: 2,
    });
    w.part(block, false, [0.0; 3], UPRIGHT);
    w.part(
        peg,
        true,
        [0.0, 0.0, (BLOCK_HALF + PEG_HALF - engaged) as f32],
        UPRIGHT,
    );
    w.finish()
}

/// The slab of [`slab_and_box`], its top at 4 mm.
pub const SLAB: Block = Block {
    half: [20e-3, 20e-3, 4e-3],
    hole: 0.0,
    around: 0,
    across: 5,
};

/// Fixed slab (part 0) with its top at z = 0 and a box of 20 × 20 × 10 mm (part 1) that hovers `height` above it; `across` squared
/// points on each of the box's large faces.
pub fn slab_and_box(height: f64, across: usize) -> Image {
    slab_and_box_in(Writer::new(0.5e-3), height, across)
}

/// As [`slab_and_box`], in voxmaps with voxels of this edge, m.
pub fn slab_and_box_in_voxels(cell: f64, height: f64, across: usize) -> Image {
    slab_and_box_in(Writer::voxmaps(cell), height, across)
}

fn slab_and_box_in(mut w: Writer, height: f64, across: usize) -> Image {
    let slab = w.shape(&SLAB);
    let moving = w.shape(&box_of(across));
    w.part(slab, false, [0.0, 0.0, -4e-3], UPRIGHT);
    w.part(moving, true, [0.0, 0.0, (5e-3 + height) as f32], UPRIGHT);
    w.finish()
}

/// The box of [`slab_and_box`].
pub fn box_of(across: usize) -> Block {
    Block {
        half: [10e-3, 10e-3, 5e-3],
        hole: 0.0,
        around: 0,
        across,
    }
}

/// Largest force of [`axis_on_axis`], N.
pub const CAP_N: f32 = 3.0;

/// A target that keeps the peg of [`hole_and_peg`] on the axis of the hole.
pub fn axis_on_axis(sequence: u16, expiry_ticks: u16) -> ConstraintTarget {
    let axis = Feature {
        point: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
    };
    ConstraintTarget {
        id: 7,
        sequence,
        kind: ConstraintKind::Concentric,
        moving: axis,
        static_part: 0,
        fixed: axis,
        stiffness: 1e6,
        force_cap: CAP_N,
        torque_cap: 0.1,
        expiry_ticks,
        path: None,
        // The peg's side, the hole.
        faces: heapless::Vec::from_slice(&[(0, 3)]).unwrap(),
    }
}

/// A straight way: the part keeps the orientation of the scene, and there is no end.
pub fn straight() -> Path {
    Path {
        orientation: UPRIGHT,
        turn: PathTurn::Geared(0.0),
        ends: false,
    }
}

/// The target of [`axis_on_axis`] as a way down into the hole, of kind `Path`.
pub fn along(sequence: u16, expiry_ticks: u16, path: Path) -> ConstraintTarget {
    let down = Feature {
        point: [0.0; 3],
        direction: [0.0, 0.0, -1.0],
    };
    ConstraintTarget {
        kind: ConstraintKind::Path,
        moving: down,
        fixed: down,
        path: Some(path),
        ..axis_on_axis(sequence, expiry_ticks)
    }
}
