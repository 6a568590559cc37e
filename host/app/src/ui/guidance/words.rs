//! Targets in words: the surfaces, the alignment error, the status, and the remaining motion.

use std::f64::consts::TAU;

use glam::DVec3;
use mortise_guide::{List, MAX_SENT, Row, Standing};
use mortise_mating::recognise::{Freedom, Target, TargetId, Turn};
use mortise_protocol::message::ConstraintKind;

use crate::session::document::Document;

/// Kind and parts.
pub fn title(document: &Document, target: &Target) -> String {
    let (moving, fixed) = (
        document.owner_name(target.id.moving_part, &target.moving_faces),
        document.owner_name(target.id.fixed_part, &target.fixed_faces),
    );
    let kind = target.kind.name();
    let between = match target.kind {
        ConstraintKind::Coplanar => "on",
        _ if target.inner_moves => "in",
        _ => "over",
    };
    let mut text = format!("{kind}: {moving} {between} {fixed}");
    text[..1].make_ascii_uppercase();
    text
}

/// Surfaces with their diameters and the difference between these.
pub fn surfaces(target: &Target) -> String {
    let (inner, outer) = match target.kind {
        ConstraintKind::Concentric => ("shaft", "hole"),
        ConstraintKind::Spherical => ("ball", "socket"),
        ConstraintKind::Annular | ConstraintKind::AnnularBore => ("ball", "bore"),
        ConstraintKind::Conical => {
            return match target.inner_moves {
                true => "cone in tapered hole".to_owned(),
                false => "tapered hole over cone".to_owned(),
            };
        }
        ConstraintKind::Coplanar => return "flat face on flat face".to_owned(),
        ConstraintKind::Path => return way(target),
    };
    let what_goes_in = 2.0 * (target.radius_mm - target.play_mm.min(0.0));
    let inner = format!("{inner} Ø {what_goes_in:.3}");
    let outer = format!("{outer} Ø {:.3}", what_goes_in + 2.0 * target.play_mm);
    let difference = match 2.0 * target.play_mm {
        play if play.abs() < 5e-4 => "same size".to_owned(),
        play if play > 0.0 => format!("{play:.3} mm clearance"),
        play => format!("{:.3} mm interference", -play),
    };
    match target.inner_moves {
        true => format!("{inner} in {outer}: {difference}"),
        false => format!("{outer} over {inner}: {difference}"),
    }
}

/// Length and motion of a way in, and its clearance.
fn way(target: &Target) -> String {
    let Some(way) = &target.way else {
        return "way in".to_owned();
    };
    let motion = match way.turn {
        Turn::Free => "free to turn".to_owned(),
        Turn::Geared(rate) if rate.abs() < 1e-9 => "straight".to_owned(),
        Turn::Geared(rate) => format!("a screw, pitch {:.3} mm", TAU / rate.abs()),
    };
    format!(
        "way in of {:.1} mm, {motion}: {:.3} mm clearance",
        way.length_mm, target.play_mm
    )
}

/// Alignment error of a row, and how far the surfaces are inserted.
pub fn alignment(row: &Row) -> String {
    let (d, degrees) = (
        row.alignment_error.distance_mm,
        row.alignment_error.angle_rad.to_degrees(),
    );
    let mut text = match row.target.kind {
        ConstraintKind::Concentric => format!("axis off by {d:.3} mm, {degrees:.2}°"),
        ConstraintKind::Coplanar => format!("gap {d:.3} mm, {degrees:.2}°"),
        ConstraintKind::Conical => format!("off by {d:.3} mm, {degrees:.2}°"),
        ConstraintKind::Spherical => format!("centres {d:.3} mm apart"),
        ConstraintKind::Annular | ConstraintKind::AnnularBore => format!("centre {d:.3} mm off the axis"),
        ConstraintKind::Path => format!("off the way by {d:.3} mm, {degrees:.2}°"),
    };
    match row.inside_mm {
        Some(inside) if inside > 0.0 => text += &format!(", {inside:.1} mm inserted"),
        Some(inside) => text += &format!(", {:.1} mm before entry", -inside),
        None => {}
    }
    text
}

