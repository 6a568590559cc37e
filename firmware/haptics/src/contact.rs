//! Contacts of one tick: a bounded store that keeps the deepest and the widest apart.

use glam::Vec3;

use crate::proximity::Leaf;

/// Contacts one tick can carry.
pub(crate) const MAX_CONTACTS: usize = 256;

/// A point near or in the other part, linearised about the tick's start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    /// How the gap's rate follows from the scaled twist (v, ω·L): (n, (r × n)/L), n the world normal that pushes the object away.
    pub row: [f32; 6],
    /// From the object's centre of mass to the point, world axes, m.
    pub arm: Vec3,
    /// Signed distance at the tick's start, m.
    pub gap: f32,
    /// How soon a turn of the object could bring it to touch, m: the gap less what its lever makes up for. Small is soon.
    pub reach_gap: f32,
    /// Rate of the gap in the last solution, m/s.
    pub rate: f32,
    /// Part of the force law the last solution assumed.
    pub phase: Phase,
    /// Face of the held part.
    pub moving_face: u16,
    /// Face of the other part.
    pub static_face: u16,
    /// Where it was found; tells the other part.
    pub leaf: Leaf,
}

impl Contact {
    /// Nothing. All zero, so that a fresh store lies in memory that is cleared rather than copied from flash.
    const NONE: Self = Self {
        row: [0.0; 6],
        arm: Vec3::ZERO,
        gap: 0.0,
        reach_gap: 0.0,
        rate: 0.0,
        phase: Phase::Free,
        moving_face: 0,
        static_face: 0,
        leaf: Leaf::FIRST,
    };
}

/// Branch of a contact's piecewise linear force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// No force.
    Free,
    /// Force falls off as the gap opens: λ = −k·(gap + h·rate).
    Parting,
    /// With damping: λ = −k·(gap + (h + τ)·rate).
    Closing,
}

/// Contacts kept for their depth; as many are kept for their lever.
const HALF: usize = MAX_CONTACTS / 2;

/// At most [`MAX_CONTACTS`] contacts: of all offered, half are the deepest, half are those of the rest that a turn would bring to touch first.
///
/// The deepest alone would all lie on the side a part leans to; with nothing left on the other side it would rock. Among equals the first
/// offered stay. A contact is filled in place: it is too large to be handed about by value in the innermost loop.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    /// The deepest in the first half, the others in the second. Filled up to `len`.
    list: [Contact; MAX_CONTACTS],
    len: usize,
    /// Once the first half is full: its least deep on top.
    by_gap: Heap,
    /// Once all is full: the one of the second half that would touch last on top.
    by_reach: Heap,
    dropped: bool,
    /// The last tick's, moved on to the beginning of this one.
    carried: [Contact; MAX_CONTACTS],
    carried_len: usize,
}

/// Indices into half a list, the one with the largest key on top.
#[derive(Clone, Debug)]
struct Heap([u8; HALF]);

// Every index into half the list must fit a byte.
const _: () = assert!(HALF <= 256);

impl Heap {
    const fn new() -> Self {
        Self([0; HALF])
    }

    /// Over all of `half`.
    #[cold]
    fn build(&mut self, half: &[Contact], key: impl Fn(&Contact) -> f32 + Copy) {
        for (i, slot) in self.0.iter_mut().enumerate() {
            *slot = i as u8;
        }
        for i in (0..HALF / 2).rev() {
            self.sift_down(i, half, key);
        }
    }

    fn top(&self) -> usize {
        usize::from(self.0[0])
    }

    /// Moves the entry at `i` below all with larger keys: at most 7 steps.
    fn sift_down(&mut self, mut i: usize, half: &[Contact], key: impl Fn(&Contact) -> f32) {
        let at = |heap: &Self, i: usize| key(&half[usize::from(heap.0[i])]);
        loop {
            let left = 2 * i + 1;
            if left >= HALF {
                return;
            }
            let right = left + 1;
            let child = if right < HALF && at(self, right) > at(self, left) {
                right
            } else {
                left
            };
            if at(self, child) <= at(self, i) {
                return;
            }
            self.0.swap(i, child);
            i = child;
        }
    }
}

impl Contacts {
    pub const fn new() -> Self {
        Self {
            list: [Contact::NONE; MAX_CONTACTS],
            len: 0,
            by_gap: Heap::new(),
            by_reach: Heap::new(),
            dropped: false,
            carried: [Contact::NONE; MAX_CONTACTS],
            carried_len: 0,
        }
    }

    /// Empties the store.
    pub fn clear(&mut self) {
        self.len = 0;
        self.dropped = false;
        self.carried_len = 0;
    }

    /// Empties the store for the next tick, `period_s` after the last. With `put_aside` what it held can be had back by [`Self::carry`],
    /// at the cost of copying the store.
    pub fn begin(&mut self, period_s: f32, put_aside: bool) {
        self.carried_len = 0;
        if put_aside {
            self.carried = self.list;
            self.carried_len = self.len;
            for contact in self.carried.iter_mut().take(self.len) {
                contact.gap += period_s * contact.rate;
                contact.rate = 0.0;
                contact.phase = Phase::Free;
            }
        }
        self.len = 0;
        self.dropped = false;
    }

