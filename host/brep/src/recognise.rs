//! Recognition of planes, cylinders, spheres, cones and tori in spline surfaces.
//!
//! Some systems write every surface as a spline. From points p and outward unit normals n of the exact spline, linear least squares gives an initial
//! guess: all n equal (plane); n ⟂ a, then p = c + r n across a (cylinder); p = c + r n (sphere); a·n constant and n·(p − apex) = 0 (cone); normals
//! that all intersect one line, then p = c + r n in the half-plane through it (torus; Pottmann & Randrup 1998). Gauss–Newton on the distances then
//! refines it to a least-squares fit (Marshall, Lukács & Martin 2001); its largest distance is the fit error. A fit is accepted, and the surface
//! replaces the spline, when that error is within the tolerance and every normal agrees.
//!
//! Cost: a few passes over some hundreds of samples per face.

use glam::DVec3;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, SymmetricEigen, Vector3, Vector4};

use crate::{Frame, Surface};

/// A point of a surface and the outward unit normal there.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Position, mm.
    pub point: DVec3,
    /// Unit vector.
    pub normal: DVec3,
}

/// Fewest samples: one triangle's corners, side middles and centre.
const FEWEST: usize = 7;
/// Largest angle between a spline's normal and that of its replacement, radians: a ripple of 1 µm over 1 mm.
const NORMAL_RAD: f64 = 3e-3;
/// Largest ratio of radius to face size: a larger radius is estimated from almost no curvature.
const FLATTEST: f64 = 1e3;

/// The simplest surface within `within` mm of all samples, and its largest distance from a sample; `None` when there is none.
pub fn surface(samples: &[Sample], within: f64) -> Option<(Surface, f64)> {
    if samples.len() < FEWEST || within.is_nan() || within <= 0.0 {
        return None;
    }
    let cloud = Cloud::new(samples)?;
    [
        plane as fn(&Cloud) -> Option<Surface>,
        cylinder,
        sphere,
        cone,
        torus,
    ]
    .iter()
    .filter_map(|guess| cloud.fit(guess(&cloud)?, within))
    .next()
}

struct Cloud<'a> {
    samples: &'a [Sample],
    center: DVec3,
    /// Radius of the ball about `center` that contains all points, mm.
    size: f64,
}

impl<'a> Cloud<'a> {
    fn new(samples: &'a [Sample]) -> Option<Self> {
        let center = samples.iter().map(|s| s.point).sum::<DVec3>() / samples.len() as f64;
        let size = samples
            .iter()
            .map(|s| s.point.distance(center))
            .fold(0.0, f64::max);
        (size > 0.0 && size.is_finite()).then_some(Self {
            samples,
            center,
            size,
        })
    }

    /// (point relative to the centre, normal).
    fn local(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        self.samples.iter().map(|s| (s.point - self.center, s.normal))
    }

    /// The refined and checked surface, with its error.
    fn fit(&self, guess: Surface, within: f64) -> Option<(Surface, f64)> {
        let mut best = (guess, self.error(&guess)?);
        for _ in 0..6 {
            let Some(next) = self.step(&best.0) else { break };
            match self.error(&next) {
                Some(error) if error < best.1 => best = (next, error),
                _ => break,
            }
        }
        let (surface, error) = best;
        (error <= within && plausible(&surface, self.size) && self.normals_agree(&surface)).then_some(best)
    }

    fn error(&self, surface: &Surface) -> Option<f64> {
        self.samples.iter().try_fold(0.0, |worst: f64, s| {
            let (d, _) = surface.distance(s.point)?;
            d.is_finite().then(|| worst.max(d.abs()))
        })
    }

    /// Whether all normals are along the natural normal, or all against it.
    fn normals_agree(&self, surface: &Surface) -> bool {
        let cos = |s: &Sample| surface.distance(s.point).map_or(0.0, |(_, n)| n.dot(s.normal));
        let sign = cos(&self.samples[0]).signum();
        self.samples.iter().all(|s| cos(s) * sign >= NORMAL_RAD.cos())
    }