/// Status of a row.
pub fn standing(document: &Document, list: &List, row: &Row, guides: bool) -> String {
    let mut text = match &row.standing {
        Standing::Candidate => "Candidate: out of range".to_owned(),
        Standing::Conflict(with) => {
            let names: Vec<String> = with.iter().map(|id| named(document, list, *id)).collect();
            format!("Contradicts {}", names.join(" and "))
        }
        Standing::Off => "Switched off".to_owned(),
        Standing::ByContact => "Fits: held by contact".to_owned(),
        Standing::Waiting if guides => format!("Queued: {MAX_SENT} already guide"),
        Standing::Waiting => "Fits: guidance is off".to_owned(),
        Standing::Sent => "Guides".to_owned(),
        Standing::Refused(why) => format!("Fits, but the board refused: {why}"),
    };
    if row.pinned {
        text += ", pinned";
    }
    text
}

/// Face numbers of both parts.
pub fn faces(document: &Document, target: &Target) -> String {
    let numbers = |part: usize, faces: &[u32]| {
        let (_, faces) = document.owner(part, faces);
        let shown: Vec<String> = faces.iter().take(6).map(u32::to_string).collect();
        let more = faces.len().saturating_sub(shown.len());
        let word = if faces.len() == 1 { "face" } else { "faces" };
        let tail = if more > 0 {
            format!(" and {more} more")
        } else {
            String::new()
        };
        format!("{word} {}{tail}", shown.join(", "))
    };
    format!(
        "{}: {}\n{}: {}",
        document.owner_name(target.id.moving_part, &target.moving_faces),
        numbers(target.id.moving_part, &target.moving_faces),
        document.owner_name(target.id.fixed_part, &target.fixed_faces),
        numbers(target.id.fixed_part, &target.fixed_faces),
    )
}

/// Remaining motion.
pub fn freedom(freedom: &Freedom) -> String {
    let slide = freedom.slides.first().copied();
    let turn = freedom.turns.first().map(|axis| axis.direction);
    match (freedom.slides.len(), freedom.turns.len()) {
        (3, 3) => "unconstrained".to_owned(),
        (0, 0) => "none".to_owned(),
        (1, 1) if slide.zip(turn).is_some_and(|(s, t)| s.cross(t).length() < 1e-6) => {
            format!("slides and turns about one axis{}", along(slide))
        }
        (2, 1) => format!("slides and turns on a plane{}", across(turn)),
        (0, 1) => format!("turns about one axis{}", along(turn)),
        (1, 0) => format!("slides along one axis{}", along(slide)),
        (0, 3) => "turns every way about a point".to_owned(),
        (1, 3) => format!("slides along one axis{}, turns every way", along(slide)),
        (slides, turns) => {
            let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
            format!("{} and {}", count(slides, "slide"), count(turns, "turn"))
        }
    }
}

/// Short name of a contradicting target, unique in the list.
fn named(document: &Document, list: &List, id: TargetId) -> String {
    let target = list.rows.iter().map(|row| &row.target).find(|t| t.id == id);
    match target {
        Some(target) if target.radius_mm > 0.0 => {
            let (what, size) = (title(document, target), 2.0 * target.radius_mm);
            format!("“{what}”, Ø {size:.3}")
        }
        Some(target) => format!("“{}”", title(document, target)),
        None => "another target".to_owned(),
    }
}

/// Name of the assembly's axis along a direction, if it is along one.
fn along(direction: Option<DVec3>) -> String {
    letter(direction).map_or_else(String::new, |name| format!(" ({name})"))
}

fn across(normal: Option<DVec3>) -> String {
    letter(normal).map_or_else(String::new, |name| format!(" (across {name})"))
}