    /// Takes the last tick's contacts over into this one where their leaf was not looked at: the gap as predicted, the normal as it was.
    pub fn carry(&mut self, unseen: impl Fn(Leaf) -> bool) {
        for i in 0..self.carried_len {
            let old = self.carried[i];
            if unseen(old.leaf)
                && let Some(new) = self.offer(old.gap, old.reach_gap)
            {
                *new = old;
            }
        }
    }

    pub fn as_slice(&self) -> &[Contact] {
        self.list.get(..self.len).unwrap_or(&[])
    }

    pub fn as_mut_slice(&mut self) -> &mut [Contact] {
        self.list.get_mut(..self.len).unwrap_or(&mut [])
    }

    /// Contacts with a force in the last solution.
    pub fn pushing(&self) -> usize {
        self.as_slice().iter().filter(|c| c.phase != Phase::Free).count()
    }

    /// Whether any was left out since [`Self::clear`].
    pub fn dropped(&self) -> bool {
        self.dropped
    }

    /// A place for a contact, the rest of which the caller fills in, unless it is not to be kept. Two comparisons, and at most twice 7 steps of a
    /// heap when it displaces others.
    #[inline]
    pub fn offer(&mut self, gap: f32, reach_gap: f32) -> Option<&mut Contact> {
        if self.len < HALF {
            let place = self.len;
            self.len += 1;
            self.list[place].gap = gap;
            self.list[place].reach_gap = reach_gap;
            if self.len == HALF {
                self.by_gap.build(&self.list[..HALF], |c| c.gap);
            }
            return Some(&mut self.list[place]);
        }
        let top = self.by_gap.top();
        let place = if gap < self.list[top].gap {
            let displaced = self.list[top];
            if let Some(place) = self.offer_second_half(displaced.gap, displaced.reach_gap) {
                self.list[place] = displaced;
            }
            self.list[top].gap = gap;
            self.list[top].reach_gap = reach_gap;
            self.by_gap.sift_down(0, &self.list[..HALF], |c| c.gap);
            top
        } else {
            self.offer_second_half(gap, reach_gap)?
        };
        Some(&mut self.list[place])
    }

    fn offer_second_half(&mut self, gap: f32, reach_gap: f32) -> Option<usize> {
        let filling = self.len < MAX_CONTACTS;
        let place = if filling {
            self.len += 1;
            self.len - 1
        } else {
            self.dropped = true;
            let top = HALF + self.by_reach.top();
            if reach_gap >= self.list[top].reach_gap {
                return None;
            }
            top
        };
        self.list[place].gap = gap;
        self.list[place].reach_gap = reach_gap;
        if !filling {
            self.by_reach.sift_down(0, &self.list[HALF..], |c| c.reach_gap);
        } else if self.len == MAX_CONTACTS {
            self.by_reach.build(&self.list[HALF..], |c| c.reach_gap);
        }
        Some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_deepest_and_of_the_rest_the_soonest() {
        // A full-period generator modulo 2048 offers each gap once, in a scrambled order; reach gaps fall as gaps rise.
        let mut contacts = Contacts::new();
        let mut x = 1u32;
        for _ in 0..2048 {
            x = (x * 1021 + 7) % 2048;
            if let Some(c) = contacts.offer(x as f32, -(x as f32)) {
                c.moving_face = x as u16;
            }
        }
        assert!(contacts.dropped());
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
    fn drops_nothing_while_there_is_room() {
        let mut contacts = Contacts::new();
        for i in 0..MAX_CONTACTS {
            // The deeper half comes last, so every one of it displaces another.
            assert!(contacts.offer(-(i as f32), 0.0).is_some());
        }
        assert!(!contacts.dropped());
        let sum: f32 = contacts.as_slice().iter().map(|c| c.gap).sum();
        assert_eq!(sum, -((MAX_CONTACTS * (MAX_CONTACTS - 1) / 2) as f32));
    }

    #[test]
    fn carries_what_was_not_seen() {
        let mut contacts = Contacts::new();
        for i in 0..10 {
            let c = contacts.offer(-1e-6, 0.0).unwrap();
            c.rate = 1e-3;
            c.phase = Phase::Parting;
            c.moving_face = i;
        }
        contacts.begin(1e-3, true);
        assert!(contacts.as_slice().is_empty());
        contacts.carry(|_| false);
        assert!(contacts.as_slice().is_empty());
        contacts.carry(|leaf| leaf == Leaf::FIRST);
        assert_eq!(contacts.as_slice().len(), 10);
        for (i, c) in contacts.as_slice().iter().enumerate() {
            assert_eq!((usize::from(c.moving_face), c.phase), (i, Phase::Free));
            assert_eq!(c.gap, -1e-6 + 1e-3 * 1e-3);
        }
        contacts.begin(1e-3, false);
        contacts.carry(|_| true);
        assert!(contacts.as_slice().is_empty());
    }
}
