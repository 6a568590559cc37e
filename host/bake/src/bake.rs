//! From model to image: which shapes, which cells, in what order.

use std::ops::ControlFlow;

use mortise_brep::{CadModel, Shape, Surface};
use mortise_protocol::image::{
    BrickRecord, FaceRecord, FieldRecord, Header, NO_FACE, NodeRecord, PartRecord, PointRecord, ShapeRecord,
};
use mortise_protocol::limits::MAX_PARTS;
use rayon::prelude::*;

use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::{BakedField, FieldOptions, bake_field};
use crate::grid::bounding_box;
use crate::image::{ImageBuilder, PALETTE_PADDING, PartPlacement};
use crate::options::{BakeOptions, Grabbable, Progress, Stage};
use crate::pointshell::{Pointshell, PointshellOptions, sample_pointshell};
use crate::report::{BakeReport, ByteCount, PartReport, ShapeReport};
use crate::tree::node_count;

/// A scene image and what is in it.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The image's bytes.
    pub image: Vec<u8>,
    /// Bytes by part and kind, leaks, doubts.
    pub report: BakeReport,
}

/// Attempts at the largest scale that fits.
const ATTEMPTS: usize = 12;
/// The first, coarse attempt at a scene whose cells are free to choose: a sixteenth of the work, and its bytes tell how far to refine.
const SCOUT: f64 = 4.0;
/// Cells in the pointshell's default error bound. Field and shell err alike, as spacing²/(8R): a fiftieth of a cell is what the field
/// leaves at R = 6 cells, so neither is finer than the other is worth on the radii that matter.
const EPSILON_PER_CELL: f64 = 50.0;

