//! How a model was seen: camera and section, as projects keep them.

use serde::{Deserialize, Serialize};

/// Camera and section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptView {
    /// Point at the picture's centre, mm.
    pub target_mm: [f64; 3],
    /// Distance of the eye from it, mm.
    pub distance_mm: f64,
    /// Angle of the camera about z, rad.
    pub yaw_rad: f64,
    /// Angle of the camera above the xy plane, rad.
    pub pitch_rad: f64,
    /// Whether the projection is orthographic.
    #[serde(default)]
    pub orthographic: bool,
    /// Whether fixed parts are drawn as glass.
    #[serde(default)]
    pub see_through: bool,
    /// The section, if it is on.
    #[serde(default)]
    pub section: Option<KeptSection>,
}

/// The plane of a section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptSection {
    /// Direction.
    pub across: KeptAcross,
    /// Coordinate along the axis, or distance from the face along its outward normal, mm.
    pub offset_mm: f64,
    /// Whether the side of lower offsets is cut away.
    #[serde(default)]
    pub flipped: bool,
}

/// Direction of a section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KeptAcross {
    /// Across the x axis.
    X,
    /// Across the y axis.
    Y,
    /// Across the z axis.
    Z,
    /// Along a flat face.
    Face {
        /// A point of the face, mm.
        point_mm: [f64; 3],
        /// Its outward unit normal.
        normal: [f64; 3],
    },
}

impl KeptView {
    /// Whether a camera can be there.
    pub fn is_sound(&self) -> bool {
        let angles = [self.yaw_rad, self.pitch_rad];
        let camera = self.target_mm.iter().all(|x| x.abs() < 1e9)
            && (1e-9..1e9).contains(&self.distance_mm)
            && angles.iter().all(|x| x.abs() < 1e3);
        camera && self.section.is_none_or(|section| section.is_sound())
    }

    /// With numbers that a file of text keeps exactly.
    pub fn rounded(&self) -> Self {
        let mm = |x| rounded(x, 1e6);
        Self {
            target_mm: self.target_mm.map(mm),
            distance_mm: rounded(self.distance_mm, 1e9),
            yaw_rad: rounded(self.yaw_rad, 1e9),
            pitch_rad: rounded(self.pitch_rad, 1e9),
            orthographic: self.orthographic,
            see_through: self.see_through,
            section: self.section.map(|section| KeptSection {
                across: match section.across {
                    KeptAcross::Face { point_mm, normal } => KeptAcross::Face {
                        point_mm: point_mm.map(|x| rounded(x, 1e9)),
                        normal: normal.map(|x| rounded(x, 1e15)),
                    },
                    axis => axis,
                },
                offset_mm: rounded(section.offset_mm, 1e9),
                flipped: section.flipped,
            }),
        }
    }
}

impl KeptSection {
    fn is_sound(&self) -> bool {
        let face = match self.across {
            KeptAcross::Face { point_mm, normal } => {
                let length: f64 = normal.iter().map(|x| x * x).sum();
                point_mm.iter().all(|x| x.abs() < 1e9) && (length - 1.0).abs() < 1e-6
            }
            _ => true,
        };
        face && self.offset_mm.abs() < 1e9
    }
}

/// A number rounded to a whole number of parts of one: text with so few digits is read back to the same bits.
pub(super) fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}
