//! The contact law evaluated on the exact surfaces: the force on the moving part that both pointshells would produce if every distance were that of
//! the exact surface.
//!
//! λ = k·max(0, −(φ + τ·min(0, φ̇))) for each point of either shell, and four times that for the deepest place of each span of an edge, found by a
//! search of its own, and for each two edges that cross ([`crate::crossing_law`]); φ is its signed distance from the other part's exact surface at the end of
//! the tick (f64, CAD faces; no field; of the image only the positions of points and spans), φ̇ its change over the tick, along the exact surface's
//! normal. The sum is compared with the contact force that the board reports for the same tick.
//!
//! Poses are reported in single precision: half a unit in the last place of 0.05 m and of a quaternion is 2 nm each at the peg's rim, 0.8 mN a point
//! at 200 kN/m.

use glam::{DAffine3, DVec3};
use mortise_haptics::Settings;
use mortise_protocol::image::{SceneImage, Shape};
use mortise_protocol::message::Telemetry;

use mortise_scenario::wire::{pose_mm, vector};
use mortise_scenario::{Body, PreparedScene};

use crate::crossing_law::{Piece, STIFFNESS, crossings};
use crate::error::LabError;
use crate::span::Span;

/// Distance, mm, beyond which a point has no force: more than closes in the time of the damping, 0.5 ms at 40 mm/s.
const REACH_MM: f64 = 0.02;

/// One tick's contact force on the moving part, N.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pushed {
    /// As the board reports it.
    pub reported: DVec3,
    /// On the exact surfaces.
    pub exact: DVec3,
}

/// Contact force of every pair of consecutive ticks of `samples`.
///
/// # Errors
/// `Input`, never for images that the baker wrote.
pub(crate) fn pushed(scene: &PreparedScene, samples: &[Telemetry]) -> Result<Vec<Pushed>, LabError> {
    let shells = shells(scene)?;
    let edges = edges(scene)?;
    let bodies = scene.bodies();
    let moving = usize::from(scene.part);
    let mut clear: Vec<[Clear; 2]> = (bodies.iter().enumerate())
        .map(|(index, _)| [Clear::new(shells[moving].len()), Clear::new(shells[index].len())])
        .collect();
    let poses = samples.windows(2).filter_map(|pair| {
        let [(_, before), (_, after)] = [pair[0].object.as_ref()?, pair[1].object.as_ref()?];
        (pair[1].tick == pair[0].tick + 1).then(|| ([pose_mm(before), pose_mm(after)], &pair[1]))
    });
    let mut all = Vec::new();
    for (poses, sample) in poses {
        let mut exact = Vec::new();
        for (index, other) in bodies.iter().enumerate().filter(|&(index, _)| index != moving) {
            let to_other = poses.map(|pose| other.placement.inverse() * pose);
            let to_part = to_other.map(|to| to.inverse());
            let [forward, backward] = &mut clear[index];
            forward.touching(
                &shells[moving],
                &to_other,
                other,
                &mut |share, gap, rate, normal| {
                    exact.push((share, gap, rate, other.placement.transform_vector3(normal)));
                },
            );
            let part = &bodies[moving];
            backward.touching(&shells[index], &to_part, part, &mut |share, gap, rate, normal| {
                exact.push((share, gap, rate, -poses[1].transform_vector3(normal)));
            });
            let hertz = 1.0 / f64::from(Settings::default().period_s);
            for found in crossings(&edges[moving], &to_other, &edges[index], REACH_MM) {
                let normal = other.placement.transform_vector3(found.normal);
                exact.push((STIFFNESS, found.gap, hertz * found.change, normal));
            }
        }
        all.push(Pushed {
            reported: vector(sample.contact.force),
            exact: force(&exact),
        });
    }
    Ok(all)
}

