//! Position of the search in the trees of all directed pairs.

/// Position in the search order: part by part, forward before backward, node by node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct NodeCursor {
    /// Twice the part's index, plus one for backward.
    pub pair: u16,
    pub node: u32,
}

impl NodeCursor {
    /// Start of the order.
    pub const FIRST: Self = Self { pair: 0, node: 0 };

    /// Index of the other part.
    pub fn part(self) -> u16 {
        self.pair / 2
    }
}
