//! A method judged on a scene: its times and its errors against truth.

use std::fmt;

use serde::Serialize;

use super::method::{Answer, Asked, Method};
use crate::scene_p::{Case, median};

/// Distance from contact within which either sign is right, mm.
pub const SIGN_MM: f64 = 0.010;

/// One line of the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Entry {
    /// Scene.
    pub scene: String,
    /// Who answers.
    pub peer: String,
    /// The method.
    pub method: String,
    /// How it represents the parts.
    pub kind: Option<super::method::Kind>,
    /// Its version.
    pub version: Option<String>,
    /// Largest deviation of the meshes from the surfaces, µm.
    pub mesh_um: Option<f64>,
    /// Triangles of both meshes.
    pub triangles: Option<usize>,
    /// Bytes of our image.
    pub image_bytes: Option<usize>,
    /// Poses.
    pub poses: usize,
    /// Median over the poses, µs.
    pub median_us: Option<f64>,
    /// Slowest pose, µs.
    pub worst_us: Option<f64>,
    /// Time of the same call for two balls, µs.
    pub floor_us: Option<f64>,
    /// Median over that of our default bake on the scene.
    pub over_ours: Option<f64>,
    /// Poses more than [`SIGN_MM`] apart reported to overlap, or overlapping more than that reported apart.
    pub wrong_signs: Option<usize>,
    /// Poses whose distance it does not give.
    pub without_distance: Option<usize>,
    /// Largest error of a gap, µm.
    pub gap_error_um: Option<f64>,
    /// Pose of it.
    pub gap_at: Option<String>,
    /// Largest error of a depth, µm.
    pub depth_error_um: Option<f64>,
    /// Pose of it.
    pub depth_at: Option<String>,
    /// Why it is not measured.
    pub skipped: Option<String>,
}

impl Entry {
    /// The line of what was asked.
    pub fn of(scene: &str, cases: &[Case], asked: &Asked) -> Self {
        let entry = Self {
            scene: scene.into(),
            poses: cases.len(),
            ..Self::default()
        };
        match asked {
            Asked::Skipped { peer, name, reason } => Self {
                peer: peer.clone(),
                method: name.clone(),
                skipped: Some(reason.clone()),
                ..entry
            },
            Asked::Answered(method) => entry.judged(cases, method),
        }
    }

    /// The line of a scene that cannot be measured at all.
    pub fn skipped(scene: &str, reason: &str) -> Self {
        Self {
            scene: scene.into(),
            method: "all".into(),
            skipped: Some(reason.into()),
            ..Self::default()
        }
    }

    fn judged(self, cases: &[Case], method: &Method) -> Self {
        let pairs = || cases.iter().zip(&method.answers);
        let worst = |gaps: bool| {
            pairs()
                .filter(|(case, _)| (case.exact_mm >= 0.0) == gaps)
                .filter_map(|(case, answer)| Some((error_mm(case.exact_mm, answer)?, &case.pose.name)))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .map(|(error, name)| (1e3 * error, name.clone()))
                .unzip()
        };
        let ((gap_error_um, gap_at), (depth_error_um, depth_at)) = (worst(true), worst(false));
        Self {
            peer: method.peer.clone(),
            method: method.name.clone(),
            kind: Some(method.kind),
            version: method.version.clone(),
            mesh_um: method.mesh.map(|(deflection_mm, _)| 1e3 * deflection_mm),
            triangles: method.mesh.map(|(_, triangles)| triangles),
            image_bytes: method.image_bytes,
            median_us: Some(median(method.answers.iter().map(|answer| answer.us))),
            worst_us: method
                .answers
                .iter()
                .map(|answer| answer.us)
                .max_by(f64::total_cmp),
            floor_us: method.floor_us,
            wrong_signs: Some(
                pairs()
                    .filter(|(case, answer)| is_wrong(case.exact_mm, answer))
                    .count(),
            ),
            without_distance: Some(pairs().filter(|(_, answer)| answer.mm.is_none()).count()),
            gap_error_um,
            gap_at,
            depth_error_um,
            depth_at,
            ..self
        }
    }
}

