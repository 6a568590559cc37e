//! The view in projects.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::camera::{Camera, Projection};
use super::gesture::Viewpoint;
use crate::cut::{Across, Setting};
use crate::kept::view::{KeptAcross, KeptSection, KeptView};
use crate::session::document::Document;

impl Viewpoint {
    /// The view as a project keeps it; `None` while it does not show `document`.
    pub fn kept(&self, document: &Document) -> Option<KeptView> {
        let camera = self.goal.unwrap_or(self.camera);
        let section = self.section.on.then(|| kept_section(&self.section.setting));
        let view = KeptView {
            target_mm: camera.target.to_array(),
            distance_mm: camera.distance,
            yaw_rad: camera.yaw,
            pitch_rad: camera.pitch,
            orthographic: camera.projection == Projection::Orthographic,
            see_through: self.see_through,
            section,
        };
        (self.seen == Some(document.generation)).then(|| view.rounded())
    }

    /// Looks at `document` as a project says.
    pub fn restore(&mut self, view: &KeptView, document: &Document) {
        self.camera = Camera {
            target: DVec3::from(view.target_mm),
            distance: view.distance_mm,
            yaw: view.yaw_rad,
            pitch: view.pitch_rad.clamp(-FRAC_PI_2, FRAC_PI_2),
            projection: match view.orthographic {
                true => Projection::Orthographic,
                false => Projection::Perspective,
            },
        };
        self.goal = None;
        self.picked = None;
        self.seen = Some(document.generation);
        self.see_through = view.see_through;
        self.section.restore(document, view.section.as_ref().map(setting));
    }
}

fn kept_section(setting: &Setting) -> KeptSection {
    KeptSection {
        across: match setting.across {
            Across::X => KeptAcross::X,
            Across::Y => KeptAcross::Y,
            Across::Z => KeptAcross::Z,
            Across::Face { point, normal } => KeptAcross::Face {
                point_mm: point.to_array(),
                normal: normal.to_array(),
            },
        },
        offset_mm: setting.offset_mm,
        flipped: setting.flipped,
    }
}

fn setting(section: &KeptSection) -> Setting {
    Setting {
        across: match section.across {
            KeptAcross::X => Across::X,
            KeptAcross::Y => Across::Y,
            KeptAcross::Z => Across::Z,
            KeptAcross::Face { point_mm, normal } => Across::Face {
                point: DVec3::from(point_mm),
                normal: DVec3::from(normal),
            },
        },
        offset_mm: section.offset_mm,
        flipped: section.flipped,
    }
}
