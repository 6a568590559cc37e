//! Division of a chain of boundary pieces into stretches that a short formula follows.
//!
//! A stretch is the curve x(u) = m + a·u + b·u²·(1 − k·(1 − u²)) for −1 ≤ u ≤ 1 through the chain at its middle and its ends. With k = 0 it is a
//! parabola; with k = |b|²/|a|² it follows a circle's arc of half angle θ within r·θ⁶/320, a parabola only within r·θ⁴/32.

use glam::DVec3;

use crate::piece::{Link, Piece, PieceCurve};

/// Halvings of a chain at most: a kink inside a chain would be divided without end.
const MOST_HALVINGS: u32 = 12;

/// Kind of the curve of a stretch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Curve {
    /// k = 0.
    Parabola,
    /// k = |b|²/|a|².
    Round,
}

/// Fineness of a division.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fineness {
    /// Largest distance of a stretch from the chain across its direction, mm.
    pub tolerance_mm: f64,
    /// Largest angle by which the tangent turns from the middle of a stretch to an end, rad.
    pub most_turn: f64,
}

/// A stretch of a chain, mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// m, its middle.
    pub middle: DVec3,
    /// a, the derivative at the middle for k = 0.
    pub along: DVec3,
    /// b, half of the second derivative there for k = 0.
    pub bend: DVec3,
    /// k, from 0 to 1.
    pub round: f64,
    /// Arc lengths of its ends along the chain.
    pub range: [f64; 2],
}

impl Stretch {
    /// The stretch of a chain between two arc lengths.
    pub fn new(chain: &Chain<'_>, range: [f64; 2], curve: Curve) -> Self {
        let [a, middle, b] = [range[0], 0.5 * (range[0] + range[1]), range[1]].map(|s| chain.at(s).1);
        let along = (b - a) / 2.0;
        let mut bend = (a + b) / 2.0 - middle;
        if bend.length() < 1e-6 * along.length() {
            bend = DVec3::ZERO;
        }
        let round = match curve {
            Curve::Parabola => 0.0,
            Curve::Round => bend.length_squared() / along.length_squared().max(1e-300),
        };
        Self {
            middle,
            along,
            bend,
            round,
            range,
        }
    }

    /// The place at `u`.
    fn at(&self, u: f64) -> DVec3 {
        self.middle + self.along * u + self.bend * (u * u * (1.0 - self.round * (1.0 - u * u)))
    }

    /// The derivative at `u`.
    fn tangent(&self, u: f64) -> DVec3 {
        let k = self.round;
        self.along + self.bend * (u * (2.0 * (1.0 - k) + 4.0 * k * u * u))
    }

    /// Largest distance from the chain, across its direction, at places between its ends.
    fn error(&self, chain: &Chain<'_>) -> f64 {
        let [from, to] = self.range;
        let at = |u: f64| {
            let exact = chain.at(0.5 * (from + to + u * (to - from))).1;
            (self.at(u) - exact).reject_from(self.tangent(u)).length()
        };
        [-0.85, -0.6, -0.35, 0.35, 0.6, 0.85]
            .map(at)
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Angle by which its tangent turns from the middle to an end, rad; infinite for a closed chain, which has no chord.
    fn turn(&self) -> f64 {
        2.0 * self.bend.length() / self.along.length().max(1e-300)
    }
}

/// A chain and the arc length at which each of its pieces begins, mm.
pub(crate) struct Chain<'a> {
    pieces: &'a [Piece],
    links: &'a [Link],
    starts: Vec<f64>,
    length: f64,
}

impl<'a> Chain<'a> {
    /// The chain of these of the pieces.
    pub fn new(pieces: &'a [Piece], links: &'a [Link]) -> Self {
        let mut length = 0.0;
        let starts = (links.iter())
            .map(|&(i, _)| {
                let start = length;
                length += pieces[i as usize].length();
                start
            })
            .collect();
        Self {
            pieces,
            links,
            starts,
            length,
        }
    }

    /// The boundary piece at arc length `s`, and the point there.
    pub fn at(&self, s: f64) -> (&'a Piece, DVec3) {
        let k = self.starts.partition_point(|&start| start <= s).max(1) - 1;
        let (i, forward) = self.links[k];
        let piece = &self.pieces[i as usize];
        let t = ((s - self.starts[k]) / piece.length().max(1e-300)).clamp(0.0, 1.0);
        (piece, piece.at(if forward { t } else { 1.0 - t }))
    }

