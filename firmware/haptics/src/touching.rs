//! Which faces touch: contacts gathered by face pair.

use heapless::Vec;
use mortise_protocol::limits::MAX_PAIRS;

use glam::Vec3;

use crate::contact::{Contact, Phase};
use crate::io::{FacePair, FacePairs};

/// Pairs told apart before the deepest [`MAX_PAIRS`] are reported; contacts of further pairs are not counted.
const MAX_GATHERED: usize = 2 * MAX_PAIRS;

/// Face pairs of all contacts that push, deepest first (by depth at the step's end); among equals the first found comes first.
///
/// Contacts come in order of the tree, so the pair last seen is tried first.
pub(crate) fn touching_faces(contacts: &[Contact], center: Vec3, period_s: f32) -> FacePairs {
    let mut gathered: Vec<FacePair, MAX_GATHERED> = Vec::new();
    let mut last = 0;
    for c in contacts.iter().filter(|c| c.phase != Phase::Free) {
        let same = |p: &FacePair| {
            p.moving_face == c.moving_face && p.static_part == c.leaf.part() && p.static_face == c.static_face
        };
        let depth_m = -(c.gap + period_s * c.rate);
        let found = match gathered.get(last) {
            Some(p) if same(p) => Some(last),
            _ => gathered.iter().position(same),
        };
        match found {
            Some(i) => {
                last = i;
                if let Some(p) = gathered.get_mut(i) {
                    p.count = p.count.saturating_add(1);
                    if depth_m > p.depth_m {
                        p.depth_m = depth_m;
                        p.point = center + c.arm;
                    }
                }
            }
            None => {
                let new = FacePair {
                    moving_face: c.moving_face,
                    static_part: c.leaf.part(),
                    static_face: c.static_face,
                    count: 1,
                    depth_m,
                    point: center + c.arm,
                };
                if gathered.push(new).is_ok() {
                    last = gathered.len() - 1;
                }
            }
        }
    }
    // Insertion into a sorted list of bounded length: at most MAX_GATHERED · MAX_PAIRS comparisons.
    let mut pairs = FacePairs::new();
    for p in &gathered {
        let place = pairs
            .iter()
            .position(|q| p.depth_m > q.depth_m)
            .unwrap_or(pairs.len());
        if pairs.is_full() && place < pairs.len() {
            let _ = pairs.pop();
        }
        if place <= pairs.len() {
            let _ = pairs.insert(place, *p);
        }
    }
    pairs
}
