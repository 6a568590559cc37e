//! From model to image: fields and pointshells at the finest scale that fits, then the image and its report.

use std::ops::ControlFlow;

use mortise_brep::{CadModel, Surface};
use mortise_protocol::image::{FaceRecord, FieldRecord, Header, PartRecord, ShapeRecord};
use rayon::prelude::*;

use crate::classic::classic_pointshell;
use crate::convex::is_convex;
use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::{BakedField, bake_field};
use crate::format::FieldOptions;
use crate::image::{ImageBuilder, PALETTE_PADDING, PartPlacement, edge_bytes};
use crate::made::{EPSILON_PER_CELL, Made, field_bytes};
use crate::occupancy::bake_occupancy;
use crate::options::{BakeOptions, Method, PointshellKind, Progress, Stage};
use crate::overload::{overloads, round_fits};
use crate::partners::Partners;
use crate::pointshell::sample_pointshell;
use crate::report::{BakeReport, ByteCount, PartReport, ShapeReport};
use crate::scene::Scene;
use crate::shell::{Pointshell, PointshellOptions};
use crate::ticks::Ticks;

/// A scene image and what is in it.
#[derive(Clone, Debug)]
pub struct Baked {
    /// Bytes of the image.
    pub image: Vec<u8>,
    /// Bytes by part and kind, leaks, warnings.
    pub report: BakeReport,
}

/// Attempts to find the finest scale that fits.
const ATTEMPTS: usize = 12;
/// Scale of the first, coarse attempt when cells may be chosen freely: it costs a sixteenth of the work, and its byte count shows how far to refine.
const SCOUT: f64 = 4.0;
/// Times that the cell of a shape is halved so that its faces settle every cell.
const HALVINGS: usize = 2;
/// Default for the largest spacing along edges, in cells.
const MAX_SPACING_CELLS: f64 = 4.0;

