//! Scene P: a peg ø20 × 50 in a hole ø20.2 through a block 60 × 60 × 40, poses of the peg, and the exact distance at each in closed form.
//!
//! Both parts have their origin at their centre and the hole along z. The poses are free, touching, inside the clearance, up to 1 mm in the wall, and
//! tilted against the rim.

use std::io::Write as _;

use glam::{DQuat, DVec3};
use mortise_bake::{BakeOptions, Grabbable};
use mortise_brep::{CadModel, LoadOptions, load_step_with};
use mortise_scenario::probe::{NamedPose, Pair, ProbeRow, ProbeScene};
use tempfile::{Builder, NamedTempFile};

use crate::error::LabError;
use crate::variant::Variant;

/// Its STEP text; parts `block` and `peg`.
pub const STEP: &str = include_str!("../data/scene_p.step");

const PEG: f64 = 10.0;
const PEG_HALF: f64 = 25.0;
const HOLE: f64 = 10.1;
const BLOCK_HALF: f64 = 20.0;
const SIDE: f64 = 30.0;

/// A pose, and the exact distance there.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Pose of the peg in the block's frame.
    pub pose: NamedPose,
    /// Exact distance, mm: gap positive, deepest penetration negative.
    pub exact_mm: f64,
}

fn case(name: String, position_mm: DVec3, orientation: DQuat, exact_mm: f64) -> Case {
    Case {
        pose: NamedPose {
            name,
            position_mm,
            orientation,
        },
        exact_mm,
    }
}

/// Offset perpendicular to the axis, mm, at an angle that lies between the samples.
pub fn aside(by: f64, angle: f64) -> DVec3 {
    DVec3::new(by * angle.cos(), by * angle.sin(), 0.0)
}

/// All cases.
pub fn cases() -> Vec<Case> {
    let none = DQuat::IDENTITY;
    let mut cases = Vec::new();
    // Inside the clearance, touching, and pushed into the wall: the gap is the radial clearance minus the offset.
    for by in [0.0, 0.02, 0.05, 0.09, 0.1, 0.2, 0.3, 0.5, 0.8, 1.0, 1.1] {
        for angle in [0.0, 0.3, 1.23, 2.75, 4.0] {
            let exact = HOLE - PEG - by;
            let name = format!("{by} mm aside at {angle}");
            cases.push(case(name, aside(by, angle), none, exact));
        }
    }
    // Tilted: the rim comes nearest to the peg's side, then penetrates it.
    for tilt in [
        0.001, 0.002, 0.004, 0.0049, 0.0052, 0.006, 0.01, 0.02, 0.03, 0.04, 0.05,
    ] {
        for angle in [0.0, 0.7, 2.0, 3.3] {
            let axis = DVec3::new(-f64::sin(angle), f64::cos(angle), 0.0);
            let exact = HOLE * f64::cos(tilt) - BLOCK_HALF * f64::sin(tilt) - PEG;
            let name = format!("tilted by {tilt} at {angle}");
            cases.push(case(name, DVec3::ZERO, DQuat::from_axis_angle(axis, tilt), exact));
        }
    }
    // Above the block: flat on flat apart from the hole, rim to rim above it, and pressed into the top.
    for height in [40.0, 5.0, 1.0, 0.3, 0.02, 0.0, -0.1, -0.4, -1.0] {
        let up = DVec3::Z * (BLOCK_HALF + PEG_HALF + height);
        cases.push(case(
            format!("{height} mm over, 12 mm aside"),
            up + aside(12.0, 0.4),
            none,
            height,
        ));
        if height > 0.0 {
            let exact = f64::hypot(height, HOLE - PEG);
            cases.push(case(format!("{height} mm over the hole"), up, none, exact));
        }
    }
    // Beside the block, upright and lying: a generator, then the end's flat, against the block's side.
    for gap in [30.0, 3.0, 0.7, 0.05, 0.0, -0.1, -0.5, -0.9] {
        let beside = DVec3::new(SIDE + PEG + gap, 3.3, 1.7);
        for turn in [0.0, 0.37] {
            let name = format!("{gap} mm beside, turned by {turn}");
            cases.push(case(name, beside, DQuat::from_rotation_z(turn), gap));
        }
        let end = DVec3::new(SIDE + PEG_HALF + gap, 3.3, 1.7);
        cases.push(case(
            format!("{gap} mm beside, lying"),
            end,
            DQuat::from_rotation_y(f64::to_radians(90.0)),
            gap,
        ));
    }
    // Off a corner of the block: the peg's lower rim is nearest to it, as far away along the diagonal as above.
    for gap in [8.0, 0.6, 0.1] {
        let away = DVec3::new(SIDE, SIDE, 0.0) + DVec3::new(1.0, 1.0, 0.0).normalize() * (PEG + gap);
        let up = DVec3::Z * (BLOCK_HALF + PEG_HALF + gap);
        let exact = gap * f64::sqrt(2.0);
        cases.push(case(
            format!("{gap} mm off a corner"),
            away + up,
            DQuat::IDENTITY,
            exact,
        ));
    }
    cases
}

