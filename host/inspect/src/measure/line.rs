//! Straight things: segments, axes, and the nearest points of two of them.

use glam::{DAffine3, DVec3};

/// A line: the axis of something round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLine {
    /// A point of it, mm.
    pub origin: DVec3,
    /// Unit vector along it.
    pub direction: DVec3,
}

impl AxisLine {
    /// The same line seen through a rigid motion.
    pub fn placed(self, pose: &DAffine3) -> Self {
        Self {
            origin: pose.transform_point3(self.origin),
            direction: pose.transform_vector3(self.direction),
        }
    }

    /// The point of the line nearest to `p`, mm.
    pub fn nearest(self, p: DVec3) -> DVec3 {
        self.origin + self.direction * (p - self.origin).dot(self.direction)
    }
}

/// A straight piece: the points `origin + t·direction` for t from `from` to `to`, which may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Straight {
    pub line: AxisLine,
    pub from: f64,
    pub to: f64,
}

impl Straight {
    /// The whole line.
    pub fn whole(line: AxisLine) -> Self {
        Self {
            line,
            from: f64::NEG_INFINITY,
            to: f64::INFINITY,
        }
    }

    pub fn placed(self, pose: &DAffine3) -> Self {
        Self {
            line: self.line.placed(pose),
            ..self
        }
    }

    fn at(self, t: f64) -> DVec3 {
        self.line.origin + self.line.direction * t
    }

    /// Parameter of the point nearest to `p`.
    fn parameter(self, p: DVec3) -> f64 {
        let along = (p - self.line.origin).dot(self.line.direction);
        along.clamp(self.from, self.to)
    }

    pub fn nearest(self, p: DVec3) -> DVec3 {
        self.at(self.parameter(p))
    }

    /// The finite ends.
    pub fn ends(self) -> impl Iterator<Item = DVec3> {
        let ends = [self.from, self.to].into_iter().filter(|t| t.is_finite());
        ends.map(move |t| self.at(t))
    }
}

/// Nearest points of two straight pieces, first on `a`. Of parallel ones, where many pairs are equally near, those at an end of one of them, or else at the
/// origin of `a`.
///
/// The distance is convex in both parameters: its least is at the common perpendicular if that meets both pieces, else at an end of one of them.
pub(super) fn nearest_of(a: Straight, b: Straight) -> [DVec3; 2] {
    let between = a.line.origin - b.line.origin;
    let slant = a.line.direction.dot(b.line.direction);
    let sine_squared = a.line.direction.cross(b.line.direction).length_squared();
    let mut best: Option<[DVec3; 2]> = None;
    let mut offer = |pair: [DVec3; 2]| {
        let length = pair[0].distance_squared(pair[1]);
        if best.is_none_or(|[p, q]| length < p.distance_squared(q)) {
            best = Some(pair);
        }
    };
    for end in a.ends() {
        offer([end, b.nearest(end)]);
    }
    for end in b.ends() {
        offer([a.nearest(end), end]);
    }
    // Below this square of the sine, 1e-9 rad, the foot of the common perpendicular is rounding.
    if sine_squared > 1e-18 {
        let along_a = between.dot(a.line.direction);
        let along_b = between.dot(b.line.direction);
        let s = (slant * along_b - along_a) / sine_squared;
        let t = (along_b - slant * along_a) / sine_squared;
        if (a.from..=a.to).contains(&s) && (b.from..=b.to).contains(&t) {
            offer([a.at(s), b.at(t)]);
        }
    }
    best.unwrap_or_else(|| [a.line.origin, b.nearest(a.line.origin)])
}
