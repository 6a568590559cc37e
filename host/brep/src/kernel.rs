//! The bridge to the CAD kernel: the only module that speaks C++.
//!
//! Everything crosses as flat numbers and strings; meaning is given on the Rust side. Names are the tokens
//! which [`crate::part21`] put into the text, so that no name is decoded by the kernel. The kernel keeps global
//! state while it reads: callers hold [`lock`].

use std::sync::{Mutex, MutexGuard, PoisonError};

static KERNEL: Mutex<()> = Mutex::new(());

/// Takes the kernel for this thread: its STEP reader is not thread-safe.
pub fn lock() -> MutexGuard<'static, ()> {
    // The mutex guards no Rust data, so a panic elsewhere leaves nothing half-changed.
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
        /// How many parts its product has.
        solids: usize,
        /// Rotation row by row with the translation as fourth column, mm.
        placement: [f64; 12],
        has_color: bool,
        color: [f32; 3],
        /// Faces of the product that belong to none of its solids, and were left out.
        loose_faces: usize,
    }

    /// What became of a solid or surface model in the file.
    #[derive(Clone, Debug)]
    struct RawResult {
        /// Entity number in the text handed over.
        entity: usize,
        /// Faces in the shape it became; 0 when it became none.
        faces: usize,
        solids: usize,
        /// At least one of its solids or faces is in a part.
        placed: bool,
        /// What the kernel had to say about it, if anything.
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
        /// Kind 5: points of the face, each followed by the outward unit normal there.
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
        /// Largest distance measured between mesh and surface, and the bound asked for, mm.
        deflection: f64,
        deflection_asked: f64,
    }

    /// A face that is none of the closed forms, as a B-spline surface cut to the face's parameter box.
    #[derive(Clone, Debug)]
    struct RawSpline {
        face: u32,
        degrees: [u32; 2],
        /// Each knot as often as its multiplicity.
        knots_u: Vec<f64>,
        knots_v: Vec<f64>,
        /// x, y, z, weight; v runs fastest.
        poles: Vec<f64>,
        /// Largest distance seen from the face's own surface, mm.
        deviation: f64,
    }

    /// Points of an edge that is neither line nor circle, between the points of its polyline.
    #[derive(Clone, Debug)]
    struct RawCurve {
        edge: u32,
        /// For each side of the polyline how many points lie within it; empty when the edge has no parameters.
        counts: Vec<u32>,
        points: Vec<f64>,
    }

    #[derive(Clone, Debug)]
    struct RawFreeForms {
        splines: Vec<RawSpline>,
        curves: Vec<RawCurve>,
    }

    // SAFETY: the signatures of kernel.h, which cxx checks when it compiles the bridge; none keeps a reference after it returns.
    unsafe extern "C++" {
        include!("kernel.h");

        type Document;

        fn read_document(text: &[u8], max_parts: usize) -> Result<UniquePtr<Document>>;
        fn parts(self: &Document) -> Vec<RawPart>;
        fn results(self: &Document) -> Vec<RawResult>;
        fn shape_count(self: &Document) -> usize;
        fn shape(
            self: &Document,
            index: usize,
            linear_mm: f64,
            relative: f64,
            angular_rad: f64,
        ) -> Result<RawShape>;

        /// Faces and edges without a closed form, of a shape that [`Document::shape`] has tessellated; edges within the tolerance.
        fn free_forms(self: &Document, index: usize, tolerance_mm: f64) -> Result<RawFreeForms>;
        /// Side of each point (x, y, z in turn) of the shape's solid by the kernel's own classifier: 0 inside, 1 outside, 2 within
        /// the tolerance of the surface, 3 it cannot tell.
        fn sides(self: &Document, index: usize, points: &[f64], tolerance_mm: f64) -> Result<Vec<u8>>;
        /// Nearest point of the shape's faces to each point, by the kernel: distance, x, y, z; distance -1 where it finds none.
        fn feet(self: &Document, index: usize, points: &[f64]) -> Result<Vec<f64>>;

        /// Caps address space (bytes) and processor time (seconds) of this process where the system can; 0 for none.
        fn limit_process(memory_bytes: u64, cpu_seconds: u64) -> bool;
        fn flush_output();
        /// On Linux the system kills this process when the thread of `parent` that started it ends; ends it at once when `parent`
        /// is gone already.
        fn end_with_parent(parent: u32);
        /// Ends this process without running anything more of it.
        fn end_now();
    }
}

pub use ffi::*;