    /// One Gauss–Newton step. Moving the surface by a twist (v, ω) about the centre changes the distance of p by −n·(v + ω × p); the pseudo-inverse
    /// ignores motions that do not change it (sliding along an axis).
    fn step(&self, surface: &Surface) -> Option<Surface> {
        let shapes = shape_count(surface);
        let mut jtj = DMatrix::<f64>::zeros(6 + shapes, 6 + shapes);
        let mut jtr = DVector::<f64>::zeros(6 + shapes);
        for (p, _) in self.local() {
            let (d, n) = surface.distance(p + self.center)?;
            let turn = p.cross(n) / self.size;
            let mut row = DVector::<f64>::zeros(6 + shapes);
            row.as_mut_slice()[..6].copy_from_slice(&[-n.x, -n.y, -n.z, -turn.x, -turn.y, -turn.z]);
            shape_derivative(surface, p + self.center, self.size, &mut row.as_mut_slice()[6..])?;
            jtj += &row * row.transpose();
            jtr += row * d;
        }
        let eigen = SymmetricEigen::new(jtj);
        let floor = eigen.eigenvalues.max() * 1e-12;
        let mut delta = DVector::<f64>::zeros(6 + shapes);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > floor {
                delta -= vector * (vector.dot(&jtr) / value);
            }
        }
        let move_by = DVec3::new(delta[0], delta[1], delta[2]);
        let turn_by = DVec3::new(delta[3], delta[4], delta[5]) / self.size;
        Some(changed(
            surface,
            self.center,
            move_by,
            turn_by,
            &delta.as_slice()[6..],
            self.size,
        ))
    }
}

fn shape_count(surface: &Surface) -> usize {
    match surface {
        Surface::Plane { .. } | Surface::Spline => 0,
        Surface::Cylinder { .. } | Surface::Sphere { .. } | Surface::Cone { .. } => 1,
        Surface::Torus { .. } => 2,
    }
}

/// Derivative of the distance of `p` with respect to the surface's own sizes: its radii, or a cone's angle times `size`.
fn shape_derivative(surface: &Surface, p: DVec3, size: f64, out: &mut [f64]) -> Option<()> {
    match *surface {
        Surface::Plane { .. } | Surface::Spline => {}
        Surface::Cylinder { .. } | Surface::Sphere { .. } => out[0] = -1.0,
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => {
            let d = p - frame.origin;
            let (sin, cos) = half_angle.sin_cos();
            let rho = d.reject_from_normalized(frame.z).length();
            out[0] = ((radius - rho) * sin - d.dot(frame.z) * cos) / size;
        }
        Surface::Torus { frame, major, .. } => {
            let d = p - frame.origin;
            let across = d.reject_from_normalized(frame.z);
            let tube = d - across.try_normalize()? * major;
            out.copy_from_slice(&[-(across.length() - major) / tube.length(), -1.0]);
        }
    }
    Some(())
}

fn changed(surface: &Surface, center: DVec3, by: DVec3, turn: DVec3, shape: &[f64], size: f64) -> Surface {
    let rotation = glam::DQuat::from_scaled_axis(turn);
    let moved = |f: &Frame| {
        frame(
            center + by + rotation * (f.origin - center),
            rotation * f.z,
            rotation * f.x,
        )
    };
    match surface {
        Surface::Plane { frame } => Surface::Plane { frame: moved(frame) },
        Surface::Cylinder { frame, radius } => Surface::Cylinder {
            frame: moved(frame),
            radius: radius + shape[0],
        },
        Surface::Cone {
            frame,
            radius,
            half_angle,
        } => Surface::Cone {
            frame: moved(frame),
            radius: *radius,
            half_angle: half_angle + shape[0] / size,
        },
        Surface::Sphere { frame, radius } => Surface::Sphere {
            frame: moved(frame),
            radius: radius + shape[0],
        },
        Surface::Torus { frame, major, minor } => Surface::Torus {
            frame: moved(frame),
            major: major + shape[0],
            minor: minor + shape[1],
        },
        Surface::Spline => Surface::Spline,
    }
}

