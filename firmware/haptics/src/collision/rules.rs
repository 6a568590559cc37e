//! Interface through which constraints affect contact between two faces.

use heapless::Vec;
use mortise_protocol::image::NO_FACE;
use mortise_protocol::limits::MAX_TARGETS;

/// Capacity for excluded face pairs towards one part; pairs beyond it are searched as usual.
pub(crate) const MAX_EXCLUDED: usize = 2 * MAX_TARGETS;

/// Face pairs that contact exclusions towards one part keep apart: face of the tree's shape, face of the field's shape.
pub(crate) type ExcludedPairs = Vec<[u16; 2], MAX_EXCLUDED>;

/// Effect of guidance on the contact between two faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mating {
    /// Whether a target guides this face pair.
    pub guided: bool,
    /// Allowance added to every gap of the pair, m.
    pub allowance_m: f32,
}

impl Mating {
    /// No target.
    pub const NONE: Self = Self {
        guided: false,
        allowance_m: 0.0,
    };
}

/// Cache of the last faces and their [`Mating`]: consecutive points mostly lie on the same faces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MatingCache {
    part: u16,
    moving: [u16; 2],
    fixed: [u16; 2],
    mating: Mating,
}

impl MatingCache {
    /// No faces.
    pub const NONE: Self = Self {
        part: u16::MAX,
        moving: [NO_FACE; 2],
        fixed: [NO_FACE; 2],
        mating: Mating::NONE,
    };

    /// [`Mating`] of these faces; queries `rules` only when the faces differ from the last ones.
    #[inline]
    pub fn get(
        &mut self,
        rules: &impl FacePairRules,
        part: u16,
        moving: [u16; 2],
        fixed: [u16; 2],
    ) -> Mating {
        if (self.part, self.moving, self.fixed) != (part, moving, fixed) {
            *self = Self {
                part,
                moving,
                fixed,
                mating: rules.mating(part, moving, fixed),
            };
        }
        self.mating
    }
}

/// Rules of the constraints in force for contact between faces. The search queries them; the constraint layer implements them.
pub(crate) trait FacePairRules {
    /// Whether any rule concerns this part.
    fn concerns(&self, part: u16) -> bool;

    /// Face pairs of the held part and this part that cannot touch. The face of the tree's shape comes first: the held part's, unless `backward`.
    fn excluded(&self, part: u16, backward: bool) -> ExcludedPairs;

    /// Effect of guidance on contact between these faces. `moving` and `fixed` hold the face, and the second face where the point lies on an edge.
    fn mating(&self, part: u16, moving: [u16; 2], fixed: [u16; 2]) -> Mating;
}

/// No constraints.
pub(crate) struct NoRules;

impl FacePairRules for NoRules {
    fn concerns(&self, _: u16) -> bool {
        false
    }

    fn excluded(&self, _: u16, _: bool) -> ExcludedPairs {
        ExcludedPairs::new()
    }

    fn mating(&self, _: u16, _: [u16; 2], _: [u16; 2]) -> Mating {
        Mating::NONE
    }
}

/// Whether a point on these faces lies on `face`.
pub(crate) fn holds(faces: [u16; 2], face: u16) -> bool {
    face != NO_FACE && (faces[0] == face || faces[1] == face)
}
