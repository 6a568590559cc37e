//! Contacts of one tick: a bounded store that keeps the deepest contacts and the ones with the longest lever arms.

use glam::Vec3;

use crate::collision::node_cursor::NodeCursor;
use crate::collision::side::Sides;
use crate::math::symmetric6::dot;

/// Capacity for contacts per tick.
pub const MAX_CONTACTS: usize = 256;

/// A point near the other part or inside it, linearised about the tick's start. The solver's numbers and the faces stand in one record, because a contact is kept,
/// replaced and reported as a whole.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// Jacobian row of the gap's rate for the scaled twist (v, ω·L): (n, (r × n)/L), n the world normal that pushes the object away.
    pub row: [f32; 6],
    /// Lever arm from the object's centre of mass to the point, world axes, m.
    pub arm: Vec3,
    /// Signed distance at the tick's start, m.
    pub gap: f32,
    /// Gap less the part of it that a rotation of the object closes at this lever arm, m: the smaller, the sooner a rotation makes the point touch.
    pub reach_gap: f32,
    /// Rate of the gap in the last solution, m/s; not updated while the contact is free.
    pub rate: f32,
    /// Branch of the force law that the last solution assumed.
    pub phase: Phase,
    /// Whether a target guides its faces.
    pub guided: bool,
    /// Whether an edge meets a face, or another edge, in this one place.
    pub single: bool,
    /// Face of the held part.
    pub moving_face: u16,
    /// Face of the other part.
    pub static_face: u16,
    /// The held part's second face where the point lies on an edge of it, else [`NO_FACE`].
    pub moving_edge_face: u16,
    /// The other part's second face, likewise.
    pub static_edge_face: u16,
    /// Numbers of the edges of the held part and of the other part that cross, else [`NO_FACE`].
    pub edges: [u16; 2],
    /// Leaf in which it was found; identifies the other part.
    pub leaf: NodeCursor,
}

impl Contact {
    /// Empty contact. All zero, so that a fresh store lies in zeroed memory rather than being copied from flash.
    const NONE: Self = Self {
        row: [0.0; 6],
        arm: Vec3::ZERO,
        gap: 0.0,
        reach_gap: 0.0,
        rate: 0.0,
        phase: Phase::Free,
        guided: false,
        single: false,
        moving_face: 0,
        static_face: 0,
        moving_edge_face: 0,
        static_edge_face: 0,
        edges: [0; 2],
        leaf: NodeCursor::FIRST,
    };
}

/// Branch of a contact's piecewise linear force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// No force.
    Free,
    /// Without damping: λ = −k·(gap + h·rate).
    Parting,
    /// With damping: λ = −k·(gap + (h + τ)·rate).
    Closing,
}

/// Contacts kept for their depth; as many are kept for their lever arm.
const HALF: usize = MAX_CONTACTS / 2;

/// Store of at most [`MAX_CONTACTS`] contacts. Of all offered, half are the deepest; the other half are those of the rest that a rotation would bring
/// to touch first.
///
/// The deepest alone would all lie on the side to which a part leans; with no contacts on the other side it would rock. Among equals the first
/// offered stay. A contact is filled in place: it is too large to pass by value in the innermost loop.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    /// Contacts of this tick and the last one, alternating, filled up to their lengths.
    lists: [[Contact; MAX_CONTACTS]; 2],
    /// Index of this tick's list: 0 or 1.
    current: usize,
    /// Length of this tick's list.
    len: usize,
    /// Heap over the first half after an overflow: the least deep on top.
    by_gap: Heap,
    /// Heap over the second half after an overflow: the largest reach gap on top.
    by_reach: Heap,
    /// Whether the list overflowed.
    dropped: bool,
    /// Number of dropped contacts that touch.
    lost: u32,
    /// Square of the longest arm, m².
    farthest2: f32,
    /// Length of the last tick's list.
    previous_len: usize,
    /// Number of the last tick's contacts that can be carried over.
    carried_len: usize,
    /// Sides from which leaves came to what they touch.
    pub sides: Sides,
}

