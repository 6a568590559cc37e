//! Errors of the fit finder.

/// Why no search was possible.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The model has no part of this name.
    #[error("no part `{part}`; the file has {known}")]
    NoSuchPart {
        /// The requested name.
        part: String,
        /// Names of the parts.
        known: String,
    },
    /// Both names are the same part.
    #[error("`{part}` cannot fit itself; choose two parts")]
    SamePart {
        /// The part.
        part: String,
    },
    /// A part has no surface to search on.
    #[error("`{part}` has no closed surface; repair it where it was modelled, or choose another part")]
    Open {
        /// The part.
        part: String,
    },
}
