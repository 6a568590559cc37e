//! The user's choices of fits.

/// The user's choice of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FitChoice {
    /// Kept in the list, with priority.
    pub pinned: bool,
    /// Kept from guiding.
    pub off: bool,
}