/// A temporary STEP file of the scene, removed when dropped: the CAD kernel reads files only.
///
/// # Errors
/// `Unwritable`.
pub fn file() -> Result<NamedTempFile, LabError> {
    let write = || {
        let mut file = Builder::new().prefix("mortise-").suffix(".step").tempfile()?;
        file.write_all(STEP.as_bytes())?;
        Ok(file)
    };
    write().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })
}

/// The scene's CAD model.
///
/// # Errors
/// `Unwritable`, `Brep`.
pub fn model(options: &LoadOptions) -> Result<CadModel, LabError> {
    Ok(load_step_with(file()?.path(), options)?)
}

/// Results of every case with one model of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Bytes of the image.
    pub image_bytes: usize,
    /// The exact distance, mm, and the probe's row.
    pub rows: Vec<(f64, ProbeRow)>,
}

/// Probes every case.
///
/// # Errors
/// `Unwritable`, `Brep`, `Bake`, `Input`.
pub fn ask(variant: &Variant) -> Result<Asked, LabError> {
    let (scene, pair) = bake(variant)?;
    let rows = (cases().into_iter())
        .map(|case| Ok((case.exact_mm, scene.probe(pair, &case.pose)?)))
        .collect::<Result<_, LabError>>()?;
    Ok(Asked {
        image_bytes: scene.image_bytes(),
        rows,
    })
}

/// The baked scene, and its pair of peg and block.
///
/// # Errors
/// As [`ask`].
pub fn bake(variant: &Variant) -> Result<(ProbeScene, Pair), LabError> {
    let options: BakeOptions = variant.options(Grabbable::All);
    let scene = ProbeScene::bake(file()?.path(), &options)?;
    let pair = scene.pair("peg", Some("block"))?;
    Ok((scene, pair))
}

/// Distance below which a pose counts as near contact, mm: the scene's radial clearance.
pub const NEAR_MM: f64 = 0.1;

/// The distance that is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum By {
    /// The probe's distance: refined by the analytic faces.
    Probe,
    /// The field's own distance, on which the force law acts, at poses nearer than [`NEAR_MM`] or penetrating: at larger gaps no tick acts.
    Field,
    /// The field's own distance within a cell of contact, including edge against edge, where the field rounds corners.
    FieldWithin {
        /// mm.
        mm: f64,
    },
}

impl Asked {
    /// Largest error over the gaps (`gaps`) or over the depths, mm, and the pose's name.
    pub fn worst(&self, by: By, gaps: bool) -> (f64, &str) {
        let error = |exact: f64, row: &ProbeRow| match by {
            By::Probe => Some((row.distance_mm - exact).abs()),
            By::Field if exact > NEAR_MM + 1e-6 => None,
            By::FieldWithin { mm } if exact > mm => None,
            By::Field | By::FieldWithin { .. } => match row.field_distance_mm {
                Some(field) => Some((field - exact).abs()),
                // An undetected depth counts with its full depth as error; an undetected gap has no error.
                None => (exact < 0.0).then_some(-exact),
            },
        };
        (self.rows.iter())
            .filter(|(exact, _)| (*exact >= 0.0) == gaps)
            .filter_map(|(exact, row)| Some((error(*exact, row)?, row.name.as_str())))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::NAN, "none"))
    }

    /// Median over the cases of the shortest time of each, ns.
    pub fn median_ns(&self) -> f64 {
        median(self.rows.iter().map(|(_, row)| row.least_ns as f64))
    }
}

/// Median; NaN without values.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
