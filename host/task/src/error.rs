//! Errors.

/// Why a question about an assembly has no answer.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// No part of this name.
    #[error("no part `{name}`; the parts are {known}")]
    NoSuchPart {
        /// Name as given.
        name: String,
        /// Names of the parts.
        known: String,
    },
    /// Several parts end with this name.
    #[error("`{name}` is the name of {count} parts; give the full name")]
    Ambiguous {
        /// Name as given.
        name: String,
        /// Number of parts.
        count: usize,
    },
    /// A catalogue of an assembly.
    #[error("catalogue: {what}")]
    Catalogue {
        /// What is wrong.
        what: String,
    },
    /// A file with fewer than two parts.
    #[error("one part is not an assembly; give a file with at least two parts")]
    OnePart,
    /// A part whose shape has no triangles.
    #[error("part `{name}` has no surface; repair it in the CAD program and export it again")]
    Empty {
        /// Name of the part.
        name: String,
    },
}
