//! An image made for an accuracy, and by how much it exceeds its limits.

use crate::bake::Baked;
use crate::plan::{ELSEWHERE, Limit, Plan};

/// Factor by which the accuracy is lowered where finer bricks take too many bytes: these fall slowly with the accuracy.
const COARSER_WHERE_FINER: f64 = 8.0;

/// Size and cost of an attempt as multiples of their limits.
#[derive(Clone, Copy)]
pub(crate) struct Over {
    pub bytes: f64,
    pub instructions: f64,
    /// Whether finer bricks are part of the bytes.
    pub finer: bool,
}

/// Excess assumed for an attempt that the layout itself cannot hold.
pub(crate) const HOPELESS: Over = Over {
    bytes: 4.0,
    instructions: 1.0,
    finer: false,
};

impl Over {
    pub fn fits(self) -> bool {
        self.bytes <= 1.0 && self.instructions <= 1.0
    }

    /// Factor by which to lower the accuracy: bytes grow at most with its inverse, points with the square root of its inverse.
    pub fn coarser(self) -> f64 {
        if self.finer && self.bytes > 1.0 {
            return COARSER_WHERE_FINER;
        }
        (1.05 * self.bytes)
            .max(1.1 * self.instructions * self.instructions)
            .clamp(1.25, 8.0)
    }

    pub fn limit(self) -> Limit {
        if self.bytes >= self.instructions {
            Limit::Bytes
        } else {
            Limit::Tick
        }
    }
}

/// An image for an accuracy.
pub(crate) struct Attempt {
    pub baked: Baked,
    pub plan: Plan,
    pub over: Over,
    /// What keeps a shape from the accuracy, if anything.
    pub limit: Option<Limit>,
}

impl Attempt {
    /// The accuracy in fits that it reaches, mm.
    pub fn reached_mm(&self) -> f64 {
        let plan = &self.plan;
        plan.error_in_fits_mm().max(plan.error_elsewhere_mm() / ELSEWHERE)
    }

    /// Whether work or time ended the search of its fields.
    pub fn is_ended(&self) -> bool {
        matches!(self.limit, Some(Limit::Work | Limit::Time))
    }
}

/// Result of trying an accuracy.
pub(crate) enum Tried {
    /// An image, which may not fit.
    Image(Box<Attempt>),
    /// The fields alone are too large.
    Over(Over),
}

impl Tried {
    pub fn over(&self) -> Over {
        match self {
            Self::Image(attempt) => attempt.over,
            Self::Over(over) => *over,
        }
    }
}

/// The attempt that reaches the finer accuracy.
pub(crate) fn better(best: Option<Box<Attempt>>, attempt: Box<Attempt>) -> Option<Box<Attempt>> {
    match best {
        Some(best) if best.reached_mm() <= attempt.reached_mm() => Some(best),
        _ => Some(attempt),
    }
}