/// Heap of the indices of half a list, the largest key on top. Keys are stored side by side, not a contact's size apart.
#[derive(Clone, Debug)]
struct Heap {
    keys: [f32; HALF],
    places: [u8; HALF],
}

// Every index into the list must fit a byte.
const _: () = assert!(MAX_CONTACTS <= 256);

impl Heap {
    const fn new() -> Self {
        Self {
            keys: [0.0; HALF],
            places: [0; HALF],
        }
    }

    /// Builds the heap over the contacts at `places`, by the `key` of each.
    #[cold]
    fn build(&mut self, places: &[u8], key: impl Fn(u8) -> f32) {
        for (i, &place) in places.iter().enumerate().take(HALF) {
            self.keys[i] = key(place);
            self.places[i] = place;
        }
        for i in (0..HALF / 2).rev() {
            self.sift_down(i);
        }
    }

    fn largest(&self) -> f32 {
        self.keys[0]
    }

    /// Replaces the key on top with one that is not larger. Returns the index of its contact.
    fn replace_largest(&mut self, key: f32) -> usize {
        let place = self.places[0];
        self.keys[0] = key;
        self.sift_down(0);
        usize::from(place)
    }

    /// Moves the entry at `i` below all entries with larger keys: at most 7 steps.
    fn sift_down(&mut self, mut i: usize) {
        let (key, place) = (self.keys[i], self.places[i]);
        loop {
            let left = 2 * i + 1;
            if left >= HALF {
                break;
            }
            let right = left + 1;
            let child = if right < HALF && self.keys[right] > self.keys[left] {
                right
            } else {
                left
            };
            if self.keys[child] <= key {
                break;
            }
            (self.keys[i], self.places[i]) = (self.keys[child], self.places[child]);
            i = child;
        }
        (self.keys[i], self.places[i]) = (key, place);
    }
}

impl Contacts {
    pub const fn new() -> Self {
        Self {
            lists: [[Contact::NONE; MAX_CONTACTS]; 2],
            current: 0,
            len: 0,
            by_gap: Heap::new(),
            by_reach: Heap::new(),
            dropped: false,
            lost: 0,
            farthest2: 0.0,
            previous_len: 0,
            carried_len: 0,
            sides: Sides::new(),
        }
    }

    /// Empties the store.
    pub fn clear(&mut self) {
        self.sides.clear();
        self.len = 0;
        self.dropped = false;
        self.lost = 0;
        self.farthest2 = 0.0;
        self.previous_len = 0;
        self.carried_len = 0;
    }

    /// Empties the store for the next tick. With `keep_previous` the contacts it held can be restored by [`Self::carry`].
    pub fn begin(&mut self, keep_previous: bool) {
        self.sides.begin();
        self.previous_len = self.len;
        self.carried_len = if keep_previous { self.len } else { 0 };
        self.current = 1 - self.current;
        self.len = 0;
        self.dropped = false;
        self.lost = 0;
        self.farthest2 = 0.0;
    }

    /// Carries over contacts whose leaf was not visited, if they pushed in the last tick or their gap is still below the `limit` of their row: the object's
    /// `motion` since (scaled as the rows) updates the gap, the normal stays. Returns the number of those that pushed, and of the others.
    pub fn carry(
        &mut self,
        motion: &[f32; 6],
        limit: impl Fn(&[f32; 6]) -> f32,
        unvisited: impl Fn(NodeCursor) -> bool,
    ) -> [u32; 2] {
        let mut carried = [0; 2];
        for i in 0..self.carried_len {
            let old = &self.lists[1 - self.current][i];
            if !unvisited(old.leaf) {
                continue;
            }
            let gap = old.gap + dot(&old.row, motion);
            let is_free = old.phase == Phase::Free;
            if is_free && gap >= limit(&old.row) {
                continue;
            }
            let (reach_gap, arm2) = (old.reach_gap, old.arm.length_squared());
            if let Some(place) = self.place(gap, reach_gap, arm2) {
                let [first, second] = &mut self.lists;
                let (new, old) = if self.current == 0 {
                    (first, second)
                } else {
                    (second, first)
                };
                new[place] = old[i];
                (new[place].gap, new[place].rate, new[place].phase) = (gap, 0.0, Phase::Free);
                carried[usize::from(is_free)] += 1;
            }
        }
        carried
    }

