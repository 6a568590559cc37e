//! Keys of tree nodes, by which [`super::coherence`] and [`super::face_cache`] store what is known of them.

/// Entries in the table of [`super::coherence`]. A power of two.
pub(super) const SLOTS: usize = 8192;
/// A pair of more nodes is looked at whole every tick. So every tag fits 16 bits.
pub(super) const NODES: u32 = (1 << PAIR_SHIFT) - SLOTS as u32 - 1;
/// Keys of pairs lie so many bits apart.
const PAIR_SHIFT: u32 = 20;
/// Jobs that can be told apart; further ones likewise.
pub(super) const PAIRS: u16 = 512;
/// How much of its distance a node is left alone for, at most: interpolated distances may change a little faster than the object travels where
/// a brick holds a sharp edge.
pub(super) const LONGEST_SHARE: f32 = 0.9;
/// And at least. Between the two it depends on the node, so that a ring of points at one distance does not become due in one tick.
pub(crate) const SHORTEST_SHARE: f32 = 0.75;

/// Points of a leaf, the first in the lowest bit. [`ALL`] are all of it, be they more than there are bits.
pub(crate) type Points = u16;
/// See [`Points`].
pub(crate) const ALL: Points = Points::MAX;

/// The nodes of one pair.
#[derive(Clone, Copy)]
pub(crate) struct Keys {
    first: u32,
    /// All bits, or none where nothing is noted.
    mask: u32,
}

impl Keys {
    /// Of a pair with so many nodes.
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

    /// Of one of the nodes.
    #[inline(always)]
    pub fn of(self, node: u32) -> Key {
        Key(self.first + (node & self.mask))
    }
}

/// Which node of which pair.
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

    /// Tells it from the others that fall into its slot; never that of an empty slot.
    pub fn tag(self) -> u16 {
        (self.0 / SLOTS as u32) as u16 + 1
    }

    /// Multiplicative, Knuth's 2³²/φ: the upper bits are the better ones.
    #[inline(always)]
    pub fn hash(self) -> u32 {
        self.0.wrapping_mul(2_654_435_769)
    }

    /// The node's share of its distance: one of 256.
    pub fn share(self) -> f32 {
        let place = self.hash() >> 24;
        LONGEST_SHARE - (LONGEST_SHARE - SHORTEST_SHARE) * (1.0 / 255.0) * place as f32
    }
}
