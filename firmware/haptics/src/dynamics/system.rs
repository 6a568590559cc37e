//! The linear system of one solve.

use crate::math::symmetric6::Symmetric6;

/// `matrix`·x = `right` for the scaled twist x = (v, ω·L) at the step's end, kg and kg m/s.
#[derive(Clone, Debug)]
pub(crate) struct System {
    pub matrix: Symmetric6,
    pub right: [f32; 6],
}

impl System {
    #[inline]
    pub fn solve(&self) -> [f32; 6] {
        self.matrix.solve(&self.right)
    }
}