    /// The boundary piece at the middle of a stretch.
    pub fn piece(&self, stretch: &Stretch) -> &'a Piece {
        self.at(0.5 * (stretch.range[0] + stretch.range[1])).0
    }

    /// The stretches of the chain, in order.
    pub fn stretches(&self, curve: Curve, fineness: Fineness) -> Vec<Stretch> {
        let mut all = Vec::new();
        if self.length <= 0.0 {
            return all;
        }
        let parts = self.even_parts(curve, fineness);
        for part in 0..parts {
            let ends = [part, part + 1].map(|k| self.length * k as f64 / parts as f64);
            self.divide(ends, curve, fineness, MOST_HALVINGS, &mut all);
        }
        all
    }

    /// Number of equal parts in which to begin: of a circle, or an arc, as many as its stretches, since halves would be up to twice as many.
    fn even_parts(&self, curve: Curve, fineness: Fineness) -> usize {
        let arcs = || self.links.iter().map(|&(i, _)| &self.pieces[i as usize]);
        if !arcs().all(|piece| matches!(piece.curve, PieceCurve::Arc { .. })) {
            return 1;
        }
        let turn: f64 = arcs().map(Piece::turn).sum();
        let radius = self.length / turn.max(1e-9);
        let tolerance = 0.9 * fineness.tolerance_mm / radius;
        let by_error = match curve {
            Curve::Parabola => (32.0 * tolerance).powf(1.0 / 4.0),
            Curve::Round => (320.0 * tolerance).powf(1.0 / 6.0),
        };
        let half_angle = by_error.min(2.0 * (0.5 * fineness.most_turn).atan());
        (turn / (2.0 * half_angle) - 1e-9).ceil().clamp(1.0, 4096.0) as usize
    }

    /// Appends the stretches between two arc lengths: one, or those of both halves.
    fn divide(
        &self,
        [from, to]: [f64; 2],
        curve: Curve,
        fineness: Fineness,
        halvings: u32,
        out: &mut Vec<Stretch>,
    ) {
        let stretch = Stretch::new(self, [from, to], curve);
        let coarse = || stretch.turn() > fineness.most_turn || stretch.error(self) > fineness.tolerance_mm;
        if halvings > 0 && to - from > fineness.tolerance_mm && coarse() {
            let middle = 0.5 * (from + to);
            self.divide([from, middle], curve, fineness, halvings - 1, out);
            self.divide([middle, to], curve, fineness, halvings - 1, out);
        } else {
            out.push(stretch);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(radius: f64, half_angle: f64) -> Stretch {
        let (sin, cos) = half_angle.sin_cos();
        let (along, bend) = (DVec3::X * radius * sin, DVec3::Y * radius * (1.0 - cos));
        Stretch {
            middle: DVec3::ZERO,
            along,
            bend,
            round: bend.length_squared() / along.length_squared(),
            range: [0.0, 1.0],
        }
    }

    /// The formula's error on an arc is what the division assumes.
    #[test]
    fn a_round_stretch_follows_an_arc() {
        for half_angle in [0.1, 0.2, 0.39] {
            let stretch = arc(10.0, half_angle);
            let off = |i: i32| (stretch.at(f64::from(i) / 500.0).distance(DVec3::Y * 10.0) - 10.0).abs();
            let error = (-500..=500).map(off).fold(0.0, f64::max);
            let assumed = 10.0 * half_angle.powi(6) / 320.0;
            assert!(
                error < assumed * 1.01 && error > 0.9 * assumed,
                "{half_angle}: {error} {assumed}"
            );
        }
    }

    #[test]
    fn the_tangent_is_the_derivative() {
        let stretch = arc(3.0, 0.39);
        for u in [-1.0, -0.4, 0.0, 0.7] {
            let difference = (stretch.at(u + 1e-5) - stretch.at(u - 1e-5)) / 2e-5;
            assert!(difference.distance(stretch.tangent(u)) < 1e-8, "{u}");
        }
    }
}