/// Sum over contacts given by their share of the stiffness, gap (mm), rate (mm/s) and direction.
fn force(contacts: &[(f64, f64, f64, DVec3)]) -> DVec3 {
    let law = Settings::default().contact;
    let touching = contacts.iter().filter(|(_, gap, ..)| *gap < 0.0).count().max(1);
    let each = f64::from(law.stiffness_n_per_m);
    let k = 1e-3 * each.min(f64::from(law.total_stiffness_n_per_m) / touching as f64);
    (contacts.iter())
        .map(|&(share, gap, rate, normal)| {
            share * k * (-(gap + f64::from(law.damping_s) * rate.min(0.0))).max(0.0) * normal
        })
        .sum()
}

/// Points and spans of each part's shell, in its shape's frame.
fn shells(scene: &PreparedScene) -> Result<Vec<Vec<Span>>, LabError> {
    of_parts(scene, |shape| {
        shape
            .points
            .iter()
            .map(|point| Span::of(point, shape.spans))
            .collect()
    })
}

/// Pieces of each part's sharp convex edges, in its shape's frame.
fn edges(scene: &PreparedScene) -> Result<Vec<Vec<Piece>>, LabError> {
    of_parts(scene, |shape| shape.edges.iter().map(Piece::of).collect())
}

fn of_parts<T>(scene: &PreparedScene, read: impl Fn(&Shape<'_>) -> T) -> Result<Vec<T>, LabError> {
    let mut words = vec![0u32; scene.image.len().div_ceil(4)];
    bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..scene.image.len()].copy_from_slice(&scene.image);
    let image = SceneImage::open(bytemuck::cast_slice(&words)).map_err(|error| LabError::Input {
        name: "scene".into(),
        what: error.to_string(),
    })?;
    Ok((0..image.parts().len())
        .map(|part| read(&image.shape_of_part(part)))
        .collect())
}

/// Distance by which points are known to be clear of a body: a distance changes by no more than its point moves.
struct Clear {
    at: Vec<DVec3>,
    distance: Vec<f64>,
}

impl Clear {
    fn new(points: usize) -> Self {
        Self {
            at: vec![DVec3::ZERO; points],
            distance: vec![f64::NEG_INFINITY; points],
        }
    }

    /// Share of the stiffness, gap, rate and outward normal (frame of `body`) of every point and span within reach; the pose changes from the first of `to_body` to the second in one
    /// tick.
    fn touching(
        &mut self,
        points: &[Span],
        to_body: &[DAffine3; 2],
        body: &Body,
        out: &mut dyn FnMut(f64, f64, f64, DVec3),
    ) {
        let hertz = 1.0 / f64::from(Settings::default().period_s);
        for (i, span) in points.iter().enumerate() {
            let middle = to_body[1].transform_point3(span.at(0.0));
            let reach = REACH_MM + span.reach();
            if self.distance[i] - middle.distance(self.at[i]) > reach {
                continue;
            }
            let Some(nearest) = body.surface.nearest(middle) else {
                continue;
            };
            (self.at[i], self.distance[i]) = (middle, nearest.distance);
            if nearest.distance > reach {
                continue;
            }
            let gap = |p: DVec3| {
                body.surface
                    .nearest(to_body[1].transform_point3(p))
                    .map_or(f64::INFINITY, |n| n.distance)
            };
            let deepest = span.at(span.deepest(gap));
            let [before, after] = to_body.map(|to| to.transform_point3(deepest));
            let Some(nearest) = body.surface.nearest(after) else {
                continue;
            };
            if nearest.distance > REACH_MM {
                continue;
            }
            let was = body
                .surface
                .nearest(before)
                .map_or(nearest.distance, |was| was.distance);
            let outward = (after - nearest.point) * nearest.distance.signum();
            if let Some(normal) = outward.try_normalize() {
                let share = if span.reach() > 0.0 { STIFFNESS } else { 1.0 };
                out(share, nearest.distance, hertz * (nearest.distance - was), normal);
            }
        }
    }
}
