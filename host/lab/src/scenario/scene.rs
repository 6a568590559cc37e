//! From STEP file to scene image, with what measuring needs beside it: exact surfaces and sample points.

use std::ops::ControlFlow;
use std::path::Path;

use glam::{DAffine3, DVec3};
use mortise_bake::{
    BakeOptions, BakeReport, ExactSurface, Grabbable, PointshellOptions, bake, sample_pointshell,
};
use mortise_brep::{CadModel, load_step};
use mortise_guide::{Guide, GuideSettings};

use super::Scenario;
use crate::error::LabError;
use crate::exact_fit::ExactFit;
use crate::fit::Fit;

/// Chord error of the points that penetration is measured at, as a share of the part's radius: 5 µm on a part of 100 mm, a tenth of the 0.05 mm that
/// matter there.
const EPSILON: f64 = 1e-4;
/// Their largest spacing, likewise: 4 mm.
const SPACING: f64 = 0.08;

/// A baked scene with its geometry.
pub struct PreparedScene {
    /// The image.
    pub image: Vec<u8>,
    /// The geometry it came from.
    pub model: CadModel,
    /// What was baked.
    pub report: BakeReport,
    /// Index of the part to grab, in the image.
    pub part: u16,
    bodies: Vec<Body>,
    /// Its two parts in closed form, where they are a peg and a block.
    closed_form: Option<ExactFit>,
}

/// A part as measuring sees it.
pub(crate) struct Body {
    pub(crate) surface: ExactSurface,
    /// Points on its surface, shape frame, mm.
    pub(crate) points: Vec<DVec3>,
    /// Sphere about it, shape frame, mm.
    pub(crate) center: DVec3,
    pub(crate) radius: f64,
    pub(crate) placement: DAffine3,
}

impl PreparedScene {
    /// Reads, bakes, and samples the scene of `scenario`.
    ///
    /// # Errors
    /// `Brep`, `Bake`, `NoSuchPart`.
    pub fn of(scenario: &Scenario) -> Result<Self, LabError> {
        let options = BakeOptions {
            method: scenario.scene.method,
            shell: scenario.scene.pointshell(),
            cell_mm: scenario.scene.cell_mm,
            grabbable: Grabbable::Named(vec![scenario.scene.part.clone()]),
            ..BakeOptions::default()
        };
        Self::with(scenario, &options)
    }

    /// As [`Self::of`], baked as `options` say, whatever the scenario does.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn with(scenario: &Scenario, options: &BakeOptions) -> Result<Self, LabError> {
        let model = load_step(&scenario.scene.step)?;
        Self::bake(&scenario.scene.step, model, &scenario.scene.part, options)
    }

    fn bake(step: &Path, model: CadModel, part: &str, options: &BakeOptions) -> Result<Self, LabError> {
        let name = || step.display().to_string();
        if !model.parts.iter().any(|known| known.name == part) {
            let known: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
            return Err(LabError::NoSuchPart {
                step: name(),
                part: part.to_owned(),
                known: known.join(", "),
            });
        }
        let baked = bake(&model, options, &|_| ControlFlow::Continue(()))
            .map_err(|source| LabError::Bake { step: name(), source })?;
        let index = baked.report.parts.iter().position(|baked| baked.name == part);
        let Some(index) = index.and_then(|index| u16::try_from(index).ok()) else {
            return Err(LabError::NoSuchPart {
                step: name(),
                part: part.to_owned(),
                known: "parts, but this one has no surface".into(),
            });
        };
        let bodies = (baked.report.parts.iter())
            .map(|baked| body(&model, baked.model_part))
            .collect();
        Ok(Self {
            image: baked.image,
            model,
            report: baked.report,
            part: index,
            bodies,
            closed_form: None,
        })
    }

    /// The same, known to be made from `fit`: penetration is then measured in closed form.
    pub(crate) fn made_from(self, fit: Fit) -> Self {
        let exact = self.exact_fit(fit);
        Self {
            closed_form: Some(exact),
            ..self
        }
    }

    /// The peg and the hole of `fit`, from which this scene was made, in closed form.
    pub(crate) fn exact_fit(&self, fit: Fit) -> ExactFit {
        let placed = self.bodies.get(usize::from(self.part)).map(|part| part.placement);
        ExactFit::new(fit, placed.unwrap_or_default())
    }

    /// See [`Self::made_from`].
    pub(crate) fn closed_form(&self) -> Option<&ExactFit> {
        self.closed_form.as_ref()
    }

    /// What recognises and sends constraints in this scene.
    pub fn guide(&self, settings: GuideSettings) -> Guide<'_> {
        let parts = self.report.parts.iter().map(|part| part.model_part).collect();
        Guide::new(&self.model, parts, settings)
    }

    pub(crate) fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Index in the image of the part named so.
    pub(crate) fn part_named(&self, name: &str) -> Option<usize> {
        self.report.parts.iter().position(|part| part.name == name)
    }
}

fn body(model: &CadModel, part: usize) -> Body {
    let part = &model.parts[part];
    let surface = ExactSurface::new(&model.shapes[part.shape]);
    let vertices = &surface.shape().mesh.vertices;
    let (low, high) = vertices
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &vertex| {
            (low.min(vertex), high.max(vertex))
        });
    let center = 0.5 * (low + high);
    let radius = vertices.iter().map(|v| v.distance(center)).fold(0.0, f64::max);
    let options = PointshellOptions::everywhere(EPSILON * radius, SPACING * radius);
    let points: Vec<DVec3> = (sample_pointshell(&surface, &options).points.iter())
        .map(|point| point.position)
        .collect();
    Body {
        surface,
        points,
        center,
        radius,
        placement: part.placement,
    }
}