/// Bakes `model` into a scene image. `progress` is called from any thread; it can stop the work with [`ControlFlow::Break`].
///
/// Parts without a surface are skipped with a warning. Cost: see [`crate::bake_field`]; about twice that when the cell may be chosen freely and the
/// image limit binds.
///
/// # Errors
/// See [`BakeError`].
pub fn bake(
    model: &CadModel,
    options: &BakeOptions,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Baked, BakeError> {
    options.check()?;
    let mut scene = Scene::new(model, options)?;
    let mut prepared: Vec<ExactSurface> = scene
        .shapes
        .par_iter()
        .map(|&s| ExactSurface::new(&model.shapes[s]))
        .collect();
    scene.find_partners(&prepared);
    scene.find_edges(&prepared, options);
    let first = scene.cells(model, options);
    let each = vec![options.clone(); scene.shapes.len()];
    let made = match options.cell_mm {
        Some(_) => scene.fields_and_shells(&each, &mut prepared, first, progress)?,
        None => {
            let made = scene.fit(model, &each, &mut prepared, &first, progress)?;
            scene.resolve(model, &each, &mut prepared, made, progress)?
        }
    };
    let surfaces: Vec<&ExactSurface> = prepared.iter().collect();
    let fits = round_fits(&scene, &prepared);
    let counted = Ticks {
        model,
        scene: &scene,
        surfaces: surfaces.clone(),
        fits: &fits,
    };
    let overloaded = overloads(&counted, &counted.of(&made), &each, &made);
    let mut baked = scene.assemble(model, &each, &surfaces, made)?;
    baked.report.warnings.extend(overloaded);
    let bytes = baked.image.len() as u64;
    if bytes > options.image_limit_bytes {
        let cell = baked.report.shapes.iter().map(|s| s.cell_mm).fold(0.0, f64::max);
        return Err(too_large(bytes, options.image_limit_bytes, cell));
    }
    scene.done(progress);
    Ok(baked)
}

fn too_large(bytes: u64, limit: u64, cell_mm: f64) -> BakeError {
    BakeError::TooLarge {
        bytes,
        limit,
        enough_mm: cell_mm * (bytes as f64 / limit.max(1) as f64).sqrt() * 1.05,
    }
}

impl Scene {
    /// Makes fields and pointshells, each shape by its own options, with cells of about these sizes (a size too small for the layout is enlarged when
    /// the cell may be chosen freely).
    pub fn fields_and_shells(
        &self,
        each: &[BakeOptions],
        prepared: &mut [ExactSurface],
        cells: Vec<f64>,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Made, BakeError> {
        let mut fields = Vec::new();
        let mut shells = Vec::new();
        for (i, (mut cell, options)) in cells.into_iter().zip(each).enumerate() {
            fields.push(self.field(i, &mut prepared[i], &mut cell, (options, None), progress)?);
            shells.push(self.shell(i, &prepared[i], &self.partners[i], cell, options, progress)?);
        }
        Ok(Made { fields, shells })
    }

    /// Makes new pointshells for existing fields; `sizes` are the smallest sizes that each resolves, mm.
    pub fn shells_again(
        &self,
        each: &[BakeOptions],
        prepared: &[&ExactSurface],
        sizes: &[f64],
        made: &mut Made,
    ) {
        let shells = sizes.par_iter().zip(each).enumerate();
        made.shells = shells
            .map(|(i, (&size, options))| {
                sample_pointshell(prepared[i], &shell_options(options, size, &self.partners[i]))
            })
            .collect();
    }

    /// Finds the finest scale, not finer than `first`, whose image fits. It goes from coarse to fine, because bytes grow at most with the inverse
    /// square of the cell.
    fn fit(
        &self,
        model: &CadModel,
        each: &[BakeOptions],
        prepared: &mut [ExactSurface],
        first: &[f64],
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Made, BakeError> {
        let fixed = self.fixed_bytes(model);
        let mut scale = SCOUT;
        // Exponent of the bytes in the inverse cell: 2 at most, less where bricks repeat; two attempts show the actual value.
        let mut power = 2.0;
        let mut best: Option<(f64, Made)> = None;
        let largest_cell = first.iter().copied().fold(0.0, f64::max);
        for _ in 0..ATTEMPTS {
            let cells = first.iter().map(|c| c * scale).collect();
            let quiet = |p: Progress| {
                progress(Progress {
                    shape: (0, p.shape.1),
                    fraction: 0.0,
                    ..p
                })
            };
            // Only the finest possible attempt moves the progress bar; earlier ones take a fraction of its time.
            let made = if scale <= 1.0 {
                self.fields_and_shells(each, prepared, cells, progress)?
            } else {
                self.fields_and_shells(each, prepared, cells, &quiet)?
            };
            let limit = each.iter().map(|o| o.image_limit_bytes).min().unwrap_or(u64::MAX);
            let room = limit as f64 / (made.bytes() + fixed) as f64;
            if room >= 1.0 {
                if let Some((coarser, before)) = &best {
                    let grown = (made.bytes() as f64 / before.bytes() as f64).ln();
                    power = (grown / (coarser / scale).ln()).clamp(1.0, 2.0);
                }
                best = Some((scale, made));
                // Aim a little below the limit: an attempt that overshoots is wasted.
                let next = (scale / (room * 0.97).max(1.0).powf(1.0 / power)).max(1.0);
                if next > 0.97 * scale {
                    break;
                }
                scale = next;
            } else if let Some((fitting, _)) = best {
                // Overshot: go back half of the way, as long as another attempt is worthwhile.
                scale = (scale * fitting).sqrt();
                power = 2.0;
                if scale > 0.95 * fitting {
                    break;
                }
            } else if scale * largest_cell > 1e3 {
                // Even cells of a metre are too large: parts and faces alone do not fit. The caller reports it.
                return Ok(made);
            } else {
                scale /= (room * 0.9).sqrt().min(0.8);
            }
        }
        match best {
            Some((_, made)) => Ok(made),
            None => {
                let cells = first.iter().map(|c| c * scale).collect();
                self.fields_and_shells(each, prepared, cells, progress)
            }
        }
    }

    /// Bytes of the image that do not depend on the cells.
    fn fixed_bytes(&self, model: &CadModel) -> u64 {
        let faces: usize = self.shapes.iter().map(|&s| model.shapes[s].faces.len()).sum();
        (size_of::<Header>()
            + 2 * PALETTE_PADDING
            + self.parts.len() * size_of::<PartRecord>()
            + self.shapes.len() * (size_of::<ShapeRecord>() + size_of::<FieldRecord>())
            + faces * size_of::<FaceRecord>()
            + self
                .edges
                .iter()
                .map(|pieces| edge_bytes(pieces.len()))
                .sum::<usize>()
            + 64) as u64
    }

    /// Halves the cell of shapes that have crossed cells without a proven rule, as long as the image still fits and it helps.
    fn resolve(
        &self,
        model: &CadModel,
        each: &[BakeOptions],
        prepared: &mut [ExactSurface],
        mut made: Made,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Made, BakeError> {
        let limit = each.iter().map(|o| o.image_limit_bytes).min().unwrap_or(u64::MAX);
        for (i, options) in each.iter().enumerate() {
            for _ in 0..HALVINGS {
                let before = made.fields[i].unproven_cells;
                // Bytes grow at most fourfold.
                let growth = 3 * field_bytes(&made.fields[i]);
                if before == 0 || self.fixed_bytes(model) + made.bytes() + growth > limit {
                    break;
                }
                let mut cell = f64::from(made.fields[i].record.cell) * 500.0;
                let field = self.field(i, &mut prepared[i], &mut cell, (options, None), progress)?;
                if 2 * field.unproven_cells >= before {
                    break;
                }
                let shell = self.shell(i, &prepared[i], &self.partners[i], cell, options, progress)?;
                let coarse = (
                    std::mem::replace(&mut made.fields[i], field),
                    std::mem::replace(&mut made.shells[i], shell),
                );
                if self.fixed_bytes(model) + made.bytes() > limit {
                    (made.fields[i], made.shells[i]) = coarse;
                    break;
                }
            }
        }
        Ok(made)
    }

    /// Makes the field of a shape, with cells of about this size (see [`Self::fields_and_shells`]), and finer bricks for these factors (see
    /// [`FieldOptions::finer`]).
    pub fn field(
        &self,
        index: usize,
        surface: &mut ExactSurface,
        cell_mm: &mut f64,
        (options, finer): (&BakeOptions, Option<&[f64]>),
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<BakedField, BakeError> {
        let part = self.names[index].as_str();
        let step = |done: usize, all: usize| {
            progress(Progress {
                stage: Stage::Field,
                part,
                shape: (index, self.shapes.len()),
                fraction: if all == 0 { 0.0 } else { done as f64 / all as f64 },
            })
        };
        loop {
            let field = FieldOptions {
                cell_mm: *cell_mm,
                band_cells: options.band_cells,
                format: options.format,
                patch_tolerance_mm: options.patch_tolerance_mm,
                samples: options.samples,
                finer,
            };
            let baked = match options.method {
                Method::DistanceField => bake_field(surface, &field, part, &step),
                Method::Occupancy => bake_occupancy(surface, *cell_mm, part, &step),
            };
            match baked {
                Err(BakeError::CellTooSmall { enough_mm, .. })
                    if options.cell_mm.is_none() && enough_mm > *cell_mm && enough_mm < 1e3 =>
                {
                    *cell_mm = enough_mm;
                }
                done => return done,
            }
        }
    }

    fn shell(
        &self,
        index: usize,
        surface: &ExactSurface,
        partners: &Partners,
        cell_mm: f64,
        options: &BakeOptions,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Pointshell, BakeError> {
        let step = Progress {
            stage: Stage::Pointshell,
            part: &self.names[index],
            shape: (index, self.shapes.len()),
            fraction: 0.0,
        };
        if progress(step).is_break() {
            return Err(BakeError::Cancelled);
        }
        match options.shell {
            PointshellKind::ErrorBounded => Ok(sample_pointshell(
                surface,
                &shell_options(options, cell_mm, partners),
            )),
            PointshellKind::Classic {
                voxel_mm,
                shrink_percent,
            } => {
                let mut own = self
                    .parts
                    .iter()
                    .zip(&self.grabbable)
                    .filter(|(part, _)| part.1 == index);
                if own.any(|(_, &grabbable)| grabbable) {
                    classic_pointshell(
                        surface,
                        voxel_mm.unwrap_or(cell_mm),
                        shrink_percent,
                        &self.names[index],
                    )
                } else {
                    Ok(Pointshell::default())
                }
            }
        }
    }

    /// Sends the final progress report.
    pub fn done(&self, progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync)) {
        let _ = progress(Progress {
            stage: Stage::Image,
            part: "",
            shape: (self.shapes.len(), self.shapes.len()),
            fraction: 1.0,
        });
    }

    /// Assembles the image, of any size whose offsets fit 32 bits.
    pub fn assemble(
        &self,
        model: &CadModel,
        each: &[BakeOptions],
        prepared: &[&ExactSurface],
        Made { fields, shells }: Made,
    ) -> Result<Baked, BakeError> {
        let mut builder = ImageBuilder::new();
        let mut report = BakeReport {
            warnings: self.warnings.clone(),
            ..BakeReport::default()
        };
        for (i, field) in fields.into_iter().enumerate() {
            let shape = prepared[i].shape();
            let mut entry = shape_report(&self.names[i], prepared[i], &field, &each[i], &shells[i]);
            report.warnings.extend(doubts(&entry));
            report.warnings.extend(unproven(&entry, &field));
            (_, entry.bytes) = {
                let convex = is_convex(prepared[i], &self.edges[i]);
                builder.add_shape(shape, field, &shells[i], &self.edges[i], convex)
            };
            report.bytes = add(&report.bytes, &entry.bytes);
            report.shapes.push(entry);
        }
        let mut seen = vec![false; self.shapes.len()];
        for (&(part, shape), &grabbable) in self.parts.iter().zip(&self.grabbable) {
            builder.add_part(&PartPlacement {
                shape: shape as u32,
                placement: model.parts[part].placement,
                grabbable,
            });
            report.parts.push(PartReport {
                name: model.parts[part].name.clone(),
                model_part: part,
                shape,
                grabbable,
                bytes: if std::mem::replace(&mut seen[shape], true) {
                    0
                } else {
                    report.shapes[shape].bytes.total()
                },
            });
        }
        let bytes = builder.len();
        let limit = u64::from(u32::MAX);
        if bytes > limit {
            let cell = report.shapes.iter().map(|s| s.cell_mm).fold(0.0, f64::max);
            return Err(too_large(bytes, limit, cell));
        }
        let image = builder.finish();
        report.image_bytes = image.len();
        Ok(Baked { image, report })
    }
}

fn shell_options(options: &BakeOptions, cell_mm: f64, partners: &Partners) -> PointshellOptions {
    let epsilon_mm = options.epsilon_mm.unwrap_or(cell_mm / EPSILON_PER_CELL);
    PointshellOptions {
        epsilon_mm,
        crossing_epsilon_mm: options.crossing_epsilon_mm.unwrap_or(epsilon_mm),
        // The field resolves nothing sharper than a cell: sharper features are sampled as if their radius were one cell.
        least_spacing_mm: (4.0 * epsilon_mm * cell_mm).sqrt(),
        max_spacing_mm: options.max_spacing_mm.unwrap_or(MAX_SPACING_CELLS * cell_mm),
        // Only one part's points query a voxmap, so they must cover the whole surface.
        partners: match options.method {
            Method::DistanceField => partners.clone(),
            Method::Occupancy => Partners::Unknown,
        },
    }
}

fn shape_report(
    name: &str,
    surface: &ExactSurface,
    field: &BakedField,
    options: &BakeOptions,
    shell: &Pointshell,
) -> ShapeReport {
    let shape = surface.shape();
    ShapeReport {
        name: name.to_owned(),
        cell_mm: f64::from(field.record.cell) * 1000.0,
        method: options.method,
        format: options.format,
        scale_mm: f64::from(field.record.scale) * 1000.0,
        brick_dims: field.record.brick_dims,
        stored_entries: field.stored_entries,
        bricks: field.bricks.len(),
        points: [shell.face_points, shell.edge_points, shell.corner_points],
        bytes: ByteCount::default(),
        open_edges: shape.open_edges,
        sign_by_winding: surface.sign_by_winding(),
        sign_tests: field.sign_tests,
        sign_disagreements: field.sign_disagreements,
        chord_error_mm: surface.chord_error_mm(),
        surface_error_mm: surface.surface_error_mm(),
        spline_faces: shape
            .faces
            .iter()
            .filter(|f| matches!(f.surface, Surface::Spline))
            .count(),
        free_form: field.free_form,
    }
}

fn doubts(shape: &ShapeReport) -> Vec<String> {
    let mut out = Vec::new();
    if shape.open_edges > 0 {
        out.push(format!(
            "part \"{}\" is not closed ({} open mesh edges): inside and outside are a best estimate near the gaps",
            shape.name, shape.open_edges
        ));
    } else if shape.sign_by_winding {
        out.push(format!(
            "part \"{}\" overlaps itself or touches itself along an edge: inside and outside come from the winding number ({} of {} tested points differed)",
            shape.name, shape.sign_disagreements, shape.sign_tests
        ));
    }
    out
}

/// Says that the sign is interpolated where edges are finer than the cells.
fn unproven(shape: &ShapeReport, field: &BakedField) -> Option<String> {
    let at = field.unproven_at?;
    Some(format!(
        "part \"{}\": in {} cells of {:.3} mm (one at {:.2} {:.2} {:.2} mm) its surface is only interpolated, because edges lie closer together than \
         the cells; contact there may be off by a cell: choose smaller cells or allow a larger image",
        shape.name, field.unproven_cells, shape.cell_mm, at.x, at.y, at.z
    ))
}

fn add(a: &ByteCount, b: &ByteCount) -> ByteCount {
    ByteCount {
        samples: a.samples + b.samples,
        indices: a.indices + b.indices,
        grid: a.grid + b.grid,
        bricks: a.bricks + b.bricks,
        palette: a.palette + b.palette,
        points: a.points + b.points,
        nodes: a.nodes + b.nodes,
        faces: a.faces + b.faces,
        edges: a.edges + b.edges,
        patches: a.patches + b.patches,
        records: a.records + b.records,
    }
}
