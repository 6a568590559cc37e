//! Conversion of a target in millimetres of the model to the board's message.

use glam::DVec3;
use heapless::Vec as BoundedVec;
use mortise_mating::recognise::{Target, Turn};
use mortise_protocol::message::{ConstraintKind, ConstraintTarget, Feature, Path, PathTurn};

use crate::GuideSettings;

/// Whether targets of a kind are sent to the board; planes are left to contact, which holds them face to face without guidance.
pub fn is_sent(kind: ConstraintKind) -> bool {
    kind != ConstraintKind::Coplanar
}

/// The message for a target; `None` for kinds left to contact. `parts` maps each part of the image to a part of the model.
pub fn message(
    target: &Target,
    parts: &[usize],
    settings: &GuideSettings,
    id: u16,
    sequence: u16,
) -> Option<ConstraintTarget> {
    if !is_sent(target.kind) {
        return None;
    }
    let image_part = parts.iter().position(|&p| p == target.id.fixed_part)?;
    let feature = |origin: DVec3, direction: DVec3| Feature {
        point: (origin / 1000.0).as_vec3().to_array(),
        direction: direction.normalize().as_vec3().to_array(),
    };
    let mut faces = BoundedVec::new();
    let mut add = |moving: u32, fixed: u32| {
        if let (Ok(moving), Ok(fixed)) = (u16::try_from(moving), u16::try_from(fixed)) {
            // The first few faces are the largest of the surface; contact with the others stays enabled.
            let _ = faces.push((moving, fixed));
        }
    };
    match &target.way {
        Some(way) => way.sliding.iter().for_each(|&[moving, fixed]| add(moving, fixed)),
        None => {
            for &moving in &target.moving_faces {
                target.fixed_faces.iter().for_each(|&fixed| add(moving, fixed));
            }
        }
    }
    Some(ConstraintTarget {
        id,
        sequence,
        kind: target.kind,
        moving: feature(target.moving.origin, target.moving.direction),
        static_part: u16::try_from(image_part).ok()?,
        fixed: feature(target.fixed.origin, target.fixed.direction),
        stiffness: settings.stiffness_n_per_m,
        force_cap: settings.force_cap_n,
        torque_cap: settings.torque_cap_nm,
        expiry_ticks: settings.expiry_ticks,
        path: target.way.as_ref().map(|way| Path {
            orientation: way.orientation.as_quat().normalize().to_array(),
            turn: match way.turn {
                Turn::Free => PathTurn::Free,
                Turn::Geared(rad_per_mm) => PathTurn::Geared((1e3 * rad_per_mm) as f32),
            },
            ends: way.ends,
        }),
        faces,
    })
}
