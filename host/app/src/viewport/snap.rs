//! Which feature is meant by a place on the screen: the nearest visible vertex, axis or edge within some points of it, or else the face there. Pure.
//!
//! A feature is visible unless a part lies before it or a section cuts it away. Cost: linear in the points of the shown parts' edges, and one ray for
//! the place and each of the few nearest candidates.

use egui::{Pos2, Rect, Vec2};
use glam::{DMat4, DVec3};
use mortise_brep::{Curve, Shape, Surface};
use mortise_inspect::measure::{Feature, Round};

use super::camera::Camera;
use super::outline;
use super::pick::{Pick, pick};
use super::screen::{aspect, from_ndc, ndc, on_screen};
use crate::cut::Shown;
use crate::session::document::Document;

/// Distances on the screen within which a vertex or centre, an axis, and an edge are meant, points.
const REACH: [f32; 3] = [9.0, 6.0, 7.0];
/// Candidates whose visibility is tried.
const TRIED: usize = 6;
/// Depth by which a feature may lie behind a surface and still be on it, in points of the screen there.
const SLACK: f64 = 2.0;

/// What kind of feature is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wanted {
    /// The most special one near.
    #[default]
    Anything,
    /// A vertex, or the centre of a circle or sphere.
    Point,
    /// An edge.
    Edge,
    /// The axis of a circle, cylinder, cone or torus.
    Axis,
    /// A face.
    Face,
}

/// The view in which a feature is looked for.
#[derive(Clone, Copy)]
pub struct SnapView<'a> {
    /// What is shown.
    pub document: &'a Document,
    /// The section, where there is one.
    pub cut: Option<Shown<'a>>,
    /// From where.
    pub camera: &'a Camera,
    /// Where on the screen.
    pub rect: Rect,
}

/// A feature of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snap {
    /// Index of the part.
    pub part: usize,
    /// The feature.
    pub feature: Feature,
    /// The place of it that was pointed at, world, mm.
    pub point: DVec3,
}

/// A feature near the pointer.
struct Near {
    snap: Snap,
    /// Distance from the pointer, points.
    away: f32,
}

