//! Measured error of a field near free-form faces.

use serde::{Deserialize, Serialize};

use crate::cell_samples::Place;
use crate::cover::NEAR_CELLS;

/// Errors at places near free-form faces and in cells without a rule that no patch was fitted to: five in each cell near such a face, as far as they are within
/// 0.6 cells of the surface. Where the board's distance is only a bound (outside a convex edge) there is no error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FreeFormError {
    /// Places measured.
    pub places: usize,
    /// Places where no surface answers, so that the distance is interpolated.
    pub interpolated: usize,
    /// Largest error where surfaces answer, mm.
    pub by_surfaces_mm: f64,
    /// Largest error where the distance is interpolated, mm, except at edges.
    pub interpolated_mm: f64,
    /// Largest error where the distance is interpolated in a cell next to which another face is nearest, mm.
    pub at_edges_mm: f64,
    /// Largest error of all these kinds near faces that may err more than the others, mm.
    pub elsewhere_mm: f64,
}

/// What gives the distance at a place.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum AnsweredBy {
    /// Exact surfaces and patches.
    Surfaces,
    /// Interpolation.
    Samples,
    /// Interpolation in a cell beside which another face is nearest.
    SamplesAtEdge,
}

impl FreeFormError {
    /// Adds the error at a place whose face may err more than others, or not.
    pub(crate) fn add(
        &mut self,
        place: &Place,
        cell_mm: f64,
        rendered: Option<f64>,
        (by, may_err_more): (AnsweredBy, bool),
    ) {
        let Some(rendered) = rendered.filter(|_| place.exact.distance.abs() <= NEAR_CELLS * cell_mm) else {
            return;
        };
        let error = (rendered - place.exact.distance).abs();
        self.places += 1;
        let worst = match by {
            _ if may_err_more => &mut self.elsewhere_mm,
            AnsweredBy::Surfaces => &mut self.by_surfaces_mm,
            AnsweredBy::Samples => &mut self.interpolated_mm,
            AnsweredBy::SamplesAtEdge => &mut self.at_edges_mm,
        };
        *worst = worst.max(error);
        self.interpolated += usize::from(by != AnsweredBy::Surfaces);
    }

    /// Both together.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            places: self.places + other.places,
            interpolated: self.interpolated + other.interpolated,
            by_surfaces_mm: self.by_surfaces_mm.max(other.by_surfaces_mm),
            interpolated_mm: self.interpolated_mm.max(other.interpolated_mm),
            at_edges_mm: self.at_edges_mm.max(other.at_edges_mm),
            elsewhere_mm: self.elsewhere_mm.max(other.elsewhere_mm),
        }
    }

    /// Largest error away from edges, mm.
    pub fn worst_mm(&self) -> f64 {
        self.by_surfaces_mm.max(self.interpolated_mm)
    }
}
