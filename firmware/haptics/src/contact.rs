//! Contacts of one tick: a bounded store that keeps the deepest.

use glam::Vec3;
use heapless::Vec;

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

/// The deepest [`MAX_CONTACTS`] of all contacts offered; among equals the first offered stay.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    list: Vec<Contact, MAX_CONTACTS>,
    /// Once the list is full: indices into it as a heap, the least deep on top.
    heap: [u8; MAX_CONTACTS],
    dropped: bool,
}

// Every index into the list must fit a byte.
const _: () = assert!(MAX_CONTACTS == 256);

impl Contacts {
    pub const fn new() -> Self {
        Self {
            list: Vec::new(),
            heap: [0; MAX_CONTACTS],
            dropped: false,
        }
    }

    pub fn clear(&mut self) {
        self.list.clear();
        self.dropped = false;
    }

    pub fn as_slice(&self) -> &[Contact] {
        &self.list
    }

    pub fn as_mut_slice(&mut self) -> &mut [Contact] {
        &mut self.list
    }

    /// Contacts with a force in the last solution.
    pub fn pushing(&self) -> usize {
        self.list.iter().filter(|c| c.phase != Phase::Free).count()
    }

    /// Whether any was left out since [`Self::clear`].
    pub fn dropped(&self) -> bool {
        self.dropped
    }

    /// Keeps `contact`, at the cost of the least deep one when the store is full: at most 8 comparisons then.
    pub fn offer(&mut self, contact: Contact) {
        match self.list.push(contact) {
            Ok(()) => {
                if self.list.is_full() {
                    for (i, slot) in self.heap.iter_mut().enumerate() {
                        *slot = i as u8;
                    }
                    for i in (0..MAX_CONTACTS / 2).rev() {
                        self.sift_down(i);
                    }
                }
            }
            Err(contact) => {
                self.dropped = true;
                if let Some(top) = self.list.get_mut(usize::from(self.heap[0]))
                    && contact.gap < top.gap
                {
                    *top = contact;
                    self.sift_down(0);
                }
            }
        }
    }

    fn gap(&self, heap_index: usize) -> f32 {
        self.list[usize::from(self.heap[heap_index])].gap
    }

    /// Moves the entry at `i` below all that are less deep. Only called while the list is full.
    fn sift_down(&mut self, mut i: usize) {
        loop {
            let left = 2 * i + 1;
            if left >= MAX_CONTACTS {
                return;
            }
            let right = left + 1;
            let child = if right < MAX_CONTACTS && self.gap(right) > self.gap(left) {
                right
            } else {
                left
            };
            if self.gap(child) <= self.gap(i) {
                return;
            }
            self.heap.swap(i, child);
            i = child;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(gap: f32) -> Contact {
        Contact {
            row: [0.0; 6],
            arm: Vec3::ZERO,
            gap,
            rate: 0.0,
            phase: Phase::Free,
            moving_face: 0,
            static_face: 0,
            leaf: Leaf::FIRST,
        }
    }

    #[test]
    fn keeps_the_deepest() {
        // A full-period generator modulo 2048 offers each gap once, in a scrambled order.
        let mut contacts = Contacts::new();
        let mut x = 1u32;
        for _ in 0..2048 {
            x = (x * 1021 + 7) % 2048;
            contacts.offer(at(x as f32));
        }
        assert!(contacts.dropped());
        let mut kept = [false; 2048];
        for c in contacts.as_slice() {
            kept[c.gap as usize] = true;
        }
        for (gap, kept) in kept.iter().enumerate() {
            assert_eq!(*kept, gap < MAX_CONTACTS, "{gap}");
        }
        contacts.clear();
        assert!(!contacts.dropped() && contacts.as_slice().is_empty());
    }
}
