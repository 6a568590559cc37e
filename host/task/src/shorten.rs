//! Few legs instead of many small steps.

use glam::DAffine3;

use crate::motion::Motion;
use crate::walk::{CHECK_STEP_MM, Walker};
use crate::way::Path;

/// Distances kept on a leg, in the order in which they are tried, mm.
const MARGINS_MM: [f64; 3] = [0.04, 0.015, 0.0];

/// A way over the first and the last of `poses`, between which the group moves freely from each to the next, in longer legs: from each pose to the farthest that
/// is found to be reached freely.
pub(crate) fn shorten(walker: &Walker<'_>, poses: &[DAffine3]) -> Path {
    let mut legs = Vec::new();
    let mut from = 0;
    while from + 1 < poses.len() {
        let direct = |to: usize, margin: f64| -> Option<Motion> {
            let motion = walker.motion(&poses[from], &poses[to]);
            let group = walker.moved(poses[from]);
            let (share, _) = (walker.assembly).free_share_beyond(
                &group,
                walker.others,
                &motion,
                CHECK_STEP_MM,
                margin,
                false,
            );
            (share >= 1.0).then_some(motion)
        };
        let mut found = None;
        'margins: for margin in MARGINS_MM {
            // Far ones first, then ever nearer ones; then farther again by halving.
            let mut far = poses.len() - 1;
            let mut failed = None;
            while far > from + 1 {
                if let Some(leg) = direct(far, margin) {
                    let (mut good, mut leg) = (far, leg);
                    if let Some(mut bad) = failed {
                        while bad - good > 1 {
                            let middle = (good + bad) / 2;
                            match direct(middle, margin) {
                                Some(l) => (good, leg) = (middle, l),
                                None => bad = middle,
                            }
                        }
                    }
                    found = Some((good, leg));
                    break 'margins;
                }
                failed = Some(far);
                far = from + (far - from) / 2;
            }
        }
        let (to, leg) = found.unwrap_or_else(|| (from + 1, walker.motion(&poses[from], &poses[from + 1])));
        legs.push(leg);
        from = to;
    }
    Path { legs }
}
