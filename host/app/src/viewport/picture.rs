//! Contents of a picture as plain values: parts, poses, colours. Pure; the renderer draws it unchanged.

use std::sync::Arc;

use glam::{DAffine3, DVec3};
use mortise_inspect::CutPlane;

use super::camera::Camera;
use crate::cut::Cut;
use crate::display::extent::Extent;
use crate::display::mesh::ShapeMesh;

/// Largest number of highlighted faces of one part; the wire carries fewer pairs of one part that are worth distinguishing.
pub const MAX_LIT: usize = 8;
/// Largest number of highlighted edges of one part.
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
    /// 1: opaque; below: transparent.
    pub opacity: f32,
    /// Colour mixed in: sRGB and its weight.
    pub tint: [f32; 4],
    /// sRGB and opacity of the edges; 0: none drawn.
    pub line: [f32; 4],
    /// Faces that touch, at most [`MAX_LIT`].
    pub lit: Vec<u32>,
    /// Edges that touch, each by the two faces that meet there, smaller id first; at most [`MAX_LIT_EDGES`].
    pub lit_edges: Vec<[u32; 2]>,
    /// Faces that are guided onto another part's, at most [`MAX_LIT`].
    pub mates: Vec<u32>,
}

/// A force, drawn as an arrow over everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Start point, world, mm.
    pub tail: DVec3,
    /// Vector from tail to tip, mm.
    pub vector: DVec3,
    /// Thickness of the shaft, mm.
    pub thickness: f64,
    /// sRGB and opacity.
    pub color: [f32; 4],
}

/// The areas of a cut, shared with the renderer: equal where they are the same ones.
#[derive(Clone, Debug)]
pub struct Areas(pub Arc<Cut>);

impl PartialEq for Areas {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// How an area is filled.
#[derive(Clone, Debug, PartialEq)]
pub struct Fill {
    /// Index of the area.
    pub area: usize,
    /// sRGB, 0..1.
    pub color: [f32; 3],
    /// Colour mixed in: sRGB and its weight.
    pub tint: [f32; 4],
    /// sRGB and opacity of the border.
    pub line: [f32; 4],
    /// Direction across the hatching in the plane, rad.
    pub hatch: f32,
}

/// What is cut away, and the areas that show where.
#[derive(Clone, Debug, PartialEq)]
pub struct Cutaway {
    /// What lies above this plane is not drawn.
    pub plane: CutPlane,
    /// The areas, once computed.
    pub areas: Option<Areas>,
    /// Which of them are drawn.
    pub fills: Vec<Fill>,
}

/// A mesh shared with the renderer: equal where it is the same one.
#[derive(Clone, Debug)]
pub struct Shells(pub Arc<ShapeMesh>);

impl PartialEq for Shells {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// A soft light in space, which hides nothing: brighter where more shells lie over each other, and fainter behind parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Glow {
    /// Closed shells.
    pub shells: Shells,
    /// Shells to world, mm.
    pub pose: DAffine3,
    /// sRGB, and opacity of a wall of a shell that is seen head-on.
    pub color: [f32; 4],
}

/// Background of the parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ground {
    /// Background of the dark theme.
    #[default]
    Dark,
    /// Background of the light theme.
    Light,
}

impl Ground {
    /// sRGB at the top and at the bottom.
    pub fn sky(self) -> [[f32; 4]; 2] {
        match self {
            Self::Dark => [[0.135, 0.150, 0.180, 1.0], [0.075, 0.082, 0.098, 1.0]],
            Self::Light => [[0.955, 0.965, 0.980, 1.0], [0.845, 0.865, 0.895, 1.0]],
        }
    }

    /// sRGB of a glow: unlike that of fits, of the held part and of what is marked.
    pub fn glow(self) -> [f32; 3] {
        match self {
            Self::Dark => [0.76, 0.58, 1.0],
            Self::Light => [0.46, 0.20, 0.86],
        }
    }
}

/// Description of one picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Camera.
    pub camera: Camera,
    /// Bounding sphere of the contents: determines the depth range.
    pub extent: Extent,
    /// Background.
    pub ground: Ground,
    /// Parts and ghosts.
    pub items: Vec<Item>,
    /// The section, where there is one.
    pub cut: Option<Cutaway>,
    /// From where a part is drawn to its fit.
    pub glow: Option<Glow>,
    /// Forces.
    pub arrows: Vec<Arrow>,
    /// Width of edges, pixels.
    pub line_width: f32,
}

/// Poses of an arrow's shaft and head: the unit cylinder and the unit cone (diameter 1, along +z from 0 to 1). `None` when it is too short
/// to be visible.
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
