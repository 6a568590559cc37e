//! What need not be looked at yet: how far the object must travel before a node's points can touch.
//!
//! A node whose points are all at least D from the other part cannot hold a candidate until some point of the object has travelled
//! D − margin. The travel is added up once a tick from a bound on the speed of any point, so the due times are conservative and the
//! candidates found are the same with and without them. They are kept in a direct-mapped table: a collision costs a look-up, never a contact.
//! Whole numbers of nanometres, rounded to the safe side, so that no travel is lost to rounding.
//!
//! Cost: about 15 instructions for a node that is not due, against about 120 for looking at it.

/// Entries in the table. A power of two.
const SLOTS: usize = 2048;
/// Nodes of one job that can be told apart; further ones are looked at every tick.
const NODES: u32 = 1 << 20;
/// The travel is taken back to zero, and the table cleared, beyond this: 2 m.
const LONGEST_NM: u32 = 2_000_000_000;
/// Interpolated distances may change a little faster than the object travels where a brick holds a sharp edge: a distance counts for
/// this much less.
const SAFETY: f32 = 0.9;

/// Due times of nodes.
#[derive(Clone, Debug)]
pub(crate) struct Coherence {
    travel_nm: u32,
    slots: [Slot; SLOTS],
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    key: u32,
    due_nm: u32,
}

/// Which node of which job.
#[derive(Clone, Copy)]
pub(crate) struct Key(u32);

impl Key {
    /// No node: larger than any.
    const NONE: u32 = u32::MAX;

    pub fn new(job: u16, node: u32) -> Self {
        if node < NODES {
            Self(u32::from(job) * NODES + node)
        } else {
            Self(Self::NONE)
        }
    }

    fn slot(self) -> usize {
        // Neighbouring nodes fall into neighbouring slots; jobs are spread over the table.
        let job = self.0 / NODES;
        (self.0 + 619 * job) as usize % SLOTS
    }
}

impl Coherence {
    pub const fn new() -> Self {
        const EMPTY: Slot = Slot {
            key: Key::NONE,
            due_nm: 0,
        };
        Self {
            travel_nm: 0,
            slots: [EMPTY; SLOTS],
        }
    }

    /// Everything is due. For a jump of the object, or other parts.
    pub fn forget(&mut self) {
        *self = Self::new();
    }

    /// The object moved, no point of it by more than `distance` m.
    pub fn travelled(&mut self, distance: f32) {
        self.travel_nm = self.travel_nm.saturating_add(up_nm(distance));
        if self.travel_nm > LONGEST_NM {
            self.forget();
        }
    }

    /// The travel at which a point is due that must not come nearer than `margin` m unseen: to be compared with [`Self::is_due`].
    pub fn horizon(&self, margin: f32) -> u32 {
        self.travel_nm.saturating_add(up_nm(margin))
    }

    /// Whether the node must be looked at.
    #[inline]
    pub fn is_due(&self, key: Key, horizon: u32) -> bool {
        let slot = &self.slots[key.slot()];
        slot.key != key.0 || slot.due_nm <= horizon
    }

    /// No point of the node is nearer than `distance` m, as seen now.
    #[inline]
    pub fn set(&mut self, key: Key, distance: f32) {
        if key.0 != Key::NONE {
            // A float that is negative or not a number becomes 0, a huge one the largest number.
            let ahead = (distance * (SAFETY * 1e9)) as u32;
            self.slots[key.slot()] = Slot {
                key: key.0,
                due_nm: self.travel_nm.saturating_add(ahead),
            };
        }
    }
}

/// Nanometres, rounded up past any rounding of the single-precision product.
fn up_nm(distance: f32) -> u32 {
    ((distance * (1.000_001 * 1e9)) as u32).saturating_add(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn due_once_the_distance_is_used_up() {
        let mut c = Coherence::new();
        let key = Key::new(3, 77);
        assert!(c.is_due(key, c.horizon(0.0)));
        c.set(key, 1e-3);
        assert!(!c.is_due(key, c.horizon(0.0)));
        assert!(!c.is_due(key, c.horizon(0.85e-3)));
        assert!(c.is_due(key, c.horizon(0.95e-3)));
        for _ in 0..89 {
            c.travelled(1e-5);
            assert!(!c.is_due(key, c.horizon(0.0)));
        }
        c.travelled(1.1e-5);
        assert!(c.is_due(key, c.horizon(0.0)));
    }

    #[test]
    fn a_collision_makes_due() {
        let mut c = Coherence::new();
        let (a, b) = (Key::new(0, 5), Key::new(0, 5 + SLOTS as u32));
        c.set(a, 1.0);
        c.set(b, 1.0);
        assert!(c.is_due(a, c.horizon(0.0)) && !c.is_due(b, c.horizon(0.0)));
    }

    #[test]
    fn long_travel_starts_over() {
        let mut c = Coherence::new();
        c.set(Key::new(0, 0), f32::INFINITY);
        c.travelled(1.9);
        assert!(!c.is_due(Key::new(0, 0), c.horizon(0.1)));
        c.travelled(0.2);
        assert!(c.is_due(Key::new(0, 0), c.horizon(0.0)));
    }

    #[test]
    fn nothing_nearer_than_nothing() {
        let mut c = Coherence::new();
        for distance in [-1.0, 0.0, f32::NAN, f32::NEG_INFINITY] {
            c.set(Key::new(1, 1), distance);
            assert!(c.is_due(Key::new(1, 1), c.horizon(0.0)), "{distance}");
        }
    }
}
