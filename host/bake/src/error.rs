//! Why a model could not be baked.

/// Why a model could not be baked: the cause, its place, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// No part of the model has a surface.
    #[error("nothing to bake: none of the {parts} parts has a surface; open a file with solids or shells")]
    NothingToBake {
        /// Number of parts in the model.
        parts: usize,
    },
    /// More parts than a scene can hold.
    #[error("{parts} parts, but a scene holds at most {limit}: leave out parts that cannot be touched")]
    TooManyParts {
        /// Number of parts in the model.
        parts: usize,
        /// Most parts a scene can hold.
        limit: usize,
    },
    /// More faces than an image can number.
    #[error("part \"{part}\" has {faces} faces, but a shape holds at most {limit}: simplify it or split it")]
    TooManyFaces {
        /// Part with this shape.
        part: String,
        /// Faces of its shape.
        faces: usize,
        /// Most faces a shape can have.
        limit: usize,
    },
    /// Geometry with NaN or infinite values, or indices out of range.
    #[error("part \"{part}\" has broken geometry ({what}): repair or re-export it")]
    BrokenGeometry {
        /// Part with the broken geometry.
        part: String,
        /// Description of the fault.
        what: String,
    },
    /// An option out of range.
    #[error("{option} = {value:?} is out of range: give {expected}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Value given.
        value: f64,
        /// Allowed values.
        expected: &'static str,
    },
    /// A part named in the options is not in the model.
    #[error("no part is named \"{name}\"; the model has: {known}")]
    UnknownPart {
        /// Name given.
        name: String,
        /// Names in the model.
        known: String,
    },
    /// The requested cell needs more bricks or grid entries than the layout can number.
    #[error(
        "part \"{part}\" is too large for {cell_mm} mm cells ({what}): use cells of at least {enough_mm:.3} mm"
    )]
    CellTooSmall {
        /// Part whose field is too large.
        part: String,
        /// Cell tried, mm.
        cell_mm: f64,
        /// Limit exceeded.
        what: String,
        /// Cell that is expected to fit, mm.
        enough_mm: f64,
    },
    /// The image does not fit.
    #[error(
        "scene image of {bytes} bytes does not fit into {limit}: use cells of about {enough_mm:.3} mm, int8 samples, or fewer parts"
    )]
    TooLarge {
        /// Bytes the image would have.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
        /// Cell that is expected to fit, mm.
        enough_mm: f64,
    },
    /// The progress callback requested a stop.
    #[error("baking was cancelled")]
    Cancelled,
}
