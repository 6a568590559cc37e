//! From model to image: which shapes, which cells, in what order.

use std::ops::ControlFlow;

use mortise_brep::{CadModel, Shape, Surface};
use mortise_protocol::image::NO_FACE;
use mortise_protocol::limits::MAX_PARTS;

use crate::distance::ExactSurface;
use crate::error::BakeError;
use crate::field::{BakedField, FieldOptions, bake_field};
use crate::grid::bounding_box;
use crate::image::{ImageBuilder, PartPlacement};
use crate::options::{BakeOptions, Grabbable, Progress, Stage};
use crate::pointshell::{Pointshell, PointshellOptions, sample_pointshell};
use crate::report::{BakeReport, ByteCount, PartReport, ShapeReport};

/// A scene image and what is in it.
#[derive(Clone, Debug)]
pub struct Baked {
    /// The image's bytes.
    pub image: Vec<u8>,
    /// Bytes by part and kind, leaks, doubts.
    pub report: BakeReport,
}

/// Attempts at making an image fit when the cell is free to choose: each cuts the field's bytes by a third or more.
const ATTEMPTS: usize = 12;

/// Bakes `model` into a scene image. `progress` is called from any thread; it may stop the work with [`ControlFlow::Break`].
///
/// Parts without a surface are left out with a warning. Cost: see [`crate::bake_field`].
pub fn bake(
    model: &CadModel,
    options: &BakeOptions,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Baked, BakeError> {
    options.check()?;
    let scene = Scene::new(model, options)?;
    let mut prepared: Vec<ExactSurface> = scene
        .shapes
        .iter()
        .map(|&s| ExactSurface::new(&model.shapes[s]))
        .collect();
    let mut cells = scene.cells(model, options);
    let mut fields: Vec<Option<BakedField>> = prepared.iter().map(|_| None).collect();
    let shells = sample_shells(&scene, model, options, &prepared, progress)?;
    for attempt in 0.. {
        for (i, surface) in prepared.iter_mut().enumerate() {
            if fields[i].is_none() {
                fields[i] = Some(scene.field(i, surface, &mut cells[i], options, progress)?);
            }
        }
        let sizes: Vec<u64> = fields.iter().flatten().map(field_bytes).collect();
        let rest: u64 = shells.iter().map(|s| 25 * s.points.len() as u64).sum::<u64>() + 4096;
        let total = sizes.iter().sum::<u64>() + rest;
        let limit = options.image_limit_bytes;
        if total <= limit || options.cell_mm.is_some() || attempt >= ATTEMPTS {
            break;
        }
        // Bytes go with the inverse square of the cell. The shapes with more than their share are made coarser.
        let ratio = (total as f64 / limit as f64).sqrt().clamp(1.2, 2.0) * 1.02;
        let share = (limit / (2 * sizes.len() as u64)).min(sizes.iter().copied().max().unwrap_or(0));
        for (i, &size) in sizes.iter().enumerate() {
            if size >= share {
                cells[i] *= ratio;
                fields[i] = None;
            }
        }
    }
    let baked = scene.assemble(
        model,
        options,
        &prepared,
        fields.into_iter().flatten().collect(),
        &shells,
    )?;
    let _ = progress(Progress {
        stage: Stage::Image,
        part: "",
        shape: (scene.shapes.len(), scene.shapes.len()),
        fraction: 1.0,
    });
    Ok(baked)
}

fn field_bytes(field: &BakedField) -> u64 {
    (field.blob.len() + 2 * field.grid.len() + 16 * field.bricks.len() + 2 * field.palette.len()) as u64
}

fn sample_shells(
    scene: &Scene,
    model: &CadModel,
    options: &BakeOptions,
    prepared: &[ExactSurface],
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Vec<Pointshell>, BakeError> {
    let count = prepared.len();
    prepared
        .iter()
        .enumerate()
        .map(|(i, surface)| {
            let step = Progress {
                stage: Stage::Pointshell,
                part: &scene.names[i],
                shape: (i, count),
                fraction: 0.0,
            };
            if progress(step).is_break() {
                return Err(BakeError::Cancelled);
            }
            let longest = longest_side(&model.shapes[scene.shapes[i]]);
            Ok(sample_pointshell(
                surface,
                &PointshellOptions {
                    epsilon_mm: options.epsilon_mm,
                    max_spacing_mm: options.max_spacing_mm.unwrap_or(longest / 10.0).max(1e-3),
                },
            ))
        })
        .collect()
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
                    .unwrap_or_else(|| round_down_125((largest / 100.0).min(side / 20.0)).max(1e-3))
            })
            .collect()
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

    fn assemble(
        &self,
        model: &CadModel,
        options: &BakeOptions,
        prepared: &[ExactSurface],
        fields: Vec<BakedField>,
        shells: &[Pointshell],
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