    /// Whether these edges of the held part and of part `part` crossed in the last tick.
    pub fn crossed(&self, part: u16, edges: [u16; 2]) -> bool {
        let previous = self.lists[1 - self.current]
            .get(..self.previous_len)
            .unwrap_or(&[]);
        previous.iter().any(|c| c.edges == edges && c.leaf.part() == part)
    }

    fn list(&self) -> &[Contact; MAX_CONTACTS] {
        &self.lists[self.current]
    }

    pub fn as_slice(&self) -> &[Contact] {
        self.list().get(..self.len).unwrap_or(&[])
    }

    pub fn as_mut_slice(&mut self) -> &mut [Contact] {
        self.lists[self.current].get_mut(..self.len).unwrap_or(&mut [])
    }

    /// Contacts with a force in the last solution.
    pub fn pushing(&self) -> usize {
        self.as_slice().iter().filter(|c| c.phase != Phase::Free).count()
    }

    /// Whether any contact was dropped since [`Self::clear`].
    pub fn dropped(&self) -> bool {
        self.dropped
    }

    /// Number of contacts that touch and were dropped since [`Self::clear`].
    pub fn lost(&self) -> u32 {
        self.lost
    }

    /// The longest lever arm of all contacts accepted, m.
    pub fn farthest(&self) -> f32 {
        libm::sqrtf(self.farthest2)
    }

    /// Slot for a contact with a lever arm of √`arm2`, which the caller fills in; `None` if the contact is not kept. Once the list is full the cost
    /// is two comparisons, and at most twice 7 heap steps when the contact displaces others.
    #[inline]
    pub fn offer(&mut self, gap: f32, reach_gap: f32, arm2: f32) -> Option<&mut Contact> {
        let place = self.place(gap, reach_gap, arm2)?;
        let contact = &mut self.lists[self.current][place];
        contact.gap = gap;
        contact.reach_gap = reach_gap;
        Some(contact)
    }

    /// Index of the slot of [`Self::offer`].
    #[inline]
    fn place(&mut self, gap: f32, reach_gap: f32, arm2: f32) -> Option<usize> {
        let place = if self.len < MAX_CONTACTS {
            self.len += 1;
            self.len - 1
        } else {
            self.displace(gap, reach_gap)?
        };
        if arm2 > self.farthest2 {
            self.farthest2 = arm2;
        }
        Some(place)
    }

    /// Index for a new contact once the list is full. Out of line: the loop over points is faster for it.
    #[inline(never)]
    fn displace(&mut self, gap: f32, reach_gap: f32) -> Option<usize> {
        let list = &mut self.lists[self.current];
        if !self.dropped {
            self.dropped = true;
            // Only places, of a byte each, are put in order: contacts are a hundred times as large.
            let mut places: [u8; MAX_CONTACTS] = core::array::from_fn(|place| place as u8);
            let of = |place: u8| &list[usize::from(place)];
            places.select_nth_unstable_by(HALF, |a, b| of(*a).gap.total_cmp(&of(*b).gap));
            let (deepest, rest) = places.split_at(HALF);
            self.by_gap.build(deepest, |place| of(place).gap);
            self.by_reach.build(rest, |place| of(place).reach_gap);
        }
        if gap >= self.by_gap.largest() {
            return self.displace_in_second_half(gap, reach_gap);
        }
        let place = self.by_gap.replace_largest(gap);
        let displaced = self.lists[self.current][place];
        if let Some(second) = self.displace_in_second_half(displaced.gap, displaced.reach_gap) {
            self.lists[self.current][second] = displaced;
        }
        Some(place)
    }

