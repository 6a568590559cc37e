//! Peg in hole in closed form: depth of the overlap of the two solids at a pose, tilt of the peg, and distance of its tip from the axis.
//!
//! A reference that shares nothing with the force law: no field, no pointshell, no tessellation; f64 throughout. The peg is a cylinder between two
//! planes, the block six planes and a bore (see [`crate::fit`]). Inside either solid the distance to its surface is the least of the distances to its
//! faces, because the foot of the nearest one always lies on that face. The penetration is the largest such distance of any point of one surface
//! inside the other solid; it is attained
//!
//! * for the peg's surface on its rims, or on a generator of its side where that leaves the block or its depth changes from one face to another: the
//!   distance to the bore's axis is convex along a straight line, that to a plane linear;
//! * for the block's surface on the rims of the bore, or on a generator of the bore, along which the depth in the peg is concave.
//!
//! Rims and generators are sampled in 0.5° steps, and golden-section search refines the best step. Before the refinement a step underestimates the
//! depth by less than r/2·(0.25°)² ≈ 0.1 µm in the sharpest case, two rims that cross. Cost: about 50 µs for a pose in contact.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};
use mortise_scenario::PreparedScene;

use crate::fit::Fit;

/// Steps round a rim.
const STEPS: u32 = 720;
/// Golden-section iterations on the best step, each a factor of 0.618.
const SECTIONS: u32 = 24;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// The two solids of a [`Fit`], mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactFit {
    fit: Fit,
    /// World to the peg's frame at its placement in the file.
    placed: DAffine3,
}

/// `scene`, which must be made from `fit`, with its penetration measured in closed form.
pub(crate) fn made_from(scene: PreparedScene, fit: Fit) -> PreparedScene {
    let exact = ExactFit::of(&scene, fit);
    scene.with_closed_form(Box::new(move |pose| exact.penetration_mm(pose)))
}

/// The peg at a pose.
#[derive(Clone, Copy, Debug)]
struct Peg {
    tip: DVec3,
    /// From the tip to the other end, and two directions perpendicular to it.
    axis: DVec3,
    across: [DVec3; 2],
    radius: f64,
    length: f64,
}

impl ExactFit {
    /// The peg and the hole of `fit`, from which `scene` was made.
    pub fn of(scene: &PreparedScene, fit: Fit) -> Self {
        Self {
            fit,
            placed: scene.placement().inverse(),
        }
    }

    fn peg(&self, pose: &DAffine3) -> Peg {
        let moved = *pose * self.placed;
        Peg {
            tip: moved.transform_point3(DVec3::new(0.0, 0.0, -self.fit.engaged_mm)),
            axis: moved.transform_vector3(DVec3::Z),
            across: [DVec3::X, DVec3::Y].map(|v| moved.transform_vector3(v)),
            radius: 0.5 * self.fit.peg_mm,
            length: self.fit.length_mm,
        }
    }

    /// Deepest point of either solid's surface inside the other, mm, with the peg's shape at `pose`; 0 without overlap.
    pub fn penetration_mm(&self, pose: &DAffine3) -> f64 {
        self.overlap(&self.peg(pose))
    }

    /// Angle between the peg's axis and the hole's, degrees, and distance of the middle of the peg's leading end from the hole's axis, mm.
    pub fn leaning(&self, pose: &DAffine3) -> (f64, f64) {
        let peg = self.peg(pose);
        let tilt = peg.axis.truncate().length().atan2(peg.axis.z);
        (tilt.to_degrees(), peg.tip.truncate().length())
    }

    /// Depth of the leading end's lowest point below the block's top, mm.
    pub fn depth_mm(&self, pose: &DAffine3) -> f64 {
        let peg = self.peg(pose);
        peg.radius * peg.axis.truncate().length() - peg.tip.z
    }

    /// Depth of `p` in the block; negative outside.
    fn in_block(&self, p: DVec3) -> f64 {
        let half = 0.5 * self.fit.width_mm;
        (p.truncate().length() - 0.5 * self.fit.hole_mm)
            .min(-p.z)
            .min(p.z + self.fit.height_mm)
            .min(half - p.x.abs())
            .min(half - p.y.abs())
    }

