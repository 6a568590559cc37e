//! Keys of tree nodes for the tables of [`super::coherence`] and [`super::face_cache`].

/// Entries in the table of [`super::coherence`]. A power of two.
pub(super) const SLOTS: usize = 8192;
/// Nodes of a directed pair that can have keys, so that every tag fits 16 bits. A larger pair is searched without stored bounds in every tick.
pub(super) const NODES: u32 = (1 << PAIR_SHIFT) - SLOTS as u32 - 1;
/// log₂ of the distance between the first keys of consecutive pairs.
const PAIR_SHIFT: u32 = 20;
/// Directed pairs that can have keys; further ones are searched without stored bounds too.
pub(super) const PAIRS: u16 = 512;
/// Largest share of a node's distance that its bound uses: interpolated distances may change a little faster than the object travels where a brick
/// holds a sharp edge.
pub(super) const LONGEST_SHARE: f32 = 0.9;
/// Smallest share. The share depends on the node, so that the bounds of a ring of points at one distance do not all expire in one tick.
pub(crate) const SHORTEST_SHARE: f32 = 0.75;

/// Bit mask of the points of a leaf, the first point in the lowest bit. [`ALL`] selects all points, even of a leaf that has more points than the mask
/// has bits.
pub(crate) type Points = u16;
/// See [`Points`].
pub(crate) const ALL: Points = Points::MAX;

/// Keys of the nodes of one directed pair.
#[derive(Clone, Copy)]
pub(crate) struct Keys {
    first: u32,
    /// All bits set, or zero where the pair has no keys.
    mask: u32,
}

impl Keys {
    /// Keys of directed pair `pair` with `nodes` nodes.
    pub fn new(pair: u16, nodes: usize) -> Self {
        if nodes <= NODES as usize && pair < PAIRS {
            Self {
                first: (u32::from(pair) << PAIR_SHIFT) + 1,
                mask: u32::MAX,
            }
        } else {
            Self {
                first: Key::NONE.0,
                mask: 0,
            }
        }
    }

    /// Key of one node.
    #[inline(always)]
    pub fn of(self, node: u32) -> Key {
        Key(self.first + (node & self.mask))
    }
}

/// Key of one node of one directed pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Key(pub(super) u32);

impl Key {
    /// No node.
    pub const NONE: Self = Self(0);

    pub fn is_none(self) -> bool {
        self.0 == Self::NONE.0
    }

    pub fn slot(self) -> usize {
        // Neighbouring nodes fall into neighbouring slots; pairs are spread over the table.
        let pair = self.0 >> PAIR_SHIFT;
        (self.0 + 619 * pair) as usize % SLOTS
    }

    /// Distinguishes the key from others in the same slot; never equal to the tag of an empty slot.
    pub fn tag(self) -> u16 {
        (self.0 / SLOTS as u32) as u16 + 1
    }

    /// Multiplicative hash, Knuth's 2³²/φ: the upper bits are the better ones.
    #[inline(always)]
    pub fn hash(self) -> u32 {
        self.0.wrapping_mul(2_654_435_769)
    }

    /// Share of the node's distance that its bound uses: one of 256 values.
    pub fn share(self) -> f32 {
        let place = self.hash() >> 24;
        LONGEST_SHARE - (LONGEST_SHARE - SHORTEST_SHARE) * (1.0 / 255.0) * place as f32
    }
}
