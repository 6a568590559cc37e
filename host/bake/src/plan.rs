//! A request for a scene image, and the plan that answers it.

use serde::{Deserialize, Serialize};

use crate::cost::TickCost;
use crate::format::SampleFormat;
use crate::options::Grabbable;
use crate::report::BakeReport;

/// Factor by which errors may be larger on faces that fit nothing.
pub const ELSEWHERE: f64 = 10.0;

/// Bytes of a scene slot of the smallest board.
pub const SLOT_BYTES: u64 = 512 << 10;
/// Accuracy in fits where none is requested, mm.
const DEFAULT_ACCURACY_MM: f64 = 0.01;

/// Request for a scene image. By default 10 µm in fits, in a slot of the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Largest error of gaps and depths where parts fit into one another, mm; elsewhere [`ELSEWHERE`] times that.
    pub accuracy_mm: f64,
    /// Largest size of the image in bytes.
    pub flash_bytes: u64,
    /// Most instructions of the worst-case tick; `None`: no limit.
    pub tick_instructions: Option<u64>,
    /// Parts that may be grabbed.
    pub grabbable: Grabbable,
}

impl Default for Request {
    fn default() -> Self {
        Self {
            accuracy_mm: DEFAULT_ACCURACY_MM,
            flash_bytes: SLOT_BYTES,
            tick_instructions: None,
            grabbable: Grabbable::default(),
        }
    }
}

/// Model chosen for a shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShapePlan {
    /// First part with this shape.
    pub name: String,
    /// Cell edge, mm.
    pub cell_mm: f64,
    /// Number format.
    pub format: SampleFormat,
    /// Depth and height to which the surface's neighbourhood is stored, cells.
    pub band_cells: f64,
    /// Distance from the surface up to which the stated errors of the field hold, mm: touching parts are nearer than that.
    pub reach_mm: f64,
    /// Error bound of the shell, mm.
    pub epsilon_mm: f64,
    /// Error bound of the shell where convex faces touch each other away from every edge, mm: larger only where the requested tick requires it.
    pub crossing_epsilon_mm: f64,
    /// Largest error of the field at the faces that fit another shape's and at flats, their edges included, mm.
    pub field_error_in_fits_mm: f64,
    /// Largest error of the shell there, mm.
    pub shell_error_in_fits_mm: f64,
    /// Largest combined error of field and shell anywhere, edges included, mm.
    pub error_elsewhere_mm: f64,
    /// Largest error where the distance is interpolated within a cell of another face, mm, by measurement; 0 where surfaces answer everywhere.
    #[serde(default)]
    pub error_at_edges_mm: f64,
    /// Faces that fit another part's.
    pub faces_that_fit: Vec<u32>,
    /// Faces too sharply curved to resolve: the field's error there is up to half a cell, and not in the errors stated.
    pub faces_taken_as_edges: Vec<u32>,
    /// Unreachable faces.
    pub faces_left_out: Vec<u32>,
    /// Reason why the cell cannot be larger.
    pub why: String,
}

/// Cost of holding a part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartTick {
    /// The part.
    pub name: String,
    /// Its worst-case tick.
    pub cost: TickCost,
}

/// Model chosen for an accuracy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Accuracy of the plan, mm.
    pub accuracy_mm: f64,
    /// In the image's order.
    pub shapes: Vec<ShapePlan>,
    /// Parts that may be grabbed, the costliest first.
    pub ticks: Vec<PartTick>,
    /// Bytes by part and kind.
    pub report: BakeReport,
}

impl Plan {
    /// Largest error of field and shell where parts fit into one another, mm.
    pub fn error_in_fits_mm(&self) -> f64 {
        let shapes = self.shapes.iter();
        let errors = shapes.map(|shape| shape.field_error_in_fits_mm + shape.shell_error_in_fits_mm);
        errors.fold(0.0, f64::max)
    }

    /// Largest error of field and shell elsewhere, mm.
    pub fn error_elsewhere_mm(&self) -> f64 {
        let shapes = self.shapes.iter().map(|shape| shape.error_elsewhere_mm);
        shapes.fold(0.0, f64::max)
    }

    /// The shape with the largest error, by what is allowed in fits and elsewhere.
    pub(crate) fn least_accurate(&self) -> String {
        let error = |shape: &ShapePlan| {
            let in_fits = shape.field_error_in_fits_mm + shape.shell_error_in_fits_mm;
            in_fits.max(shape.error_elsewhere_mm / ELSEWHERE)
        };
        let worst = (self.shapes.iter()).max_by(|a, b| error(a).total_cmp(&error(b)));
        worst.map(|shape| shape.name.clone()).unwrap_or_default()
    }

    /// Whether the stated errors are within an accuracy in fits, and [`ELSEWHERE`] times that elsewhere.
    pub fn meets(&self, accuracy_mm: f64) -> bool {
        let most = accuracy_mm * (1.0 + 1e-9);
        self.error_in_fits_mm() <= most && self.error_elsewhere_mm() <= ELSEWHERE * most
    }
}

/// What keeps a plan from being more accurate.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Limit {
    /// The requested accuracy is met: nothing more was asked.
    Accuracy,
    /// The size of the image.
    Bytes,
    /// The instructions of a tick.
    Tick,
    /// The surface of this part: finer cells did not help.
    Shape(String),
    /// The work of planning: what was found by then.
    Work,
    /// The time for planning, on a slow machine: another run may find more.
    Time,
}

/// Result of a request.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Planned {
    /// Whether the request is met: if not, this is the finest plan found that fits, or, if nothing fits, the smallest one.
    pub met: bool,
    /// Whether it fits flash and tick.
    pub fits: bool,
    /// What keeps it from being more accurate.
    pub limit: Limit,
    /// The plan.
    pub plan: Plan,
    /// Image of the plan.
    pub image: Vec<u8>,
}

impl Planned {
    /// What was reached and what limits it, in one line.
    pub fn reached(&self, request: &Request) -> String {
        let um = |mm: f64| {
            let um = 1000.0 * mm;
            if um < 100.0 {
                format!("{um:.1} µm")
            } else {
                format!("{um:.0} µm")
            }
        };
        let plan = &self.plan;
        let errors = format!(
            "{} where parts fit and {} elsewhere",
            um(plan.error_in_fits_mm()),
            um(plan.error_elsewhere_mm())
        );
        let of = match request.tick_instructions {
            Some(most) => {
                let cost = plan.ticks.first().map_or(0, |tick| tick.cost.instructions);
                format!(
                    "{} of {} bytes and about {cost} of {most} instructions",
                    plan.report.image_bytes, request.flash_bytes
                )
            }
            None => format!("{} of {} bytes", plan.report.image_bytes, request.flash_bytes),
        };
        if !self.fits {
            return format!("no model fits: the smallest found, with {errors}, takes {of}");
        }
        let asked = um(request.accuracy_mm);
        let why = match &self.limit {
            Limit::Accuracy => format!("{asked} was asked"),
            Limit::Bytes => format!("{asked} was asked; limited by the size"),
            Limit::Tick => format!("{asked} was asked; limited by the tick"),
            Limit::Shape(part) => format!("{asked} was asked; limited by the surface of \"{part}\""),
            Limit::Work => format!("{asked} was asked; limited by the work of planning"),
            Limit::Time => format!("{asked} was asked; limited by the time for planning"),
        };
        format!("{errors} in {of}: {why}")
    }
}
