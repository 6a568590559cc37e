//! CAD model to scene image: exact signed distance, sparse bricks, pointshell.
//!
//! [`bake`] turns a [`CadModel`](mortise_brep::CadModel) (mm) into the bytes that [`SceneImage`](mortise_protocol::image::SceneImage) reads in place
//! (m). Each shape passes through three stages:
//!
//! 1. an [`ExactSurface`]: signed distance to the B-rep itself, not to its facets,
//! 2. a field: that distance sampled on bricks of 8³ cells, stored only near the surface,
//! 3. a pointshell on the exact surface, as dense as an error bound requires, under a tree of spheres.
//!
//! Work and bytes grow with the surface, not the volume. The bytes do not depend on the number of threads.

mod accuracy;
mod area_curvatures;
mod attempt;
mod bake;
mod bounds;
mod bricks;
mod cache;
mod cell_features;
mod cell_samples;
mod cell_surfaces;
mod chains;
mod choice;
mod classic;
mod convex;
mod cost;
mod cover;
mod demands;
mod distance;
mod edge_samples;
mod edge_spans;
mod edges;
mod error;
mod face_samples;
mod field;
mod field_error;
mod fits;
mod format;
mod free_form;
mod free_form_cells;
mod free_form_error;
mod grid;
mod image;
mod levels;
mod local_patch;
mod made;
mod meetings;
mod mix;
mod nearby;
mod occupancy;
mod options;
mod overload;
mod partners;
mod patch;
mod piece;
mod placed_fits;
mod plan;
mod planner;
mod pointshell;
mod report;
mod ring_samples;
mod rule;
mod scene;
mod sheets;
mod shell;
mod sides;
mod sign_check;
mod spline_samples;
mod stretch;
mod surface;
mod ticks;
mod topology;
mod tree;
mod trials;
mod triangles;
mod trim;
mod voids;
mod winding;

pub use bake::{Baked, bake};
pub use cache::{Cache, NoCache};
pub use classic::classic_pointshell;
pub use cost::{FIXED, TickCost};
pub use distance::{ExactSurface, Nearest};
pub use error::BakeError;
pub use field::{BakedField, bake_field};
pub use format::{FieldOptions, SampleFormat, Samples};
pub use free_form_error::FreeFormError;
pub use image::{ImageBuilder, PartPlacement};
pub use occupancy::{CROSSING_TOLERANCE_CELLS, PROXIMITY_LAYERS, bake_occupancy};
pub use options::{BakeOptions, Grabbable, Method, PointshellKind, Progress, Stage};
pub use partners::{CurvatureRange, Met, Partners};
pub use plan::{ELSEWHERE, Limit, PartTick, Plan, Planned, Request, SLOT_BYTES, ShapePlan};
pub use planner::{Effort, plan, plan_with, plan_within};
pub use pointshell::sample_pointshell;
pub use report::{BakeReport, ByteCount, PartReport, ShapeReport};
pub use shell::{Pointshell, PointshellOptions, ShellPoint, ShellSpan};
pub use sign_check::{SignCheck, SignError, SignOptions, WrongSide, check_signs};
pub use tree::{SphereTree, build_tree};