fn letter(direction: Option<DVec3>) -> Option<&'static str> {
    let direction = direction?.try_normalize()?;
    let axes = [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")];
    (axes.into_iter())
        .find(|(axis, _)| axis.cross(direction).length() < 1e-3)
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use mortise_brep::{CadModel, Part};
    use mortise_mating::Axis;
    use mortise_mating::recognise::AlignmentError;

    use super::*;

    fn axis(direction: DVec3) -> Axis {
        Axis {
            origin: DVec3::ZERO,
            direction,
        }
    }

    fn row(kind: ConstraintKind, radius_mm: f64, play_mm: f64, inner_moves: bool) -> Row {
        Row {
            target: Target {
                id: TargetId {
                    moving_part: 1,
                    fixed_part: 0,
                    surfaces: Some([0, 0]),
                },
                kind,
                moving: axis(DVec3::Z),
                fixed: axis(DVec3::Z),
                play_mm,
                radius_mm,
                inner_moves,
                moving_faces: vec![3],
                fixed_faces: (0..9).collect(),
                way: None,
            },
            standing: Standing::Sent,
            alignment_error: AlignmentError {
                distance_mm: 0.25,
                angle_rad: 0.5f64.to_radians(),
            },
            depth_mm: 0.0,
            inside_mm: Some(-0.4),
            pinned: false,
        }
    }

    fn document() -> Document {
        let part = |name: &str| Part {
            name: name.into(),
            path: vec![],
            shape: 0,
            placement: glam::DAffine3::IDENTITY,
            color: None,
        };
        let model = CadModel {
            shapes: vec![Default::default()],
            parts: vec![part("block"), part("peg")],
            ..CadModel::default()
        };
        Document::of(model, None, "test".into(), 1)
    }

    #[test]
    fn sizes_are_those_of_both_surfaces_whichever_moves() {
        let peg = row(ConstraintKind::Concentric, 8.875, 0.5, true).target;
        assert_eq!(
            surfaces(&peg),
            "shaft Ø 17.750 in hole Ø 18.750: 1.000 mm clearance"
        );
        let ring = row(ConstraintKind::Concentric, 8.875, 0.5, false).target;
        assert_eq!(
            surfaces(&ring),
            "hole Ø 18.750 over shaft Ø 17.750: 1.000 mm clearance"
        );
        // With interference `radius_mm` is the hole's, which is smaller than the shaft's.
        let press = row(ConstraintKind::Concentric, 9.0, -0.01, true).target;
        assert_eq!(
            surfaces(&press),
            "shaft Ø 18.020 in hole Ø 18.000: 0.020 mm interference"
        );
        assert_eq!(title(&document(), &peg), "Concentric: peg in block");
        assert_eq!(title(&document(), &ring), "Concentric: peg over block");
    }

    #[test]
    fn a_row_says_how_far_off_and_which_faces() {
        let row = row(ConstraintKind::Concentric, 8.875, 0.5, true);
        assert_eq!(
            alignment(&row),
            "axis off by 0.250 mm, 0.50°, 0.4 mm before entry"
        );
        assert_eq!(
            faces(&document(), &row.target),
            "peg: face 3\nblock: faces 0, 1, 2, 3, 4, 5 and 3 more"
        );
    }

    #[test]
    fn a_conflict_names_what_came_first() {
        let (document, first) = (document(), row(ConstraintKind::Concentric, 6.0, 0.1, true));
        let mut other = row(ConstraintKind::Concentric, 4.0, 0.1, true);
        other.standing = Standing::Conflict(vec![first.target.id]);
        other.pinned = true;
        let mut list = List {
            rows: vec![first],
            ..List::default()
        };
        assert_eq!(
            standing(&document, &list, &other, true),
            "Contradicts “Concentric: peg in block”, Ø 12.000, pinned"
        );
        list.rows.clear();
        let text = standing(&document, &list, &other, true);
        assert_eq!(text, "Contradicts another target, pinned");
    }

    #[test]
    fn what_is_left_reads_as_motion() {
        let words = |slides: &[DVec3], turns: &[DVec3]| {
            freedom(&Freedom {
                slides: slides.to_vec(),
                turns: turns.iter().map(|&t| axis(t)).collect(),
            })
        };
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        assert_eq!(words(&[z], &[-z]), "slides and turns about one axis (z)");
        assert_eq!(words(&[x], &[z]), "1 slide and 1 turn");
        assert_eq!(words(&[x, y], &[z]), "slides and turns on a plane (across z)");
        let lean = DVec3::new(1.0, 1.0, 0.0);
        assert_eq!(words(&[], &[lean]), "turns about one axis");
        assert_eq!(words(&[], &[x, y, z]), "turns every way about a point");
        assert_eq!(words(&[], &[]), "none");
        assert_eq!(words(&[x, y, z], &[x, y, z]), "unconstrained");
    }
}
