//! Which parts fall when nothing but each other, a fixture or the floor keeps them.
//!
//! A part is supported that is held; that stands on the floor, which is where the lowest part ends and there only if none of the parts is held; that meets a
//! supported part when it moves down by no more than the play of a fit; or that a connection grips to a supported one (screwed, pressed, welded …). Parts fall straight down: whether
//! they would tip or roll aside is not asked.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use crate::assembly::{Assembly, Moved};
use crate::graph::graph;
use crate::mobility::PLAY_MM;
use crate::motion::Motion;
use crate::wishes::Wishes;

/// Distance from the floor up to which a part stands on it, mm.
const FLOOR_MM: f64 = 0.1;
/// Travel between checks of samples in contact, mm.
const CHECK_MM: f64 = 0.05;

/// Support of an assembly's parts under gravity.
pub(crate) struct Support<'a> {
    assembly: &'a Assembly,
    wishes: &'a Wishes,
    /// Pairs that a connection grips.
    gripped: Vec<[usize; 2]>,
    /// Whether the first part, moved down a little, meets the second.
    rests: HashMap<[usize; 2], bool>,
}

impl<'a> Support<'a> {
    pub fn new(assembly: &'a Assembly, wishes: &'a Wishes) -> Self {
        let mut support = Self {
            assembly,
            wishes,
            gripped: Vec::new(),
            rests: HashMap::new(),
        };
        if wishes.down.is_some() {
            let edges = graph(assembly);
            let grips = edges
                .edge_weights()
                .filter(|edge| edge.kinds.iter().any(|kind| kind.kind().grips));
            support.gripped = grips.map(|edge| edge.parts).collect();
        }
        support
    }

    /// Parts of `set` that fall while the others of it are in place; none without gravity. Cost: a short sweep for each new pair of parts near each other.
    pub fn falling(&mut self, set: &[usize]) -> Vec<usize> {
        let Some(down) = self.wishes.down else {
            return Vec::new();
        };
        let lowest = |part: usize| {
            let (low, high) = self.assembly.bounds(part, DAffine3::IDENTITY);
            (0.5 * (low + high)).dot(down) + 0.5 * (high - low).dot(down.abs())
        };
        let floor = set
            .iter()
            .map(|&part| lowest(part))
            .fold(f64::NEG_INFINITY, f64::max);
        let (mut supported, mut left): (Vec<usize>, Vec<usize>) = if self.wishes.hold_one_of(set) {
            set.iter().partition(|part| self.wishes.held.contains(part))
        } else {
            set.iter().partition(|part| lowest(**part) >= floor - FLOOR_MM)
        };
        while let Some(on) = supported.pop() {
            let mut falls = Vec::new();
            for part in left {
                if self.rests_on(part, on, down) {
                    supported.push(part);
                } else {
                    falls.push(part);
                }
            }
            left = falls;
        }
        left
    }

    fn rests_on(&mut self, part: usize, on: usize, down: DVec3) -> bool {
        let assembly = self.assembly;
        if self.gripped.contains(&[part.min(on), part.max(on)]) {
            return true;
        }
        *self.rests.entry([part, on]).or_insert_with(|| {
            let fall = Motion::slide(down * PLAY_MM);
            let group = Moved {
                parts: &[part],
                by: DAffine3::IDENTITY,
            };
            assembly.boxes_are_near(part, on, PLAY_MM)
                && assembly.free_share(&group, &[on], &fall, CHECK_MM).0 < 1.0
        })
    }
}
