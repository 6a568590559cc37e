//! Why a model could not be baked.

/// Why a model could not be baked: what, where, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// No part of the model has a surface.
    #[error("nothing to bake: none of the {parts} parts has a surface; open a file with solids or shells")]
    NothingToBake {
        /// Parts in the model.
        parts: usize,
    },
    /// More parts than a scene may have.
    #[error("{parts} parts, but a scene holds at most {limit}: leave out parts that cannot be touched")]
    TooManyParts {
        /// Parts in the model.
        parts: usize,
        /// Most a scene may have.
        limit: usize,
    },
    /// More faces than an image can number.
    #[error("part \"{part}\" has {faces} faces, but a shape holds at most {limit}: simplify it or split it")]
    TooManyFaces {
        /// Part it was found in.
        part: String,
        /// Faces of its shape.
        faces: usize,
        /// Most a shape may have.
        limit: usize,
    },
    /// Geometry with NaN or infinity in it, or indices that lead nowhere.
    #[error("part \"{part}\" has broken geometry ({what}): repair or re-export it")]
    BrokenGeometry {
        /// Part it was found in.
        part: String,
        /// What is wrong with it.
        what: String,
    },
    /// An option that makes no sense.
    #[error("{option} = {value} is out of range: give {expected}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What was given.
        value: f64,
        /// What may be given.
        expected: &'static str,
    },
    /// A part named in the options is not in the model.
    #[error("no part is named \"{name}\"; the model has: {known}")]
    UnknownPart {
        /// Name asked for.
        name: String,
        /// Names there are.
        known: String,
    },
    /// The cell asked for needs more bricks or grid entries than the layout can number.
    #[error(
        "part \"{part}\" is too large for {cell_mm} mm cells ({what}): use cells of at least {enough_mm:.3} mm"
    )]
    CellTooSmall {
        /// Part whose field is too large.
        part: String,
        /// Cell tried, mm.
        cell_mm: f64,
        /// Which limit.
        what: String,
        /// Cell expected to do, mm.
        enough_mm: f64,
    },
    /// The image does not fit.
    #[error(
        "scene image of {bytes} bytes does not fit into {limit}: use cells of about {enough_mm:.3} mm, int8 samples, or fewer parts"
    )]
    TooLarge {
        /// Bytes it would have.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
        /// Cell expected to do, mm.
        enough_mm: f64,
    },
    /// The progress callback asked to stop.
    #[error("baking was cancelled")]
    Cancelled,
}
