//! The bridge to the CAD kernel: the only module that calls C++.
//!
//! Everything crosses the bridge as flat numbers and strings; the Rust side interprets them. Names are the tokens that [`crate::part21`] put into the
//! text, so that the kernel decodes no name. The kernel keeps global state while it reads: callers hold [`lock`].

use crate::progress::Progress;
use std::sync::{Mutex, MutexGuard, PoisonError};

static KERNEL: Mutex<()> = Mutex::new(());

/// Locks the kernel for this thread: its STEP reader is not thread-safe.
pub fn lock() -> MutexGuard<'static, ()> {
    // The mutex guards no Rust data, so a panic in another thread leaves no data half-changed.
    KERNEL.lock().unwrap_or_else(PoisonError::into_inner)
}

// The bridge macro writes qualified paths.
#[allow(unused_qualifications)]
#[cxx::bridge(namespace = "mortise::brep")]
mod ffi {
    /// One step down the assembly tree.
    #[derive(Clone, Debug)]
    struct RawLink {
        /// Token or text of the occurrence's name.
        instance: String,
        /// Token or text of the product's name.
        product: String,
    }

    /// A shape placed in the assembly.
    #[derive(Clone, Debug)]
    struct RawPart {
        /// From the root product (first) to the leaf product (last).
        path: Vec<RawLink>,
        shape: usize,
        /// Number of this solid among those of its product, from 0.
        solid: usize,
        /// Number of parts of its product.
        solids: usize,
        /// Rotation row by row with the translation as fourth column, mm.
        placement: [f64; 12],
        has_color: bool,
        color: [f32; 3],
        /// Faces of the product that belong to none of its solids, and were skipped.
        loose_faces: usize,
    }

    /// Result for a solid or surface model of the file.
    #[derive(Clone, Debug)]
    struct RawResult {
        /// Entity number in the text given to the kernel.
        entity: usize,
        /// Faces in the resulting shape; 0 when there is none.
        faces: usize,
        solids: usize,
        /// Whether at least one of its solids or faces is in a part.
        placed: bool,
        /// Faces whose orientation in its solids is opposite to the text's, if it is so of some and not of all: the kernel has taken the other side of
        /// their edges.
        turned: usize,
        /// The kernel's message about it, if any.
        message: String,
    }

    #[derive(Clone, Debug)]
    struct RawFace {
        /// 0 plane, 1 cylinder, 2 cone, 3 sphere, 4 torus, 5 anything else.
        kind: u8,
        origin: [f64; 3],
        x: [f64; 3],
        z: [f64; 3],
        /// radius or major radius; half angle or minor radius.
        parameters: [f64; 2],
        /// A point of the surface near the middle of the face, and the face's outward normal there.
        point: [f64; 3],
        normal: [f64; 3],
        /// Kind 5: points of the face, each followed by its outward unit normal.
        samples: Vec<f64>,
        area: f64,
        edges: Vec<u32>,
        has_color: bool,
        color: [f32; 3],
    }

    #[derive(Clone, Debug)]
    struct RawEdge {
        /// 0 line (origin, z = direction), 1 circle, 2 anything else.
        kind: u8,
        origin: [f64; 3],
        x: [f64; 3],
        z: [f64; 3],
        radius: f64,
        length: f64,
        /// Kind 2: points along the exact curve, first to last.
        samples: Vec<f64>,
        faces: Vec<u32>,
        polyline: Vec<f64>,
    }

    #[derive(Clone, Debug)]
    struct RawShape {
        faces: Vec<RawFace>,
        edges: Vec<RawEdge>,
        vertices: Vec<f64>,
        triangles: Vec<u32>,
        triangle_face: Vec<u32>,
        volume: f64,
        area: f64,
        center: [f64; 3],
        inertia: [f64; 9],
        /// Faces that could not be tessellated.
        faces_without_mesh: Vec<u32>,
        /// Largest measured distance between mesh and surface, and the requested bound, mm.
        deflection: f64,
        deflection_asked: f64,
    }

    /// A face without a closed form, as a B-spline surface trimmed to the face's parameter box.
    #[derive(Clone, Debug)]
    struct RawSpline {
        face: u32,
        degrees: [u32; 2],
        /// Each knot is repeated by its multiplicity.
        knots_u: Vec<f64>,
        knots_v: Vec<f64>,
        /// x, y, z, weight; v runs fastest.
        poles: Vec<f64>,
        /// Largest distance measured from the face's own surface, mm.
        deviation: f64,
    }

    /// Points of an edge that is neither line nor circle, between the points of its polyline.
    #[derive(Clone, Debug)]
    struct RawCurve {
        edge: u32,
        /// For each side of the polyline the number of points within it; empty when the edge has no parameters.
        counts: Vec<u32>,
        points: Vec<f64>,
    }

    #[derive(Clone, Debug)]
    struct RawFreeForms {
        splines: Vec<RawSpline>,
        curves: Vec<RawCurve>,
    }

    /// A shape to be written at a placement.
    #[derive(Clone, Debug)]
    struct RawPlace {
        shape: usize,
        name: String,
        /// Rotation row by row with the translation as fourth column, mm.
        placement: [f64; 12],
        has_color: bool,
        color: [f32; 3],
    }

    extern "Rust" {
        type Progress<'a>;
        /// States how much of the present phase is done, 0 to 1.
        fn advance(self: &Progress<'_>, done: f64);
    }

    // SAFETY: the signatures of kernel.h, which cxx checks when it compiles the bridge; none of the functions keeps a reference after it returns.
    unsafe extern "C++" {
        include!("kernel.h");

        type Document;

        fn read_document(
            text: &[u8],
            max_parts: usize,
            progress: &Progress<'_>,
        ) -> Result<UniquePtr<Document>>;
        fn parts(self: &Document) -> Vec<RawPart>;
        fn results(self: &Document) -> Vec<RawResult>;
        fn shape_count(self: &Document) -> usize;
        /// Estimated effort of describing a shape, in plain faces.
        fn effort(self: &Document, index: usize) -> usize;
        fn shape(
            self: &Document,
            index: usize,
            linear_mm: f64,
            relative: f64,
            angular_rad: f64,
            progress: &Progress<'_>,
        ) -> Result<RawShape>;

        /// Faces and edges without a closed form, of a shape that [`Document::shape`] has tessellated; edges are followed within the tolerance.
        fn free_forms(self: &Document, index: usize, tolerance_mm: f64) -> Result<RawFreeForms>;
        /// Side of each point (x, y, z in turn) relative to the shape's solid, by the kernel's own classifier: 0 inside, 1 outside, 2 within the
        /// tolerance of the surface, 3 undecided.
        fn sides(self: &Document, index: usize, points: &[f64], tolerance_mm: f64) -> Result<Vec<u8>>;
        /// Nearest point of the shape's faces to each point, by the kernel: distance, x, y, z; the distance is -1 where it finds none.
        fn feet(self: &Document, index: usize, points: &[f64]) -> Result<Vec<f64>>;
        /// STEP text (AP214, mm) of an assembly of one level with these parts.
        fn write(self: &Document, places: &Vec<RawPlace>) -> Result<Vec<u8>>;

        /// Limits address space (bytes) and processor time (seconds) of this process where the system supports it; 0 for no limit.
        fn limit_process(memory_bytes: u64, cpu_seconds: u64) -> bool;
        fn flush_output();
        /// On Linux: makes the system kill this process when the thread of `parent` that started it ends; ends it immediately when `parent` is
        /// already gone.
        fn end_with_parent(parent: u32);
        /// Ends this process immediately, without running any more of its code.
        fn end_now();
    }
}

pub use ffi::*;
