//! Tasks of extraction that nobody drew: a spool in a channel of a plate, whose bends, widths and clearances come from a seed. The flanges hold the spool in the plate; its
//! middle line along the channel is a way out.

use glam::{DAffine3, DVec2, dvec2};
use tempfile::NamedTempFile;

use crate::LabError;
use crate::step_text::StepText;

/// Clearances between the spool and the walls, mm.
const CLEARANCES: [f64; 4] = [0.02, 0.05, 0.2, 0.5];
/// Half the plate's thickness, the flanges' thickness, and the play between them and the plate, mm.
const HALF: f64 = 4.0;
const FLANGE: f64 = 2.0;
const PLAY: f64 = 0.05;
/// Radius of the flanges over that of the spool.
const WIDE: f64 = 1.8;
/// Steepest piece of a channel, and least angle of a bend, radians.
const STEEPEST: f64 = 1.0;
const LEAST_BEND: f64 = 0.4;

/// The middle line of a channel, from where the spool is to the plate's side, and its sizes, mm.
pub(super) struct Channel {
    corners: Vec<DVec2>,
    radius: f64,
    clearance: f64,
}

impl Channel {
    /// The channel of a seed: one to five bends at any angles, the last piece at right angles to the side.
    pub fn random(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let radius = 2.5 + 2.5 * random.f64();
        let clearance = CLEARANCES[random.usize(0..CLEARANCES.len())];
        let (mut corners, mut before) = (vec![DVec2::ZERO], f64::INFINITY);
        let bends = random.usize(1..=5);
        for left in (0..=bends).rev() {
            let angle = loop {
                let angle = if left == 0 {
                    0.0
                } else {
                    STEEPEST * (2.0 * random.f64() - 1.0)
                };
                let next_bends = left != 1 || angle.abs() > LEAST_BEND;
                if (angle - before).abs() > LEAST_BEND && next_bends {
                    break angle;
                }
            };
            let length = radius * (5.0 + 4.0 * random.f64());
            corners.push(corners[corners.len() - 1] + length * DVec2::from_angle(angle));
            before = angle;
        }
        Self {
            corners,
            radius,
            clearance,
        }
    }

    /// Number of bends.
    pub fn bends(&self) -> usize {
        self.corners.len() - 2
    }

    /// One wall of the channel, from its closed end to the plate's side: `side` 1 is left of the way out, -1 right.
    fn wall(&self, side: f64) -> Vec<DVec2> {
        let half = self.radius + self.clearance;
        let directions: Vec<DVec2> = (self.corners.windows(2))
            .map(|pair| (pair[1] - pair[0]).normalize())
            .collect();
        let normals: Vec<DVec2> = directions.iter().map(|d| side * d.perp()).collect();
        let last = self.corners.len() - 1;
        (0..=last)
            .map(|i| match i {
                0 => self.corners[0] + half * (normals[0] - directions[0]),
                i if i == last => self.corners[i] + half * normals[i - 1],
                i => {
                    let (a, b) = (normals[i - 1], normals[i]);
                    self.corners[i] + half * (a + b) / (1.0 + a.dot(b))
                }
            })
            .collect()
    }

    /// The plate's outline, counter-clockwise.
    fn outline(&self) -> Vec<DVec2> {
        let margin = 4.0 * self.radius;
        let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = (self.corners.iter()).fold(nothing, |(low, high), c| (low.min(*c), high.max(*c)));
        let (low, high) = (low - margin, dvec2(high.x, high.y + margin));
        let right = self.wall(-1.0);
        let left = self.wall(1.0);
        [low, dvec2(high.x, low.y)]
            .into_iter()
            .chain(right.into_iter().rev())
            .chain(left)
            .chain([high, dvec2(low.x, high.y)])
            .collect()
    }

    /// The plate and the spool at the closed end.
    pub fn file(&self) -> Result<NamedTempFile, LabError> {
        let mut text = StepText::new();
        let plate = text.prism(&self.outline(), [-HALF, HALF], &[]);
        text.part("plate", plate, DAffine3::IDENTITY);
        let (inner, outer) = (HALF + PLAY, HALF + PLAY + FLANGE);
        let (r, wide) = (self.radius, WIDE * self.radius);
        let spool = text.turned(&[
            dvec2(0.0, -outer),
            dvec2(wide, -outer),
            dvec2(wide, -inner),
            dvec2(r, -inner),
            dvec2(r, inner),
            dvec2(wide, inner),
            dvec2(wide, outer),
            dvec2(0.0, outer),
        ]);
        let at = self.corners[0].extend(0.0);
        text.part("spool", spool, DAffine3::from_translation(at));
        text.file()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use mortise_task::{Assembly, Moved};

    use super::*;

    /// The middle line is free, as near to the walls as it should be, and leads out; off it by more than the clearance the spool meets the plate.
    #[test]
    fn the_middle_line_is_a_way_out() {
        for seed in 0..20 {
            let channel = Channel::random(seed);
            assert!((1..=5).contains(&channel.bends()));
            let file = channel.file().unwrap();
            let assembly = Assembly::new(mortise_brep::load_step(file.path()).unwrap()).unwrap();
            assert_eq!(assembly.count(), 2, "seed {seed}");
            let gap = |at: DVec3| {
                let by = DAffine3::from_translation(at);
                let moved = Moved { parts: &[1], by };
                assembly
                    .clearance(&moved, &[0], 1e3, true)
                    .unwrap()
                    .gap
                    .distance_mm
            };
            let least = channel.clearance.min(PLAY);
            for pair in channel.corners.windows(2) {
                for i in 0..=10 {
                    let at = pair[0].lerp(pair[1], f64::from(i) / 10.0).extend(0.0);
                    assert!((gap(at) - least).abs() < 1e-6, "seed {seed} at {at}: {}", gap(at));
                }
                let across = (pair[1] - pair[0]).normalize().perp();
                let aside = pair[0].midpoint(pair[1]) + across * (channel.clearance + 0.01);
                assert!(gap(aside.extend(0.0)) < -0.009, "seed {seed}");
            }
            let out = channel.corners[channel.corners.len() - 1] + DVec2::X * (WIDE + 1.0) * channel.radius;
            assert!(gap(out.extend(0.0)) > 0.5 * channel.radius);
        }
    }
}