/// True if the sign is wrong beyond [`SIGN_MM`].
fn is_wrong(exact: f64, answer: &Answer) -> bool {
    exact.abs() > SIGN_MM && answer.overlaps != (exact < 0.0)
}

/// Error of the distance, mm; a wrong sign without a distance errs by at least the whole distance, a right one has no error.
fn error_mm(exact: f64, answer: &Answer) -> Option<f64> {
    match answer.mm {
        Some(mm) => Some((mm - exact).abs()),
        None => is_wrong(exact, answer).then_some(exact.abs()),
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.scene, self.method)?;
        if let Some(reason) = &self.skipped {
            return write!(f, ": skipped: {reason}");
        }
        if let (Some(mesh), Some(triangles)) = (self.mesh_um, self.triangles) {
            write!(f, ", {mesh} µm mesh of {triangles} triangles")?;
        }
        let number = |value: Option<f64>| value.map_or("none".to_owned(), |value| format!("{value:.1}"));
        write!(
            f,
            ": median {}, worst {} µs; {} of {} signs wrong; gap {}, depth {} µm off",
            number(self.median_us),
            number(self.worst_us),
            self.wrong_signs.unwrap_or_default(),
            self.poses,
            number(self.gap_error_um),
            number(self.depth_error_um)
        )
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};
    use mortise_scenario::probe::NamedPose;

    use super::super::method::Kind;
    use super::*;

    fn cases(exact_mm: &[f64]) -> Vec<Case> {
        let case = |&exact_mm: &f64| Case {
            pose: NamedPose {
                name: String::new(),
                position_mm: DVec3::ZERO,
                orientation: DQuat::IDENTITY,
            },
            exact_mm,
        };
        exact_mm.iter().map(case).collect()
    }

    fn answered(answers: &[(bool, Option<f64>, f64)]) -> Asked {
        Asked::Answered(Method {
            peer: "X".into(),
            name: "X, hulls".into(),
            kind: Kind::Hulls,
            version: None,
            floor_us: None,
            mesh: Some((0.01, 12)),
            image_bytes: None,
            answers: (answers.iter())
                .map(|&(overlaps, mm, us)| Answer { overlaps, mm, us })
                .collect(),
        })
    }

    #[test]
    fn signs_and_errors_are_counted_against_truth() {
        let cases = cases(&[1.0, 0.2, 0.005, -0.5, -0.3]);
        let asked = answered(&[
            (false, Some(1.001), 1.0),
            (true, Some(-0.1), 2.0),
            // Within the tolerance of either sign.
            (true, Some(-0.001), 9.0),
            (true, None, 4.0),
            // Reported apart without a distance: errs by at least the depth.
            (false, None, 5.0),
        ]);
        let entry = Entry::of("s", &cases, &asked);
        assert_eq!((entry.wrong_signs, entry.without_distance), (Some(2), Some(2)));
        assert_eq!((entry.median_us, entry.worst_us), (Some(4.0), Some(9.0)));
        let close = |found: Option<f64>, wanted: f64| (found.expect("measured") - wanted).abs() < 1e-9;
        assert!(close(entry.gap_error_um, 300.0), "{entry}");
        assert!(close(entry.depth_error_um, 300.0), "{entry}");
    }

    #[test]
    fn a_skip_has_no_figure() {
        let skip = Asked::Skipped {
            peer: "X".into(),
            name: "X".into(),
            reason: "not to be had".into(),
        };
        let entry = Entry::of("s", &cases(&[1.0]), &skip);
        let none = Entry {
            scene: "s".into(),
            peer: "X".into(),
            method: "X".into(),
            poses: 1,
            skipped: Some("not to be had".into()),
            ..Entry::default()
        };
        assert_eq!(entry, none);
        assert_eq!(entry.to_string(), "s: X: skipped: not to be had");
    }
}