fn plausible(surface: &Surface, size: f64) -> bool {
    let sound = |radius: f64| radius > 1e-6 * size && radius < FLATTEST * size;
    match *surface {
        Surface::Plane { .. } => true,
        Surface::Cylinder { radius, .. } | Surface::Sphere { radius, .. } => sound(radius),
        Surface::Cone {
            radius, half_angle, ..
        } => sound(radius) && (1e-4..1.5).contains(&half_angle.abs()),
        Surface::Torus { major, minor, .. } => sound(major) && sound(minor),
        Surface::Spline => false,
    }
}

/// Frame with the given z, and x near `near_x`.
fn frame(origin: DVec3, z: DVec3, near_x: DVec3) -> Frame {
    let z = z.normalize();
    let x = near_x
        .reject_from_normalized(z)
        .try_normalize()
        .unwrap_or_else(|| z.any_orthonormal_vector());
    Frame {
        origin,
        x,
        y: z.cross(x),
        z,
    }
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn plane(cloud: &Cloud) -> Option<Surface> {
    let normal = cloud
        .samples
        .iter()
        .map(|s| s.normal)
        .sum::<DVec3>()
        .try_normalize()?;
    Some(Surface::Plane {
        frame: frame(cloud.center, normal, normal.any_orthonormal_vector()),
    })
}

/// Direction in which the vectors extend least: eigenvector of Σ v vᵀ.
fn least(vectors: impl Iterator<Item = DVec3>) -> Option<DVec3> {
    let sum = vectors.fold(Matrix3::zeros(), |sum, v| sum + vector(v) * vector(v).transpose());
    let eigen = SymmetricEigen::new(sum);
    let (smallest, _) = eigen.eigenvalues.argmin();
    let v = eigen.eigenvectors.column(smallest);
    DVec3::new(v[0], v[1], v[2]).try_normalize()
}

/// Least squares of point = center + radius · normal in the plane: (center, radius).
fn circle(pairs: impl Iterator<Item = ([f64; 2], [f64; 2])>) -> Option<([f64; 2], f64)> {
    let (mut m, mut b) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    for (p, n) in pairs {
        for k in 0..2 {
            let row = Vector3::new(f64::from(k == 0), f64::from(k == 1), n[k as usize]);
            m += row * row.transpose();
            b += row * p[k as usize];
        }
    }
    let x = m.lu().solve(&b)?;
    Some(([x[0], x[1]], x[2]))
}

fn cylinder(cloud: &Cloud) -> Option<Surface> {
    let axis = least(cloud.local().map(|(_, n)| n))?;
    let f = frame(DVec3::ZERO, axis, axis.any_orthonormal_vector());
    let flat = |v: DVec3| [v.dot(f.x), v.dot(f.y)];
    let (center, radius) = circle(cloud.local().map(|(p, n)| (flat(p), flat(n))))?;
    Some(Surface::Cylinder {
        frame: Frame {
            origin: cloud.center + f.x * center[0] + f.y * center[1],
            ..f
        },
        radius: radius.abs(),
    })
}

fn sphere(cloud: &Cloud) -> Option<Surface> {
    let (mut m, mut b) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros());
    for (p, n) in cloud.local() {
        for k in 0..3 {
            let mut row = Vector4::zeros();
            row[k] = 1.0;
            row[3] = n[k];
            m += row * row.transpose();
            b += row * p[k];
        }
    }
    let x = m.lu().solve(&b)?;
    Some(Surface::Sphere {
        frame: frame(cloud.center + DVec3::new(x[0], x[1], x[2]), DVec3::Z, DVec3::X),
        radius: x[3].abs(),
    })
}

