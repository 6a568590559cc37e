//! The smallest gap or largest depth of two parts: branch and bound over the same trees and fields the search for contacts walks.
//!
//! A sphere whose lower bound exceeds the smallest gap found so far holds nothing nearer. To have a good first one, the walk goes down
//! once by the nearer child.

use glam::Vec3;
use mortise_protocol::image::{EDGE_ERROR_CELLS, Lookup, NO_FACE, Nearby, PointRecord, Shape};

use crate::analytic::{agreeing, exact, unsigned_distance};
use crate::io::Work;
use crate::probe::Nearest;
use crate::proximity::Job;

/// The diagonal of a cell, cells: interpolation this far below the band's end uses no clamped sample.
const DIAGONAL_CELLS: f32 = 1.733;

/// A search under way.
pub(crate) struct NearestSearch<'s, 'i> {
    /// The job.
    pub job: &'s Job<'i>,
    /// The shape whose field it looks up.
    pub shape: &'s Shape<'i>,
    /// The smallest so far.
    pub best: Nearest,
    /// What was looked at.
    pub work: Work,
    /// Interpolated distances are good up to here, m.
    resolved: f32,
    /// What interpolation may overstate, m.
    edge_error: f32,
}

impl<'s, 'i> NearestSearch<'s, 'i> {
    /// Walks the whole job.
    pub fn run(job: &'s Job<'i>, shape: &'s Shape<'i>, best: Nearest, work: Work) -> (Nearest, Work) {
        let record = shape.field.record();
        let mut search = Self {
            job,
            shape,
            best,
            work,
            resolved: record.band - DIAGONAL_CELLS * record.cell,
            edge_error: EDGE_ERROR_CELLS * record.cell,
        };
        search.first();
        search.all();
        (search.best, search.work)
    }

    /// Down by the nearer child, to one leaf. Every step goes forward, so it ends.
    fn first(&mut self) {
        let nodes = self.job.nodes;
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            let end = node.skip as usize;
            if end == index + 1 {
                self.leaf(index);
                return;
            }
            let mut child = index + 1;
            let mut nearest = (f32::INFINITY, child);
            while child < end
                && let Some(node) = nodes.get(child)
            {
                let bound = self.bound(child);
                if bound < nearest.0 {
                    nearest = (bound, child);
                }
                child = node.skip as usize;
            }
            index = nearest.1;
        }
    }

    fn all(&mut self) {
        let nodes = self.job.nodes;
        let mut index = 0;
        while let Some(node) = nodes.get(index) {
            if self.bound(index) > self.best.distance_m {
                index = node.skip as usize;
                continue;
            }
            if node.skip as usize == index + 1 {
                self.leaf(index);
            }
            index += 1;
        }
    }

    /// Lower bound of the signed distance of any point below a node, m.
    fn bound(&mut self, index: usize) -> f32 {
        self.work.nodes += 1;
        let Some(node) = self.job.nodes.get(index) else {
            return f32::INFINITY;
        };
        let center = self.job.to_field.apply(node.center);
        let distance = self.job.field.bound(center.to_array());
        // Inside, a clamped distance and a bound beyond the band say how deep at least, not at most.
        if distance < -self.resolved {
            return f32::NEG_INFINITY;
        }
        distance - (node.radius + self.edge_error)
    }

    fn leaf(&mut self, index: usize) {
        let Some(node) = self.job.nodes.get(index) else {
            return;
        };
        let first = node.first_point as usize;
        let points = self.job.points.get(first..first + node.point_count as usize);
        for point in points.unwrap_or(&[]) {
            self.point(point);
        }
    }

    fn point(&mut self, point: &PointRecord) {
        self.work.points += 1;
        let p = self.job.to_field.apply(point.position);
        let mut found = self.job.field.lookup(p.to_array());
        let mut edge_error = self.edge_error;
        // Where an edge itself is nearest, the surfaces give a bound only.
        let mut edge_nearest = false;
        if let Lookup::Near(s) = &mut found {
            let mut rendered = s.distance;
            if let Some((distance, face)) = exact(self.shape.faces, s, p) {
                rendered = distance;
                edge_nearest = match s.nearby {
                    Nearby::Convex(_) => distance > 0.0,
                    Nearby::Reentrant(_) => distance < 0.0,
                    _ => false,
                };
                if !edge_nearest {
                    (s.distance, s.face) = (distance, face);
                    edge_error = 0.0;
                }
            }
            // As the tick has it.
            if rendered < self.best.field_distance_m {
                self.best.field_distance_m = rendered;
            }
        }
        // (field's distance, no more than the distance, inside, nearest face if known)
        let (field, least, inside, face) = match found {
            Lookup::Near(s) if s.distance >= -self.resolved => {
                (s.distance, s.distance - edge_error, s.distance < 0.0, s.face)
            }
            Lookup::Near(s) => (s.distance, f32::NEG_INFINITY, true, s.face),
            Lookup::Far { inside: false, bound } => (bound, bound, false, NO_FACE),
            Lookup::Far { inside: true, bound } => (-bound, f32::NEG_INFINITY, true, NO_FACE),
        };
        if least > self.best.distance_m {
            return;
        }
        let in_band = face != NO_FACE && field.abs() <= self.resolved;
        let edge = point.edge_face != NO_FACE;
        let refined = self.refined(p, edge, edge_nearest, field, inside, face, in_band);
        let distance_m = refined.unwrap_or(field);
        if distance_m < self.best.distance_m {
            let (moving_face, fixed_face) = if self.job.backward {
                (face, point.face)
            } else {
                (point.face, face)
            };
            self.best = Nearest {
                distance_m,
                field_distance_m: self.best.field_distance_m,
                exact: refined.is_some(),
                in_band,
                arm: self.job.to_arm.apply(point.position),
                moving_face,
                fixed_face,
            };
        }
    }

    /// Distance by the analytic faces, if it can be had and does not contradict the field.
    #[expect(clippy::too_many_arguments, reason = "what one look-up found")]
    fn refined(
        &self,
        p: Vec3,
        edge: bool,
        edge_nearest: bool,
        field: f32,
        inside: bool,
        face: u16,
        in_band: bool,
    ) -> Option<f32> {
        if in_band
            && !edge_nearest
            && let Some(exact) = agreeing(self.shape, face, p, field)
        {
            return Some(exact);
        }
        // Outside, what is no nearer than the nearest so far need not be known.
        let outside = if in_band { field >= 0.0 } else { !inside };
        let enough = if outside {
            self.best.distance_m
        } else {
            f32::INFINITY
        };
        let distance = unsigned_distance(self.shape, p, edge, enough)?;
        if outside && distance >= enough {
            return Some(distance);
        }
        if in_band {
            // Next to an edge the sign is the field's only where that is sure of it.
            let signed = if field < 0.0 { -distance } else { distance };
            ((signed - field).abs() <= self.edge_error).then_some(signed)
        } else if inside {
            (distance >= -field - self.edge_error).then_some(-distance)
        } else {
            (distance >= field - self.edge_error).then_some(distance)
        }
    }
}
