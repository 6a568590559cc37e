//! Selection of the shapes and parts of a model for the image, and the initial choice of their cells.

use std::collections::BTreeSet;

use mortise_brep::{CadModel, Shape};
use mortise_protocol::image::NO_FACE;
use mortise_protocol::limits::MAX_PARTS;
use rayon::prelude::*;

use crate::distance::ExactSurface;
use crate::edges::{EdgePiece, FINEST, coarser, edge_pieces};
use crate::error::BakeError;
use crate::grid::bounding_box;
use crate::image::edge_bytes;
use crate::options::{BakeOptions, Grabbable, Method};
use crate::partners::{Met, Partners};

/// Largest share of the image that pieces of edges may take.
const MOST_OF_IMAGE: f64 = 1.0 / 3.0;
/// Times that edges are divided into half as many pieces at most: then they are within a tenth of a millimetre.
const COARSER: usize = 2;

/// Shapes and parts of a model that go into the image.
pub(crate) struct Scene {
    /// Model shapes, each listed once.
    pub shapes: Vec<usize>,
    /// First part with each shape.
    pub names: Vec<String>,
    /// For each part its index in the model and its index into `shapes`.
    pub parts: Vec<(usize, usize)>,
    /// Whether each of `parts` may be grabbed.
    pub grabbable: Vec<bool>,
    /// Partners of each of `shapes`.
    pub partners: Vec<Partners>,
    /// Pieces of the sharp convex edges of each shape; none for voxmaps, whose method knows no edges.
    pub edges: Vec<Vec<EdgePiece>>,
    /// Skipped parts, as text.
    pub warnings: Vec<String>,
}

impl Scene {
    /// Selects and checks the shapes and parts.
    pub fn new(model: &CadModel, options: &BakeOptions) -> Result<Self, BakeError> {
        let mut scene = Self {
            shapes: Vec::new(),
            names: Vec::new(),
            parts: Vec::new(),
            grabbable: Vec::new(),
            partners: Vec::new(),
            edges: Vec::new(),
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

    /// Finds what each shape can meet: the other parts of the scene, if at least one of the two may be grabbed, or a second part of the same shape.
    pub fn find_partners(&mut self, prepared: &[ExactSurface]) {
        let each: Vec<Met> = prepared.par_iter().map(Met::of).collect();
        let of = |shape: usize| {
            Partners::Known(Met::all(self.met_by(shape).into_iter().map(|other| &each[other])))
        };
        self.partners = (0..self.shapes.len()).map(of).collect();
    }

    /// Finds the pieces of edges for contact of edges with edges: as fine as the exact edges are known, or coarser, with a warning, where they would
    /// take more than [`MOST_OF_IMAGE`] of the image.
    pub fn find_edges(&mut self, prepared: &[ExactSurface], options: &BakeOptions) {
        if options.method == Method::Occupancy {
            self.edges = prepared.iter().map(|_| Vec::new()).collect();
            return;
        }
        let mut fineness = FINEST;
        for attempt in 0..=COARSER {
            self.edges = (prepared.par_iter())
                .map(|surface| edge_pieces(surface, fineness))
                .collect();
            let bytes: usize = self.edges.iter().map(|pieces| edge_bytes(pieces.len())).sum();
            if attempt == COARSER || bytes as f64 <= MOST_OF_IMAGE * options.image_limit_bytes as f64 {
                break;
            }
            fineness = coarser(fineness);
        }
        if fineness != FINEST {
            self.warnings.push(format!(
                "edges are stored within {:.0} µm only, so that they leave space for the rest: allow a larger image",
                1000.0 * fineness.tolerance_mm
            ));
        }
    }

    /// Shapes whose parts can meet a part of this shape.
    pub fn met_by(&self, shape: usize) -> BTreeSet<usize> {
        let mut met = BTreeSet::new();
        for (i, &(_, own)) in self.parts.iter().enumerate() {
            for (j, &(_, other)) in self.parts.iter().enumerate() {
                if own == shape && i != j && (self.grabbable[i] || self.grabbable[j]) {
                    met.insert(other);
                }
            }
        }
        met
    }

    fn choose_grabbable(&self, model: &CadModel, rule: &Grabbable) -> Result<Vec<bool>, BakeError> {
        let name = |&(part, _): &(usize, usize)| model.parts[part].name.as_str();
        match rule {
            Grabbable::All => Ok(vec![true; self.parts.len()]),
            Grabbable::AllButLargest => {
                let volume = |i: usize| model.shapes[self.shapes[self.parts[i].1]].volume_mm3.abs();
                // The first of equally large parts.
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

    /// Initial cell for each shape, mm.
    pub fn cells(&self, model: &CadModel, options: &BakeOptions) -> Vec<f64> {
        let sides = self.shapes.iter().map(|&s| longest_side(&model.shapes[s]));
        let largest = sides.clone().fold(0.0, f64::max);
        let own = |name: &String| (options.part_cells_mm.iter()).find(|(part, _)| part == name);
        sides
            .zip(&self.names)
            .map(|(side, name)| {
                own(name)
                    .map(|(_, cell)| *cell)
                    .or(options.cell_mm)
                    .unwrap_or_else(|| round_down_125((largest / 100.0).min(side / 20.0)).clamp(1e-3, 1e3))
            })
            .collect()
    }
}

/// Longest side of the bounding box of a shape, mm.
pub(crate) fn longest_side(shape: &Shape) -> f64 {
    let (lo, hi) = bounding_box(shape);
    (hi - lo).max_element().max(1e-3)
}

/// The largest of 1, 2, 5 × 10ⁿ not above `x`.
fn round_down_125(x: f64) -> f64 {
    let decade = 10f64.powf(x.log10().floor());
    let digit = x / decade;
    // Tolerance for rounding of the logarithm: 0.5 must not become 0.2.
    let step = if digit >= 5.0 - 1e-9 {
        5.0
    } else if digit >= 2.0 - 1e-9 {
        2.0
    } else {
        1.0
    };
    step * decade
}

/// Rejects geometry that distance queries cannot handle: indices out of range, coordinates that are not finite.
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

/// Whether two shapes have the same geometry in the same frame, so that they can share one set of data.
fn same_shape(a: &Shape, b: &Shape) -> bool {
    // Exporters repeat a body with different last digits: positions within a nanometre are equal.
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