/// Bakes `model` into a scene image. `progress` is called from any thread; it may stop the work with [`ControlFlow::Break`].
///
/// Parts without a surface are left out with a warning. Cost: see [`crate::bake_field`]; when the cell is free to choose and the image
/// limit binds, about twice that.
///
/// # Errors
/// See [`BakeError`].
pub fn bake(
    model: &CadModel,
    options: &BakeOptions,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Baked, BakeError> {
    options.check()?;
    let scene = Scene::new(model, options)?;
    let mut prepared: Vec<ExactSurface> = scene
        .shapes
        .par_iter()
        .map(|&s| ExactSurface::new(&model.shapes[s]))
        .collect();
    let first = scene.cells(model, options);
    let made = match options.cell_mm {
        Some(_) => scene.fields_and_shells(model, options, &mut prepared, first, progress)?,
        None => scene.fit(model, options, &mut prepared, &first, progress)?,
    };
    let baked = scene.assemble(model, options, &prepared, made)?;
    let _ = progress(Progress {
        stage: Stage::Image,
        part: "",
        shape: (scene.shapes.len(), scene.shapes.len()),
        fraction: 1.0,
    });
    Ok(baked)
}

/// What is made of each shape.
struct Made {
    fields: Vec<BakedField>,
    shells: Vec<Pointshell>,
}

impl Made {
    /// Bytes it takes in the image, parts and header apart.
    fn bytes(&self) -> u64 {
        let shells = self.shells.iter().map(|shell| {
            let points = shell.points.len();
            (points * size_of::<PointRecord>() + node_count(points) * size_of::<NodeRecord>()) as u64
        });
        self.fields.iter().map(field_bytes).chain(shells).sum()
    }
}

fn field_bytes(field: &BakedField) -> u64 {
    let bricks = field.bricks.len() * size_of::<BrickRecord>();
    // Alignment of the blob and of the grid: less than 8 bytes.
    (field.blob.len() + 2 * field.grid.len() + bricks + 2 * field.palette.len() + 8) as u64
}

fn longest_side(shape: &Shape) -> f64 {
    let (lo, hi) = bounding_box(shape);
    (hi - lo).max_element().max(1e-3)
}

/// Which shapes and parts of a model go into the image.
struct Scene {
    /// Model shapes, each once.
    shapes: Vec<usize>,
    /// First part of each.
    names: Vec<String>,
    /// Model part and index into `shapes`.
    parts: Vec<(usize, usize)>,
    grabbable: Vec<bool>,
    warnings: Vec<String>,
}

impl Scene {
    fn new(model: &CadModel, options: &BakeOptions) -> Result<Self, BakeError> {
        let mut scene = Self {
            shapes: Vec::new(),
            names: Vec::new(),
            parts: Vec::new(),
            grabbable: Vec::new(),
            warnings: Vec::new(),
        };
        for (index, part) in model.parts.iter().enumerate() {
            let shape = model
                .shapes
                .get(part.shape)
                .ok_or_else(|| BakeError::BrokenGeometry {
                    part: part.name.clone(),
                    what: format!("shape {} does not exist", part.shape),
                })?;
            if shape.mesh.triangles.is_empty() {
                scene
                    .warnings
                    .push(format!("part \"{}\" has no surface and is left out", part.name));
                continue;
            }
            check_shape(shape, &part.name)?;
            if !part.placement.is_finite() {
                return Err(BakeError::BrokenGeometry {
                    part: part.name.clone(),
                    what: "its placement is not finite".to_owned(),
                });
            }
            let known = scene
                .shapes
                .iter()
                .position(|&s| s == part.shape || same_shape(&model.shapes[s], shape));
            let number = known.unwrap_or_else(|| {
                scene.shapes.push(part.shape);
                scene.names.push(part.name.clone());
                scene.shapes.len() - 1
            });
            scene.parts.push((index, number));
        }
        if scene.parts.is_empty() {
            return Err(BakeError::NothingToBake {
                parts: model.parts.len(),
            });
        }
        if scene.parts.len() > MAX_PARTS {
            return Err(BakeError::TooManyParts {
                parts: scene.parts.len(),
                limit: MAX_PARTS,
            });
        }
        scene.grabbable = scene.choose_grabbable(model, &options.grabbable)?;
        Ok(scene)
    }

    fn choose_grabbable(&self, model: &CadModel, rule: &Grabbable) -> Result<Vec<bool>, BakeError> {
        let name = |&(part, _): &(usize, usize)| model.parts[part].name.as_str();
        match rule {
            Grabbable::All => Ok(vec![true; self.parts.len()]),
            Grabbable::AllButLargest => {
                let volume = |i: usize| model.shapes[self.shapes[self.parts[i].1]].volume_mm3.abs();
                // The first of equals.
                let largest = (0..self.parts.len())
                    .rev()
                    .max_by(|&a, &b| volume(a).total_cmp(&volume(b)));
                Ok((0..self.parts.len())
                    .map(|i| self.parts.len() == 1 || Some(i) != largest)
                    .collect())
            }
            Grabbable::Named(names) => {
                for wanted in names {
                    if !self.parts.iter().any(|p| name(p) == wanted) {
                        return Err(BakeError::UnknownPart {
                            name: wanted.clone(),
                            known: self.parts.iter().map(name).collect::<Vec<_>>().join(", "),
                        });
                    }
                }
                Ok(self
                    .parts
                    .iter()
                    .map(|p| names.iter().any(|n| n == name(p)))
                    .collect())
            }
        }
    }

    /// First choice of cell for each shape, mm.
    fn cells(&self, model: &CadModel, options: &BakeOptions) -> Vec<f64> {
        let sides = self.shapes.iter().map(|&s| longest_side(&model.shapes[s]));
        let largest = sides.clone().fold(0.0, f64::max);
        sides
            .map(|side| {
                options
                    .cell_mm
                    .unwrap_or_else(|| round_down_125((largest / 100.0).min(side / 20.0)).clamp(1e-3, 1e3))
            })
            .collect()
    }

    /// Fields and pointshells with cells of about these sizes (a size too small for the layout is made larger when the choice is free).
    fn fields_and_shells(
        &self,
        model: &CadModel,
        options: &BakeOptions,
        prepared: &mut [ExactSurface],
        cells: Vec<f64>,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Made, BakeError> {
        let mut fields = Vec::new();
        let mut shells = Vec::new();
        for (i, mut cell) in cells.into_iter().enumerate() {
            fields.push(self.field(i, &mut prepared[i], &mut cell, options, progress)?);
            shells.push(self.shell(i, model, &prepared[i], cell, options, progress)?);
        }
        Ok(Made { fields, shells })
    }

    /// The finest scale, not finer than `first`, whose image fits: from coarse to fine, as bytes grow at most with the inverse square of
    /// the cell.
    fn fit(
        &self,
        model: &CadModel,
        options: &BakeOptions,
        prepared: &mut [ExactSurface],
        first: &[f64],
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Made, BakeError> {
        let faces: usize = self.shapes.iter().map(|&s| model.shapes[s].faces.len()).sum();
        let fixed = (size_of::<Header>()
            + 2 * PALETTE_PADDING
            + self.parts.len() * size_of::<PartRecord>()
            + self.shapes.len() * (size_of::<ShapeRecord>() + size_of::<FieldRecord>())
            + faces * size_of::<FaceRecord>()
            + 64) as u64;
        let mut scale = SCOUT;
        // How bytes grow with the inverse of the cell: at most as its square; less where bricks repeat, which two attempts show.
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
            // Only the finest attempt there can be moves the bar; the ones before take a fraction of its time.
            let made = if scale <= 1.0 {
                self.fields_and_shells(model, options, prepared, cells, progress)?
            } else {
                self.fields_and_shells(model, options, prepared, cells, &quiet)?
            };
            let room = options.image_limit_bytes as f64 / (made.bytes() + fixed) as f64;
            if room >= 1.0 {
                if let Some((coarser, before)) = &best {
                    let grown = (made.bytes() as f64 / before.bytes() as f64).ln();
                    power = (grown / (coarser / scale).ln()).clamp(1.0, 2.0);
                }
                best = Some((scale, made));
                // A little less than the room there is: an attempt that overshoots is wasted.
                let next = (scale / (room * 0.97).max(1.0).powf(1.0 / power)).max(1.0);
                if next > 0.97 * scale {
                    break;
                }
                scale = next;
            } else if let Some((fitting, _)) = best {
                // Overshot: back half of the way, as long as that is worth another attempt.
                scale = (scale * fitting).sqrt();
                power = 2.0;
                if scale > 0.95 * fitting {
                    break;
                }
            } else if scale * largest_cell > 1e3 {
                // Cells of a metre and still too large: parts and faces alone do not fit. The caller says so.
                return Ok(made);
            } else {
                scale /= (room * 0.9).sqrt().min(0.8);
            }
        }
        match best {
            Some((_, made)) => Ok(made),
            None => {
                let cells = first.iter().map(|c| c * scale).collect();
                self.fields_and_shells(model, options, prepared, cells, progress)
            }
        }
    }

    fn field(
        &self,
        index: usize,
        surface: &mut ExactSurface,
        cell_mm: &mut f64,
        options: &BakeOptions,
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
            };
            match bake_field(surface, &field, part, &step) {
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
        model: &CadModel,
        surface: &ExactSurface,
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
        let longest = longest_side(&model.shapes[self.shapes[index]]);
        Ok(sample_pointshell(
            surface,
            &PointshellOptions {
                epsilon_mm: options.epsilon_mm.unwrap_or(cell_mm / EPSILON_PER_CELL),
                max_spacing_mm: options.max_spacing_mm.unwrap_or(longest / 10.0).max(1e-3),
            },
        ))
    }

    fn assemble(
        &self,
        model: &CadModel,
        options: &BakeOptions,
        prepared: &[ExactSurface],
        Made { fields, shells }: Made,
    ) -> Result<Baked, BakeError> {
        let mut builder = ImageBuilder::new();
        let mut report = BakeReport {
            warnings: self.warnings.clone(),
            ..BakeReport::default()
        };
        for (i, field) in fields.into_iter().enumerate() {
            let shape = prepared[i].shape();
            let mut entry = shape_report(&self.names[i], &prepared[i], &field, options, &shells[i]);
            report.warnings.extend(doubts(&entry));
            (_, entry.bytes) = builder.add_shape(shape, field, &shells[i]);
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
        let limit = options.image_limit_bytes.min(u64::from(u32::MAX));
        if bytes > limit {
            let cell = report.shapes.iter().map(|s| s.cell_mm).fold(0.0, f64::max);
            return Err(BakeError::TooLarge {
                bytes,
                limit,
                enough_mm: cell * (bytes as f64 / limit.max(1) as f64).sqrt() * 1.05,
            });
        }
        let image = builder.finish();
        report.image_bytes = image.len();
        Ok(Baked { image, report })
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
        spline_faces: shape
            .faces
            .iter()
            .filter(|f| matches!(f.surface, Surface::Spline))
            .count(),
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
        records: a.records + b.records,
    }
}

/// The largest of 1, 2, 5 × 10ⁿ not above `x`.
fn round_down_125(x: f64) -> f64 {
    let decade = 10f64.powf(x.log10().floor());
    let digit = x / decade;
    // A hair of slack: 0.5 must not become 0.2 by rounding of the logarithm.
    let step = if digit >= 5.0 - 1e-9 {
        5.0
    } else if digit >= 2.0 - 1e-9 {
        2.0
    } else {
        1.0
    };
    step * decade
}

/// Refuses geometry the distance cannot work on: indices that lead nowhere, coordinates that are not finite.
fn check_shape(shape: &Shape, part: &str) -> Result<(), BakeError> {
    let broken = |what: &str| {
        Err(BakeError::BrokenGeometry {
            part: part.to_owned(),
            what: what.to_owned(),
        })
    };
    let mesh = &shape.mesh;
    if shape.faces.len() >= usize::from(NO_FACE) {
        return Err(BakeError::TooManyFaces {
            part: part.to_owned(),
            faces: shape.faces.len(),
            limit: usize::from(NO_FACE) - 1,
        });
    }
    if mesh.triangle_face.len() != mesh.triangles.len() {
        return broken("not every triangle has a face");
    }
    if mesh
        .triangle_face
        .iter()
        .any(|&f| f as usize >= shape.faces.len())
    {
        return broken("a triangle belongs to a face that does not exist");
    }
    if mesh
        .triangles
        .iter()
        .flatten()
        .any(|&v| v as usize >= mesh.vertices.len())
    {
        return broken("a triangle has a corner that does not exist");
    }
    if mesh.vertices.iter().any(|v| !v.is_finite()) {
        return broken("a mesh vertex is not finite");
    }
    if mesh.triangles.iter().all(|&[a, b, c]| a == b || b == c || c == a) {
        return broken("all its triangles are degenerate");
    }
    if !shape.volume_mm3.is_finite()
        || !shape.center_of_mass.is_finite()
        || shape.inertia_mm5.iter().flatten().any(|v| !v.is_finite())
    {
        return broken("its volume, centre of mass or inertia is not finite");
    }
    Ok(())
}

/// Whether two shapes have the same geometry in the same frame, so that one set of data does for both.
fn same_shape(a: &Shape, b: &Shape) -> bool {
    // Exporters repeat a body with the last digits different: a nanometre is the same place.
    const SAME_MM: f64 = 1e-6;
    a.mesh.triangles == b.mesh.triangles
        && a.mesh.triangle_face == b.mesh.triangle_face
        && a.faces.len() == b.faces.len()
        && a.closed == b.closed
        && a.mesh.vertices.len() == b.mesh.vertices.len()
        && a.mesh
            .vertices
            .iter()
            .zip(&b.mesh.vertices)
            .all(|(p, q)| p.distance(*q) <= SAME_MM)
        && a.faces.iter().zip(&b.faces).all(|(f, g)| {
            f.reversed == g.reversed
                && std::mem::discriminant(&f.surface) == std::mem::discriminant(&g.surface)
        })
}
