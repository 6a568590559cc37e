//! What constraints say about contact between two faces.

use heapless::Vec;
use mortise_protocol::image::NO_FACE;
use mortise_protocol::limits::MAX_TARGETS;

/// Pairs of exclusions to one part; of more, the rest stay in the work.
pub(crate) const MAX_EXCLUDED: usize = 2 * MAX_TARGETS;

/// Face pairs that exclusions to one part keep apart: of the tree's shape, of the field's.
pub(crate) type ExcludedPairs = Vec<[u16; 2], MAX_EXCLUDED>;

/// What contact between two faces has to know of guidance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mating {
    /// Whether a target owns the pair.
    pub guided: bool,
    /// Gaps count for larger by this, m.
    pub allowance_m: f32,
}

impl Mating {
    /// No target.
    pub const NONE: Self = Self {
        guided: false,
        allowance_m: 0.0,
    };
}

/// Faces at a point, and what guidance says of them: points that follow each other mostly have the same.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mated {
    part: u16,
    moving: [u16; 2],
    fixed: [u16; 2],
    mating: Mating,
}

impl Mated {
    /// No faces.
    pub const NONE: Self = Self {
        part: u16::MAX,
        moving: [NO_FACE; 2],
        fixed: [NO_FACE; 2],
        mating: Mating::NONE,
    };

    /// What `rules` say of these faces: asked only when they differ from the last.
    #[inline]
    pub fn look_up(
        &mut self,
        rules: &dyn FacePairRules,
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

/// What the constraints in force say about contact between faces: asked by the search, answered by a layer above it.
pub(crate) trait FacePairRules {
    /// Whether any rule is about this part.
    fn concerns(&self, part: u16) -> bool;

    /// Pairs of faces of the held part and this one that cannot touch: those of the tree's shape first, which is the held one unless `backward`.
    fn excluded(&self, part: u16, backward: bool) -> ExcludedPairs;

    /// Contact between these faces: `moving` and `fixed` name the face, and the other one where the point lies on an edge.
    fn mating(&self, part: u16, moving: [u16; 2], fixed: [u16; 2]) -> Mating;

    /// No [`Mating::room`] is larger, m.
    fn max_allowance_m(&self) -> f32;
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

    fn max_allowance_m(&self) -> f32 {
        0.0
    }
}

/// Whether a point that lies on these faces lies on this one.
pub(crate) fn holds(faces: [u16; 2], face: u16) -> bool {
    face != NO_FACE && (faces[0] == face || faces[1] == face)
}
