//! Where the plane of a section lies. Pure.

use std::ops::RangeInclusive;

use glam::DVec3;
use mortise_brep::Surface;
use mortise_inspect::CutPlane;

use crate::display::extent::Extent;
use crate::session::document::Document;

/// Direction of a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Across {
    /// Across the x axis.
    X,
    /// Across the y axis.
    #[default]
    Y,
    /// Across the z axis.
    Z,
    /// Along a flat face.
    Face {
        /// A point of the face, mm.
        point: DVec3,
        /// Its outward unit normal.
        normal: DVec3,
    },
}

impl Across {
    /// Along a flat face of a part at its present pose; `None` for other faces.
    pub fn along(document: &Document, part: usize, face: u32) -> Option<Self> {
        let pose = document.poses.get(part)?;
        let shape = document.model.shapes.get(document.model.parts.get(part)?.shape)?;
        let face = shape.faces.get(face as usize)?;
        let Surface::Plane { frame } = face.surface else {
            return None;
        };
        let outward = if face.reversed { -frame.z } else { frame.z };
        Some(Self::Face {
            point: pose.transform_point3(frame.origin),
            normal: pose.transform_vector3(outward).try_normalize()?,
        })
    }

    fn normal(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
            Self::Face { normal, .. } => normal,
        }
    }

    /// Point at the offset 0.
    fn start(self) -> DVec3 {
        match self {
            Self::Face { point, .. } => point,
            _ => DVec3::ZERO,
        }
    }
}

/// Where a plane lies, and which side of it is cut away.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setting {
    /// Direction.
    pub across: Across,
    /// Coordinate along the axis, or distance from the face along its outward normal, mm.
    pub offset_mm: f64,
    /// Whether the side of lower offsets is cut away instead of the other.
    pub flipped: bool,
}

impl Setting {
    /// Across an axis through the middle of `extent`, with the side towards `viewer` cut away; along a face in it, with what lies outside cut away.
    pub fn of(across: Across, extent: Extent, viewer: DVec3) -> Self {
        match across {
            Across::Face { .. } => Self {
                across,
                offset_mm: 0.0,
                flipped: false,
            },
            _ => Self {
                across,
                offset_mm: extent.center.dot(across.normal()),
                flipped: viewer.dot(across.normal()) < 0.0,
            },
        }
    }

    /// Moves the plane along its normal until it contains `place`.
    pub fn pass_through(&mut self, place: DVec3) {
        self.offset_mm = (place - self.across.start()).dot(self.across.normal());
    }

    /// Offsets at which the plane meets `extent`, mm.
    pub fn range(&self, extent: Extent) -> RangeInclusive<f64> {
        let middle = (extent.center - self.across.start()).dot(self.across.normal());
        middle - extent.radius..=middle + extent.radius
    }

    /// The plane, its normal towards what is cut away. Its origin is near the middle of `extent`, so that coordinates in it are short.
    pub fn plane(&self, extent: Extent) -> Option<CutPlane> {
        let (start, normal) = (self.across.start(), self.across.normal());
        let height = (extent.center - start).dot(normal) - self.offset_mm;
        let sign = if self.flipped { -1.0 } else { 1.0 };
        CutPlane::new(extent.center - height * normal, sign * normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXTENT: Extent = Extent {
        center: DVec3::new(10.0, -20.0, 30.0),
        radius: 5.0,
    };

    #[test]
    fn the_plane_lies_at_the_offset_with_the_viewer_s_side_above() {
        for across in [Across::X, Across::Y, Across::Z] {
            for viewer in [DVec3::ONE, -DVec3::ONE] {
                let mut setting = Setting::of(across, EXTENT, viewer);
                let plane = setting.plane(EXTENT).expect("a plane");
                assert!(plane.height(EXTENT.center).abs() < 1e-12);
                assert!(plane.normal.dot(viewer) > 0.0);
                setting.offset_mm += 2.0;
                let moved = setting.plane(EXTENT).expect("a plane");
                assert!((moved.height(EXTENT.center).abs() - 2.0).abs() < 1e-12);
                assert!(
                    (moved.origin - EXTENT.center).length() < 2.0 + 1e-12,
                    "near the middle"
                );
            }
        }
    }

    #[test]
    fn a_face_s_offset_counts_from_the_face_outward() {
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let point = DVec3::new(1.0, 2.0, 3.0);
        let mut setting = Setting::of(Across::Face { point, normal }, EXTENT, DVec3::X);
        let plane = setting.plane(EXTENT).expect("a plane");
        assert!(plane.height(point).abs() < 1e-12 && plane.height(point + normal) > 0.0);
        setting.offset_mm = -1.5;
        setting.flipped = true;
        let plane = setting.plane(EXTENT).expect("a plane");
        assert!((plane.height(point - 2.0 * normal) - 0.5).abs() < 1e-12);
        // The whole extent is in reach.
        let range = setting.range(EXTENT);
        let middle = (EXTENT.center - point).dot(normal);
        assert!(
            (range.start() - (middle - 5.0)).abs() < 1e-12 && (range.end() - (middle + 5.0)).abs() < 1e-12
        );
    }
}
