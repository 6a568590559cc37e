//! Constraints between surfaces of two parts: the one list of kinds from recogniser to force law.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::limits::MAX_TARGET_PAIRS;

/// Declares [`ConstraintKind`] and, from the same list, every variant of it and its name.
macro_rules! constraint_kinds {
    ($(#[$about:meta])+ pub enum ConstraintKind { $($(#[$doc:meta])+ $name:ident = $word:literal,)+ }) => {
        $(#[$about])+
        pub enum ConstraintKind {
            $($(#[$doc])+ $name,)+
        }

        impl ConstraintKind {
            /// Every kind, in the order of the enum.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$name),+];

            /// Name of the kind. Both annular kinds have the same name: it does not say which part has the sphere.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $word,)+
                }
            }
        }
    };
}

constraint_kinds! {
    /// Kinds of constraint between a surface of the grabbed part and one of another part: the recogniser's, the link's and the force law's.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
    pub enum ConstraintKind {
        /// Axis on axis (cylinder in cylinder). Leaves a slide and a rotation.
        Concentric = "concentric",
        /// Plane on plane, face to face: turns the grabbed part until the planes are parallel; contact determines the distance. Leaves two slides and a
        /// rotation.
        Coplanar = "coplanar",
        /// Axis on axis and apex on apex, so that circles of one radius coincide (cone in cone). Leaves a rotation.
        Conical = "conical",
        /// Centre on centre (sphere in sphere). Leaves three rotations.
        Spherical = "spherical",
        /// Centre on axis: sphere of the grabbed part in a cylinder of the other. Leaves a slide and three rotations.
        Annular = "annular",
        /// Axis on centre: cylinder of the grabbed part over a sphere of the other. Leaves a slide and three rotations.
        AnnularBore = "annular",
        /// Along the way on which two parts of any shape fit: axis on axis, and the orientation of the fit, see [`Path`]. Leaves a slide, or a screw.
        Path = "path",
    }
}

/// A point and a direction fixed to a part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Feature {
    /// Position, m, shape frame.
    pub point: [f32; 3],
    /// Unit vector, shape frame.
    pub direction: [f32; 3],
}

/// What a target of kind [`ConstraintKind::Path`] holds beside its axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Path {
    /// Orientation of the grabbed part in the other part's frame where the points of both features meet: a unit quaternion x, y, z, w.
    pub orientation: [f32; 4],
    /// Rotation about the axis.
    pub turn: PathTurn,
    /// Whether the way ends where the points meet: beyond it the target holds the part back.
    pub ends: bool,
}

/// Rotation about the axis of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum PathTurn {
    /// Free, as of a round part.
    Free,
    /// In proportion to the travel along the axis, rad/m: 0 on a straight way, 2π over the pitch on a screw, positive for a right-hand thread.
    Geared(f32),
}

/// A constraint recognised by the desktop program, towards which the board guides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct ConstraintTarget {
    /// Identifies the target; a message with the same id replaces or refreshes it.
    pub id: u16,
    /// Increases with every message about this id; a lower one is stale.
    pub sequence: u16,
    /// Kind.
    pub kind: ConstraintKind,
    /// Feature of the moving part.
    pub moving: Feature,
    /// Index of the mating part.
    pub static_part: u16,
    /// Feature of that part.
    pub fixed: Feature,
    /// Stiffness, N/m.
    pub stiffness: f32,
    /// Largest guidance force, N.
    pub force_cap: f32,
    /// Largest guidance torque, N·m.
    pub torque_cap: f32,
    /// The target fades out unless refreshed within this many ticks.
    pub expiry_ticks: u16,
    /// Orientation, rotation and end of a path; `None` for all other kinds.
    pub path: Option<Path>,
    /// Moving and static faces whose contact the target replaces.
    pub faces: Vec<(u16, u16), MAX_TARGET_PAIRS>,
}
