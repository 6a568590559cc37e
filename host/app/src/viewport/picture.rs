//! What is to be seen, as plain values: which parts, where, in which colours. Pure; the renderer draws it as it is.

use glam::{DAffine3, DVec3};

use super::camera::{Camera, Extent};

/// Faces of one part that can be lit up at once; more than the wire carries pairs of one part worth telling apart.
pub const MAX_LIT: usize = 8;
/// Edges of one part that can be lit up at once.
pub const MAX_LIT_EDGES: usize = 8;

/// A part, or a ghost of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Index of the shape.
    pub shape: usize,
    /// Shape to world, mm.
    pub pose: DAffine3,
    /// sRGB, 0..1.
    pub color: [f32; 3],
    /// 1: solid; below: seen through.
    pub opacity: f32,
    /// Mixed into the colour: sRGB and how much.
    pub tint: [f32; 4],
    /// Of the edges: sRGB and opacity; 0: none drawn.
    pub line: [f32; 4],
    /// Faces that touch, at most [`MAX_LIT`].
    pub lit: Vec<u32>,
    /// Edges that touch, by the two faces that meet there, smaller id first; at most [`MAX_LIT_EDGES`].
    pub lit_edges: Vec<[u32; 2]>,
    /// Faces that are guided onto another part's, at most [`MAX_LIT`].
    pub mates: Vec<u32>,
}

/// A force, drawn as an arrow over everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Where its tip ends or its tail starts, world, mm.
    pub tail: DVec3,
    /// From tail to tip, mm.
    pub vector: DVec3,
    /// Thickness of the shaft, mm.
    pub thickness: f64,
    /// sRGB and opacity.
    pub color: [f32; 4],
}

/// What is behind the parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ground {
    /// Of the dark theme.
    #[default]
    Dark,
    /// Of the light theme.
    Light,
}

impl Ground {
    /// At the top and at the bottom, sRGB.
    pub fn sky(self) -> [[f32; 4]; 2] {
        match self {
            Self::Dark => [[0.135, 0.150, 0.180, 1.0], [0.075, 0.082, 0.098, 1.0]],
            Self::Light => [[0.955, 0.965, 0.980, 1.0], [0.845, 0.865, 0.895, 1.0]],
        }
    }
}

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// From where.
    pub camera: Camera,
    /// About all of it: sets the depth range.
    pub extent: Extent,
    /// Behind them.
    pub ground: Ground,
    /// Parts and ghosts.
    pub items: Vec<Item>,
    /// Forces.
    pub arrows: Vec<Arrow>,
    /// Width of edges, pixels.
    pub line_width: f32,
}

/// Where an arrow's shaft and head stand: poses of the unit cylinder and the unit cone (diameter 1, along +z from 0 to 1).
/// `None` when it is too short to see.
pub fn arrow_poses(arrow: &Arrow) -> Option<[DAffine3; 2]> {
    let length = arrow.vector.length();
    if !(length > 1e-9 && length.is_finite()) {
        return None;
    }
    let z = arrow.vector / length;
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    let head = (4.0 * arrow.thickness).min(0.5 * length);
    let piece = |from: f64, long: f64, wide: f64| {
        let mut pose = DAffine3::from_translation(arrow.tail + from * z);
        pose.matrix3.x_axis = wide * x;
        pose.matrix3.y_axis = wide * y;
        pose.matrix3.z_axis = long * z;
        pose
    };
    Some([
        piece(0.0, length - head, arrow.thickness),
        piece(length - head, head, 3.0 * arrow.thickness),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_reaches_from_tail_to_tip() {
        let arrow = Arrow {
            tail: DVec3::new(1.0, 2.0, 3.0),
            vector: DVec3::new(0.0, -4.0, 3.0),
            thickness: 0.5,
            color: [1.0; 4],
        };
        let [shaft, head] = arrow_poses(&arrow).expect("long enough");
        assert!((shaft.transform_point3(DVec3::ZERO) - arrow.tail).length() < 1e-12);
        assert!((shaft.transform_point3(DVec3::Z) - head.transform_point3(DVec3::ZERO)).length() < 1e-12);
        assert!((head.transform_point3(DVec3::Z) - DVec3::new(1.0, -2.0, 6.0)).length() < 1e-12);
        assert!((shaft.transform_vector3(DVec3::X).length() - 0.5).abs() < 1e-12);
        assert!(
            head.matrix3.determinant() > 0.0 && shaft.matrix3.determinant() > 0.0,
            "not mirrored"
        );
    }

    #[test]
    fn no_arrow_without_a_force() {
        let mut arrow = Arrow {
            tail: DVec3::ZERO,
            vector: DVec3::ZERO,
            thickness: 1.0,
            color: [1.0; 4],
        };
        assert_eq!(arrow_poses(&arrow), None);
        arrow.vector = DVec3::NAN;
        assert_eq!(arrow_poses(&arrow), None);
    }
}