fn cone(cloud: &Cloud) -> Option<Surface> {
    let mean = cloud.local().map(|(_, n)| n).sum::<DVec3>() / cloud.samples.len() as f64;
    let axis = least(cloud.local().map(|(_, n)| n - mean))?;
    let (mut m, mut b) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
    for (p, n) in cloud.local() {
        m += vector(n) * vector(n).transpose();
        b += vector(n) * n.dot(p);
    }
    let x = m.lu().solve(&b)?;
    let apex = DVec3::new(x[0], x[1], x[2]);
    let axis = if (-apex).dot(axis) < 0.0 { -axis } else { axis };
    let z = |p: DVec3| (p - apex).dot(axis);
    let (height, radius) = cloud.local().fold((0.0, 0.0), |(h, r), (p, _)| {
        (h + z(p), r + (p - apex).reject_from_normalized(axis).length())
    });
    let half_angle = radius.atan2(height);
    let height = height / cloud.samples.len() as f64;
    Some(Surface::Cone {
        frame: frame(
            cloud.center + apex + axis * height,
            axis,
            axis.any_orthonormal_vector(),
        ),
        radius: height * half_angle.tan(),
        half_angle,
    })
}

/// Torus whose axis (a, ā) intersects every normal: a·(p × n) + ā·n = 0.
fn torus(cloud: &Cloud) -> Option<Surface> {
    let mut m = DMatrix::<f64>::zeros(6, 6);
    for (p, n) in cloud.local() {
        let moment = p.cross(n) / cloud.size;
        let row = DVector::from_row_slice(&[moment.x, moment.y, moment.z, n.x, n.y, n.z]);
        m += &row * row.transpose();
    }
    let eigen = SymmetricEigen::new(m);
    let (smallest, _) = eigen.eigenvalues.argmin();
    let v = eigen.eigenvectors.column(smallest);
    let along = DVec3::new(v[0], v[1], v[2]) / cloud.size;
    let moment = DVec3::new(v[3], v[4], v[5]);
    let axis = along.try_normalize()?;
    let foot = axis.cross(moment) / along.length();
    let f = frame(foot, axis, axis.any_orthonormal_vector());
    let pairs = || {
        cloud.local().filter_map(|(p, n)| {
            let d = p - foot;
            let out = d.reject_from_normalized(axis).try_normalize()?;
            Some(([d.dot(out), d.dot(axis)], [n.dot(out), n.dot(axis)]))
        })
    };
    let (center, minor) = circle(pairs())?;
    Some(Surface::Torus {
        frame: Frame {
            origin: cloud.center + foot + axis * center[1],
            ..f
        },
        major: center[0].abs(),
        minor: minor.abs(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Points and normals of a patch of `surface`, which begins at angle `turn.0` and spans `turn.1`; `ripple` is added along the
    /// normal.
    fn patch(surface: &Surface, turn: (f64, f64), ripple: f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        for i in 0..12 {
            for j in 0..7 {
                let (s, t) = (f64::from(i) / 11.0, f64::from(j) / 6.0);
                let angle = turn.0 + turn.1 * s;
                let around = |f: &Frame| f.x * angle.cos() + f.y * angle.sin();
                let (point, normal) = match *surface {
                    Surface::Plane { frame: f } => (f.origin + f.x * (20.0 * s) + f.y * (9.0 * t), f.z),
                    Surface::Cylinder { frame: f, radius } => {
                        (f.origin + around(&f) * radius + f.z * (12.0 * t), around(&f))
                    }
                    Surface::Cone {
                        frame: f,
                        radius,
                        half_angle,
                    } => {
                        let (sin, cos) = half_angle.sin_cos();
                        let z = radius * t;
                        (
                            f.origin + around(&f) * (radius + z * sin / cos) + f.z * z,
                            around(&f) * cos - f.z * sin,
                        )
                    }
                    Surface::Sphere { frame: f, radius } => {
                        let n = around(&f) * (0.2 + t).cos() + f.z * (0.2 + t).sin();
                        (f.origin + n * radius, n)
                    }
                    Surface::Torus {
                        frame: f,
                        major,
                        minor,
                    } => {
                        let n = around(&f) * (3.0 * t).cos() + f.z * (3.0 * t).sin();
                        (f.origin + around(&f) * major + n * minor, n)
                    }
                    Surface::Spline => unreachable!(),
                };
                let ripple = ripple * (7.3 * s + 2.9 * t).sin() * (5.1 * t).cos();
                samples.push(Sample {
                    point: point + normal * ripple,
                    normal,
                });
            }
        }
        samples
    }

    fn like(a: &Surface, b: &Surface) -> bool {
        std::mem::discriminant(a) == std::mem::discriminant(b)
    }

    proptest! {
        /// Samples of each kind, inside or outside, yield a surface that contains the whole original, also beyond the patch; a ripple is measured,
        /// and refused when it exceeds the tolerance.
        #[test]
        fn what_was_sampled_is_recognised(
            axis in prop::array::uniform3(-1.0f64..1.0),
            origin in prop::array::uniform3(-80.0f64..80.0),
            radius in 1.0f64..40.0,
            start in -3.0f64..3.0,
            span in 0.5f64..std::f64::consts::TAU,
            inward in any::<bool>(),
        ) {
            let z = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
            let frame = frame(origin.into(), z, z.any_orthonormal_vector());
            let surfaces = [
                Surface::Plane { frame },
                Surface::Cylinder { frame, radius },
                Surface::Cone { frame, radius, half_angle: 0.3 },
                Surface::Cone { frame, radius, half_angle: -0.5 },
                Surface::Sphere { frame, radius },
                Surface::Torus { frame, major: 3.0 * radius, minor: radius },
            ];
            // On a small patch a larger ripple would tilt the normals too far.
            let ripple = 5e-4 * (radius / 4.0).min(1.0);
            for truth in surfaces {
                let turned = |mut samples: Vec<Sample>| {
                    if inward { samples.iter_mut().for_each(|s| s.normal = -s.normal); }
                    samples
                };
                let (found, fit) = surface(&turned(patch(&truth, (start, span), 0.0)), 1e-6)
                    .ok_or_else(|| TestCaseError::fail(format!("{truth:?} not recognised")))?;
                prop_assert!(like(&found, &truth), "{found:?} for {truth:?}");
                prop_assert!(fit < 1e-9, "{fit}");
                // Half a turn farther: the parameters are right, not only the patch. A patch of half a radian determines them (2/0.5)⁴ less
                // accurately than its points.
                for s in patch(&truth, (start + 3.0, 1.0), 0.0) {
                    let (off, _) = found.distance(s.point).unwrap();
                    prop_assert!(off.abs() < 1e-6, "{off} {found:?} for {truth:?}");
                }
                let (_, fit) = surface(&turned(patch(&truth, (start, span), ripple)), 1e-3)
                    .ok_or_else(|| TestCaseError::fail(format!("rippled {truth:?} not recognised")))?;
                prop_assert!(fit > 1e-5 && fit <= 5.1e-4, "{fit}");
                prop_assert!(surface(&turned(patch(&truth, (start, span), 5e-4)), 1e-6).is_none());
            }
        }
    }

    #[test]
    fn a_saddle_is_none_of_them() {
        let samples: Vec<Sample> = (0..64)
            .map(|i| {
                let (x, y) = (f64::from(i % 8) - 3.5, f64::from(i / 8) - 3.5);
                Sample {
                    point: DVec3::new(x, y, 0.05 * x * y),
                    normal: DVec3::new(-0.05 * y, -0.05 * x, 1.0).normalize(),
                }
            })
            .collect();
        assert_eq!(surface(&samples, 1e-2), None);
    }
}
