//! From STEP file to scene image, with exact surfaces and sample points for measuring.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use mortise_bake::{
    BakeError, BakeOptions, BakeReport, Effort, ExactSurface, Grabbable, NoCache, PointshellOptions, Request,
    bake, plan_within, sample_pointshell,
};
use mortise_brep::{CadModel, load_step};
use mortise_guide::{Guide, GuideSettings};

use crate::error::ScenarioError;
use crate::scenario::Scenario;

/// Chord error of the points at which penetration is measured, as a share of the part's radius: 5 µm on a part of 100 mm, a tenth of the 0.05 mm that
/// matter there.
const EPSILON: f64 = 1e-4;
/// Largest spacing of these points, as a share of the part's radius: 4 mm.
const SPACING: f64 = 0.08;

/// A baked scene with its geometry.
pub struct PreparedScene {
    /// The image.
    pub image: Vec<u8>,
    /// The geometry of the STEP file.
    pub model: CadModel,
    /// The baker's report.
    pub report: BakeReport,
    /// Index of the part to grab, in the image.
    pub part: u16,
    bodies: Vec<Body>,
    /// Penetration in closed form, if there is one.
    closed_form: Option<ClosedForm>,
}

/// Deepest point of either of two solids inside the other, mm, with the moving part's shape at a pose (mm, world); 0 without overlap.
pub type ClosedForm = Box<dyn Fn(&DAffine3) -> f64 + Send + Sync>;

/// A part with the geometry for measuring.
pub struct Body {
    /// Its exact surface, shape frame, mm.
    pub surface: ExactSurface,
    /// Points on its surface, shape frame, mm.
    pub points: Vec<DVec3>,
    /// Centre of its bounding sphere, shape frame, mm.
    pub center: DVec3,
    /// Radius of the bounding sphere, mm.
    pub radius: f64,
    /// Shape to world at its placement in the file, mm.
    pub placement: DAffine3,
}

impl PreparedScene {
    /// Reads, bakes, and samples the scene of `scenario`.
    ///
    /// # Errors
    /// `Brep`, `Bake`, `NoSuchPart`.
    pub fn of(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let options = BakeOptions {
            method: scenario.scene.method,
            shell: scenario.scene.pointshell(),
            cell_mm: scenario.scene.cell_mm,
            grabbable: Grabbable::Named(vec![scenario.scene.part.clone()]),
            ..BakeOptions::default()
        };
        Self::with(scenario, &options)
    }

    /// As [`Self::of`], but baked with `options` instead of the scenario's own.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn with(scenario: &Scenario, options: &BakeOptions) -> Result<Self, ScenarioError> {
        let model = load_step(&scenario.scene.step)?;
        Self::bake(&scenario.scene.step, model, &scenario.scene.part, options)
    }

    /// Bakes and samples a model that was read before, and perhaps rearranged; `step` names it in errors, `part` is the one to grab.
    ///
    /// # Errors
    /// `Bake`, `NoSuchPart`.
    pub fn bake(
        step: &Path,
        model: CadModel,
        part: &str,
        options: &BakeOptions,
    ) -> Result<Self, ScenarioError> {
        named(step, &model, part)?;
        let baked =
            bake(&model, options, &|_| ControlFlow::Continue(())).map_err(|source| refused(step, source))?;
        Self::of_image(step, model, part, baked.image, baked.report)
    }

    /// As [`Self::bake`], but planned: the smallest image within `request`'s accuracy. The work ends a plan, never the clock: else a machine that does other
    /// things as well would play another scene.
    ///
    /// # Errors
    /// `Bake`, `NoSuchPart`.
    pub fn plan(step: &Path, model: CadModel, part: &str, request: &Request) -> Result<Self, ScenarioError> {
        named(step, &model, part)?;
        let effort = Effort {
            time: Duration::MAX,
            ..Effort::default()
        };
        let planned = plan_within(&model, request, effort, &NoCache, &|_| ControlFlow::Continue(()))
            .map_err(|source| refused(step, source))?;
        Self::of_image(step, model, part, planned.image, planned.plan.report)
    }

    fn of_image(
        step: &Path,
        model: CadModel,
        part: &str,
        image: Vec<u8>,
        report: BakeReport,
    ) -> Result<Self, ScenarioError> {
        let index = report.parts.iter().position(|baked| baked.name == part);
        let Some(index) = index.and_then(|index| u16::try_from(index).ok()) else {
            return Err(ScenarioError::NoSuchPart {
                step: step.display().to_string(),
                part: part.to_owned(),
                known: "parts, but this one has no surface".into(),
            });
        };
        let bodies = (report.parts.iter())
            .map(|baked| Body::of(&model, baked.model_part))
            .collect();
        Ok(Self {
            image,
            model,
            report,
            part: index,
            bodies,
            closed_form: None,
        })
    }

    /// The same scene with penetration in closed form, which runs then measure.
    pub fn with_closed_form(self, closed_form: ClosedForm) -> Self {
        Self {
            closed_form: Some(closed_form),
            ..self
        }
    }

    /// See [`Self::with_closed_form`].
    pub(crate) fn closed_form(&self) -> Option<&ClosedForm> {
        self.closed_form.as_ref()
    }

    /// Placement of the moving part in the file: its shape to world, mm.
    pub fn placement(&self) -> DAffine3 {
        let part = self.bodies.get(usize::from(self.part));
        part.map(|part| part.placement).unwrap_or_default()
    }

    /// The guide that recognises and sends constraints in this scene.
    pub fn guide(&self, settings: GuideSettings) -> Guide<'_> {
        let parts = self.report.parts.iter().map(|part| part.model_part).collect();
        Guide::new(&self.model, parts, settings)
    }

    /// Its parts, in the image's order.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Index in the image of the part of this name.
    pub fn part_named(&self, name: &str) -> Option<usize> {
        self.report.parts.iter().position(|part| part.name == name)
    }
}

/// Refuses a model that has no part of this name.
fn named(step: &Path, model: &CadModel, part: &str) -> Result<(), ScenarioError> {
    if model.parts.iter().any(|known| known.name == part) {
        return Ok(());
    }
    let known: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
    Err(ScenarioError::NoSuchPart {
        step: step.display().to_string(),
        part: part.to_owned(),
        known: known.join(", "),
    })
}

fn refused(step: &Path, source: BakeError) -> ScenarioError {
    ScenarioError::Bake {
        step: step.display().to_string(),
        source,
    }
}

impl Body {
    /// Part `part` of `model`.
    pub fn of(model: &CadModel, part: usize) -> Self {
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
        Self {
            surface,
            points,
            center,
            radius,
            placement: part.placement,
        }
    }
}
