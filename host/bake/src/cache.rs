//! What a plan keeps for the next one: fields with their measured errors, and finished plans, under names that state all they depend on.
//!
//! A name is the SHA-256 of the shape's geometry and the options, so that an entry answers no other question than its own; the program's version is
//! the store's matter. Entries that cannot be read back are taken for missing.

use mortise_brep::{CadModel, Shape};
use mortise_protocol::image::{BrickRecord, FieldRecord, PatchRecord};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::choice::Choice;
use crate::field::BakedField;
use crate::field_error::FaceError;
use crate::free_form_error::FreeFormError;
use crate::plan::{Planned, Request};

/// A store of results. Called from any thread.
pub trait Cache: Sync {
    /// Bytes kept under a name, unchanged; `None` when there are none or they were damaged.
    fn get(&self, name: &str) -> Option<Vec<u8>>;
    /// Keeps bytes under a name, if it can.
    fn put(&self, name: &str, bytes: &[u8]);
}

/// Keeps nothing.
pub struct NoCache;

impl Cache for NoCache {
    fn get(&self, _: &str) -> Option<Vec<u8>> {
        None
    }

    fn put(&self, _: &str, _: &[u8]) {}
}

/// SHA-256 of a value's serialised form, in hexadecimal digits.
fn hash(value: &impl Serialize) -> Option<String> {
    let bytes = postcard::to_stdvec(value).ok()?;
    Some(Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect())
}

/// Name of a shape's geometry.
pub(crate) fn shape_name(shape: &Shape) -> Option<String> {
    hash(shape)
}

/// Name of the plan for a model within a limit of work. The names of its files and its warnings do not matter.
pub(crate) fn plan_name(
    shapes: &[Option<String>],
    model: &CadModel,
    request: &Request,
    work: u64,
) -> Option<String> {
    let shapes: Vec<&str> = shapes.iter().map(Option::as_deref).collect::<Option<_>>()?;
    let parts: Vec<_> = (model.parts.iter())
        .map(|part| (&part.name, part.shape, part.placement.to_cols_array()))
        .collect();
    Some(format!("plan-{}", hash(&(shapes, parts, request, work))?))
}

/// Name of a field of a shape, with finer bricks for these factors or without any.
pub(crate) fn field_name(
    shape: Option<&String>,
    choice: &Choice,
    tolerance_mm: f64,
    finer: Option<&[f64]>,
) -> Option<String> {
    let options = (
        choice.cell_mm,
        choice.band_cells,
        choice.format,
        choice.reach_mm(),
        tolerance_mm,
        finer,
    );
    Some(format!("field-{}", hash(&(shape?, options))?))
}

/// A field and its errors.
pub(crate) struct KeptField {
    pub field: BakedField,
    pub errors: Vec<FaceError>,
    /// Work that both took: a plan that takes it from the cache counts the same.
    pub work: u64,
    /// Whether the winding number was found to decide signs.
    pub by_winding: bool,
}

/// A field as stored: records by their bytes.
#[derive(Serialize, Deserialize)]
struct Stored {
    record: Vec<u8>,
    grid: Vec<u16>,
    bricks: Vec<u8>,
    palette: Vec<u16>,
    patches: Vec<u8>,
    free_form: FreeFormError,
    blob: Vec<u8>,
    counts: [usize; 5],
    unproven_at: Option<[f64; 3]>,
    rough_mm: f64,
    finer_bricks: usize,
    errors: Vec<FaceError>,
    work: u64,
    by_winding: bool,
}

impl KeptField {
    /// Its bytes.
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        let field = &self.field;
        let stored = Stored {
            record: bytemuck::bytes_of(&field.record).to_vec(),
            grid: field.grid.clone(),
            bricks: bytemuck::cast_slice(&field.bricks).to_vec(),
            palette: field.palette.clone(),
            patches: bytemuck::cast_slice(&field.patches).to_vec(),
            free_form: field.free_form,
            blob: field.blob.clone(),
            counts: [
                field.sample_bytes,
                field.stored_entries,
                field.sign_disagreements,
                field.sign_tests,
                field.unproven_cells,
            ],
            unproven_at: field.unproven_at.map(|p| p.to_array()),
            rough_mm: field.rough_mm,
            finer_bricks: field.finer_bricks,
            errors: self.errors.clone(),
            work: self.work,
            by_winding: self.by_winding,
        };
        postcard::to_stdvec(&stored).ok()
    }

    /// The field with these bytes; `None` when they are no field's of a shape with this many faces.
    pub fn from_bytes(bytes: &[u8], faces: usize) -> Option<Self> {
        let stored: Stored = postcard::from_bytes(bytes).ok()?;
        let [
            sample_bytes,
            stored_entries,
            sign_disagreements,
            sign_tests,
            unproven_cells,
        ] = stored.counts;
        let record: FieldRecord = *records(&stored.record)?.first()?;
        (stored.errors.len() == faces).then_some(Self {
            field: BakedField {
                record,
                grid: stored.grid,
                bricks: records::<BrickRecord>(&stored.bricks)?,
                palette: stored.palette,
                patches: records::<PatchRecord>(&stored.patches)?,
                free_form: stored.free_form,
                blob: stored.blob,
                sample_bytes,
                stored_entries,
                sign_disagreements,
                sign_tests,
                unproven_cells,
                unproven_at: stored.unproven_at.map(Into::into),
                rough_mm: stored.rough_mm,
                finer_bricks: stored.finer_bricks,
                // Only packing needs them.
                groups: Vec::new(),
            },
            errors: stored.errors,
            work: stored.work,
            by_winding: stored.by_winding,
        })
    }
}

fn records<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> Option<Vec<T>> {
    let each = bytes.chunks_exact(size_of::<T>());
    (each.remainder().is_empty()).then(|| each.map(bytemuck::pod_read_unaligned).collect())
}

/// The bytes of a finished plan.
pub(crate) fn plan_to_bytes(planned: &Planned) -> Option<Vec<u8>> {
    postcard::to_stdvec(planned).ok()
}

/// The plan with these bytes.
pub(crate) fn plan_from_bytes(bytes: &[u8]) -> Option<Planned> {
    postcard::from_bytes(bytes).ok()
}