    /// Index in the second half, unless all contacts there would touch sooner. Counts the dropped contact if it touches.
    fn displace_in_second_half(&mut self, gap: f32, reach_gap: f32) -> Option<usize> {
        let sooner = reach_gap < self.by_reach.largest();
        let place = sooner.then(|| self.by_reach.replace_largest(reach_gap));
        let left_out = place.map_or(gap, |place| self.lists[self.current][place].gap);
        self.lost += u32::from(left_out < 0.0);
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_deepest_and_then_the_soonest_in_reach() {
        // A full-period generator modulo 2048 offers each gap once, in a scrambled order; reach gaps fall as gaps rise.
        let mut contacts = Contacts::new();
        let mut x = 1u32;
        for _ in 0..2048 {
            x = (x * 1021 + 7) % 2048;
            if let Some(c) = contacts.offer(x as f32, -(x as f32), 0.0) {
                c.moving_face = x as u16;
            }
        }
        assert!(contacts.dropped());
        // No gap is negative.
        assert_eq!(contacts.lost(), 0);
        let mut kept = [false; 2048];
        for c in contacts.as_slice() {
            assert_eq!(
                (c.gap, c.reach_gap),
                (f32::from(c.moving_face), -f32::from(c.moving_face))
            );
            kept[c.gap as usize] = true;
        }
        for (gap, kept) in kept.iter().enumerate() {
            assert_eq!(*kept, !(HALF..2048 - HALF).contains(&gap), "{gap}");
        }
        contacts.clear();
        assert!(!contacts.dropped() && contacts.as_slice().is_empty());
    }

    #[test]
    fn drops_nothing_up_to_capacity() {
        let mut contacts = Contacts::new();
        for i in 0..MAX_CONTACTS {
            // The deeper half comes last, so every one of it displaces another.
            assert!(contacts.offer(-(i as f32), 0.0, 0.0).is_some());
        }
        assert!(!contacts.dropped());
        let sum: f32 = contacts.as_slice().iter().map(|c| c.gap).sum();
        assert_eq!(sum, -((MAX_CONTACTS * (MAX_CONTACTS - 1) / 2) as f32));
    }

    #[test]
    fn counts_dropped_contacts_that_touch() {
        let mut contacts = Contacts::new();
        let mut x = 1u32;
        let touching = 700;
        for _ in 0..2048 {
            x = (x * 1021 + 7) % 2048;
            // The deepest have the shortest lever arms.
            let gap = x as f32 - touching as f32;
            let _ = contacts.offer(gap, 0.5 * gap, 0.0);
        }
        let kept = contacts.as_slice().iter().filter(|c| c.gap < 0.0).count() as u32;
        assert_eq!(contacts.lost() + kept, touching);
        contacts.begin(false);
        assert_eq!(contacts.lost(), 0);
    }

    /// Of ten contacts, the first five pushed; the others are free, each 1 µm farther off than the last.
    #[test]
    fn carries_contacts_of_unvisited_leaves() {
        let mut contacts = Contacts::new();
        for i in 0..10u16 {
            let free = i >= 5;
            let gap = if free { f32::from(i - 5) * 1e-6 } else { -1e-6 };
            let c = contacts.offer(gap, 0.0, 0.0).unwrap();
            c.row = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
            c.phase = if free { Phase::Free } else { Phase::Parting };
            c.moving_face = i;
        }
        let motion = [0.0, 0.0, 1e-6, 0.0, 0.0, 0.0];
        contacts.begin(true);
        assert_eq!(contacts.carry(&motion, |_| 1.0, |_| false), [0, 0]);
        assert!(contacts.as_slice().is_empty());
        // Free ones have 1 to 5 µm left.
        assert_eq!(
            contacts.carry(&motion, |_| 3.5e-6, |leaf| leaf == NodeCursor::FIRST),
            [5, 3]
        );
        for (i, c) in contacts.as_slice().iter().enumerate() {
            assert_eq!((usize::from(c.moving_face), c.phase), (i, Phase::Free));
            let gap = if i < 5 { -1e-6 } else { (i - 5) as f32 * 1e-6 };
            assert_eq!(c.gap, gap + 1e-6);
        }
        contacts.begin(false);
        assert_eq!(contacts.carry(&motion, |_| 1.0, |_| true), [0, 0]);
        assert!(contacts.as_slice().is_empty());
    }
}
