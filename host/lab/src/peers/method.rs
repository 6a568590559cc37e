//! What a method answers over the poses of a scene, whoever it is.

/// How a method represents the parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A distance field and features of ours.
    Ours,
    /// Triangles under a tree of boxes.
    Triangles,
    /// Convex hulls.
    Hulls,
    /// Distance fields of the meshes.
    Fields,
}

impl Kind {
    /// All kinds with their names in legends.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Ours, "distance field, ours"),
        (Self::Triangles, "triangles under a tree"),
        (Self::Hulls, "convex hulls"),
        (Self::Fields, "distance fields of meshes"),
    ];
}

/// The answer at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// True if the parts overlap.
    pub overlaps: bool,
    /// Signed distance, mm; absent where the method tells only the sign, or a bound.
    pub mm: Option<f64>,
    /// Shortest time of the query, µs.
    pub us: f64,
}

/// A method and its answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Who answers.
    pub peer: String,
    /// The method, unique in a scene and run.
    pub name: String,
    /// How it represents the parts.
    pub kind: Kind,
    /// Its version; absent for ours.
    pub version: Option<String>,
    /// Time of the same call for two balls, µs: the least that the way through Python allows.
    pub floor_us: Option<f64>,
    /// Largest deviation of the meshes from the surfaces, mm, and their triangles; absent for ours.
    pub mesh: Option<(f64, usize)>,
    /// Bytes of the image; absent for peers.
    pub image_bytes: Option<usize>,
    /// Answers in the order of the scene's poses.
    pub answers: Vec<Answer>,
}

/// A method, or one that cannot be had.
#[derive(Clone, Debug, PartialEq)]
pub enum Asked {
    /// It answered every pose.
    Answered(Method),
    /// It did not.
    Skipped {
        /// Who.
        peer: String,
        /// The method, or the peer where not even its methods are known.
        name: String,
        /// Why, in words.
        reason: String,
    },
}