    fn overlap(&self, peg: &Peg) -> f64 {
        let (bore, height) = (0.5 * self.fit.hole_mm, self.fit.height_mm);
        let on_bore = |angle: f64, z: f64| DVec3::new(bore * angle.cos(), bore * angle.sin(), z);
        let rims = [0.0, peg.length].map(|s| round(|angle| self.in_block(peg.side(angle, s))));
        let mouths = [0.0, -height].map(|z| round(|angle| peg.contains(on_bore(angle, z))));
        let side = round(|angle| self.along_side(peg, angle));
        // Along the bore's wall a depth changes by at most the sine of the tilt per millimetre.
        let change = 0.5 * height * peg.axis.truncate().length();
        let wall = round(|angle| {
            let most = peg.radial(on_bore(angle, -0.5 * height)) + change;
            if most <= 0.0 {
                return most;
            }
            golden(-height, 0.0, |z| peg.contains(on_bore(angle, z)))
        });
        [rims[0], rims[1], mouths[0], mouths[1], side, wall]
            .into_iter()
            .fold(0.0, f64::max)
    }

    /// Deepest point of one generator of the peg's side in the block: at its ends within the block, or where it is as far from the bore as from the
    /// block's top or bottom.
    fn along_side(&self, peg: &Peg, angle: f64) -> f64 {
        let at = |s: f64| peg.side(angle, s);
        let climb = peg.axis.z;
        if climb.abs() < 1e-6 {
            // The peg lies on its side, which no insertion reaches.
            return f64::NEG_INFINITY;
        }
        let when = |z: f64| ((z - at(0.0).z) / climb).clamp(0.0, peg.length);
        let (bottom, top) = (when(-self.fit.height_mm), when(0.0));
        let beyond = |s: f64| at(s).truncate().length() - 0.5 * self.fit.hole_mm;
        // Convex: if neither end is in the wall, no point between them is.
        if beyond(bottom) <= 0.0 && beyond(top) <= 0.0 {
            return f64::NEG_INFINITY;
        }
        let middle = 0.5 * (bottom + top);
        [top, bottom]
            .map(|end| {
                // From the end, where the plane is nearest, to where the bore's wall is nearer.
                let (mut near, mut far) = (end, middle);
                for _ in 0..40 {
                    let s = 0.5 * (near + far);
                    let p = at(s);
                    let plane = if end == top {
                        -p.z
                    } else {
                        p.z + self.fit.height_mm
                    };
                    if beyond(s) > plane {
                        near = s;
                    } else {
                        far = s;
                    }
                }
                self.in_block(at(far)).max(self.in_block(at(end)))
            })
            .into_iter()
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

impl Peg {
    /// A point of the side at distance `s` from the tip.
    fn side(&self, angle: f64, s: f64) -> DVec3 {
        let out = self.across[0] * angle.cos() + self.across[1] * angle.sin();
        self.tip + out * self.radius + self.axis * s
    }

    /// Depth of `q` in the peg's infinite cylinder; negative outside.
    fn radial(&self, q: DVec3) -> f64 {
        let from = q - self.tip;
        self.radius - (from - self.axis * from.dot(self.axis)).length()
    }

    /// Depth of `q` in the peg; negative outside.
    fn contains(&self, q: DVec3) -> f64 {
        let s = (q - self.tip).dot(self.axis);
        self.radial(q).min(s).min(self.length - s)
    }
}

/// Largest value on a circle.
fn round(of: impl Fn(f64) -> f64) -> f64 {
    let step = TAU / f64::from(STEPS);
    let (mut at, mut most) = (0.0, f64::NEG_INFINITY);
    for i in 0..STEPS {
        let angle = step * f64::from(i);
        let value = of(angle);
        if value > most {
            (at, most) = (angle, value);
        }
    }
    // Far from contact the exact value is not needed.
    if most < -1e-3 {
        return most;
    }
    most.max(golden(at - step, at + step, of))
}

/// Largest value of a function with one peak.
pub(crate) fn golden(mut low: f64, mut high: f64, of: impl Fn(f64) -> f64) -> f64 {
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(&of);
    for _ in 0..SECTIONS {
        if values[0] > values[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [of(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], of(inner[1])];
        }
    }
    values[0].max(values[1])
}