impl SnapView<'_> {
    /// The feature at a place on the screen.
    pub fn snap(&self, at: Pos2, wanted: Wanted) -> Option<Snap> {
        let hit = self.under(at);
        let face = hit.and_then(|hit| self.face(hit));
        match wanted {
            Wanted::Face => face,
            Wanted::Edge => self.edge(at),
            Wanted::Point => self
                .vertex(at)
                .or_else(|| self.edge(at).and_then(|edge| self.center(edge)))
                .or_else(|| face.and_then(|face| self.center(face))),
            Wanted::Axis => face
                .and_then(|face| self.axis_of(face))
                .or_else(|| self.edge(at).and_then(|edge| self.axis_of(edge)))
                .or_else(|| self.axis(at)),
            Wanted::Anything => self
                .vertex(at)
                .or_else(|| self.axis(at))
                .or_else(|| self.edge(at))
                .or(face),
        }
    }

    fn under(&self, at: Pos2) -> Option<Pick> {
        self.along(ndc(self.rect, at)).1
    }

    /// Where the ray through a place begins and what it meets first.
    fn along(&self, at: glam::DVec2) -> ((DVec3, DVec3), Option<Pick>) {
        let document = self.document;
        let ray = self.camera.ray_before(at, aspect(self.rect), document.extent);
        let hit = pick(
            &document.model,
            &document.extents,
            &document.poses,
            &document.hidden,
            self.cut,
            ray.0,
            ray.1,
        );
        (ray, hit)
    }

    fn face(&self, hit: Pick) -> Option<Snap> {
        Some(Snap {
            part: hit.part,
            feature: Feature::Face(hit.face?),
            point: hit.point,
        })
    }

    fn shape(&self, part: usize) -> Option<&Shape> {
        let model = &self.document.model;
        model.shapes.get(model.parts.get(part)?.shape)
    }

    fn center(&self, of: Snap) -> Option<Snap> {
        let shape = self.shape(of.part)?;
        let (round, center) = match of.feature {
            Feature::Edge(edge) => match shape.edges.get(edge as usize)?.curve {
                Curve::Circle { frame, .. } => (Round::Edge(edge), frame.origin),
                _ => return None,
            },
            Feature::Face(face) => match shape.faces.get(face as usize)?.surface {
                Surface::Sphere { frame, .. } => (Round::Face(face), frame.origin),
                _ => return None,
            },
            _ => return None,
        };
        Some(Snap {
            feature: Feature::Center(round),
            point: self.document.poses.get(of.part)?.transform_point3(center),
            ..of
        })
    }

    fn axis_of(&self, of: Snap) -> Option<Snap> {
        let round = match of.feature {
            Feature::Edge(edge) => Round::Edge(edge),
            Feature::Face(face) => Round::Face(face),
            _ => return None,
        };
        let [a, b] = outline::axis(self.shape(of.part)?, round)?;
        Some(Snap {
            feature: Feature::Axis(round),
            point: self.document.poses.get(of.part)?.transform_point3(a.midpoint(b)),
            ..of
        })
    }

    /// Parts that are shown near a place, each with its shape and the matrix to clip space.
    fn near(&self, at: Pos2) -> impl Iterator<Item = (usize, &Shape, DMat4)> {
        let to_clip = self
            .camera
            .view_projection(aspect(self.rect), self.document.extent);
        let parts = 0..self.document.model.parts.len();
        parts
            .filter(move |&part| !self.document.is_hidden(part))
            .filter_map(move |part| {
                let pose = *self.document.poses.get(part)?;
                let index = self.document.model.parts[part].shape;
                let extent = self.document.extents.get(index)?;
                self.may_show(pose.transform_point3(extent.center), extent.radius, at)
                    .then_some((part, self.shape(part)?, to_clip * DMat4::from(pose)))
            })
    }

    /// Whether a ball may be seen within reach of a place.
    fn may_show(&self, center: DVec3, radius: f64, at: Pos2) -> bool {
        let height = self.camera.height_at(center);
        // Near the eye, or behind it, a ball covers more than its size at its centre's depth.
        if height < 4.0 * radius {
            return true;
        }
        let points = 1.3 * radius / height * f64::from(self.rect.height());
        let seen = on_screen(self.camera, self.rect, center);
        seen.is_none_or(|seen| f64::from(seen.distance(at) - REACH[0]) <= points)
    }

    fn vertex(&self, at: Pos2) -> Option<Snap> {
        let mut near = Vec::new();
        for (part, shape, to_clip) in self.near(at) {
            for (index, edge) in shape.edges.iter().enumerate() {
                // A closed edge has no vertex that a reader of a drawing would see.
                if edge.polyline.first() == edge.polyline.last() {
                    continue;
                }
                for last in [false, true] {
                    let edge = index as u32;
                    let Some(local) = outline::end(shape, edge, last) else {
                        continue;
                    };
                    let Some((seen, _)) = self.seen(&to_clip, local) else {
                        continue;
                    };
                    self.offer(
                        &mut near,
                        part,
                        Feature::Vertex { edge, last },
                        local,
                        seen.distance(at),
                        REACH[0],
                    );
                }
            }
        }
        self.visible(near)
    }

    fn edge(&self, at: Pos2) -> Option<Snap> {
        let mut near = Vec::new();
        for (part, shape, to_clip) in self.near(at) {
            for (index, edge) in shape.edges.iter().enumerate() {
                let sides = edge.polyline.windows(2);
                let nearest = sides
                    .filter_map(|side| self.on_line(&to_clip, [side[0], side[1]], at))
                    .min_by(|a, b| a.1.total_cmp(&b.1));
                if let Some((local, away)) = nearest {
                    self.offer(
                        &mut near,
                        part,
                        Feature::Edge(index as u32),
                        local,
                        away,
                        REACH[2],
                    );
                }
            }
        }
        self.visible(near)
    }

    fn axis(&self, at: Pos2) -> Option<Snap> {
        let mut near = Vec::new();
        for (part, shape, to_clip) in self.near(at) {
            for index in 0..shape.faces.len() as u32 {
                let round = Round::Face(index);
                let Some(ends) = outline::axis(shape, round) else {
                    continue;
                };
                if let Some((local, away)) = self.on_line(&to_clip, ends, at) {
                    self.offer(&mut near, part, Feature::Axis(round), local, away, REACH[1]);
                }
            }
        }
        self.visible(near)
    }

    /// Place on the screen, and the depth's divisor there; `None` behind the eye.
    fn seen(&self, to_clip: &DMat4, local: DVec3) -> Option<(Pos2, f64)> {
        let clip = *to_clip * local.extend(1.0);
        (clip.w > 0.0).then(|| (from_ndc(self.rect, clip.truncate().truncate() / clip.w), clip.w))
    }

    /// The point of a straight line that is nearest to a place on the screen, and how far, points.
    fn on_line(&self, to_clip: &DMat4, [a, b]: [DVec3; 2], at: Pos2) -> Option<(DVec3, f32)> {
        let ((p, near), (q, far)) = (self.seen(to_clip, a)?, self.seen(to_clip, b)?);
        let along: Vec2 = q - p;
        let share = ((at - p).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
        // Equal steps on the screen are not equal along a line that recedes.
        let t = f64::from(share);
        let along_line = t * near / (t * near + (1.0 - t) * far);
        Some((a.lerp(b, along_line), at.distance(p + share * along)))
    }

    fn offer(
        &self,
        near: &mut Vec<Near>,
        part: usize,
        feature: Feature,
        local: DVec3,
        away: f32,
        reach: f32,
    ) {
        let Some(pose) = self.document.poses.get(part).filter(|_| away <= reach) else {
            return;
        };
        let point = pose.transform_point3(local);
        if self
            .cut
            .is_none_or(|cut| cut.plane.height(point) <= 1e-9 * self.document.extent.radius)
        {
            near.push(Near {
                snap: Snap { part, feature, point },
                away,
            });
        }
    }

    /// The nearest to the pointer of those that no part lies before.
    fn visible(&self, mut near: Vec<Near>) -> Option<Snap> {
        near.sort_by(|a, b| a.away.total_cmp(&b.away));
        let is_seen = |near: &&Near| {
            let point = near.snap.point;
            let Some(place) = self.camera.project(point, aspect(self.rect)) else {
                return false;
            };
            let ((start, direction), hit) = self.along(place);
            let slack = SLACK * self.camera.height_at(point) / f64::from(self.rect.height().max(1.0));
            hit.is_none_or(|hit| hit.distance >= (point - start).dot(direction) - slack)
        };
        near.iter().take(TRIED).find(is_seen).map(|near| near.snap)
    }
}
