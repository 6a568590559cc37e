//! Many points pressed at once: vibration of the handle and depth of the points, implicit and explicit step side by side.

use mortise_bake::PointshellKind;
use mortise_haptics::{Integrator, Pose, Settings, Vec3};
use mortise_protocol::image::SceneImage;
use serde::Serialize;

use super::bench::{Bench, HandCommand, Rig};
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Press force, N.
pub const PUSH_N: f64 = 10.0;
/// Duration of the press, s, whose force grows in its first half, and the part of it that is evaluated, s.
const PRESS_S: f64 = 2.0;
const LOOK_S: f64 = 0.5;
/// Height above the lowest points up to which points touch with them, m: less than the depth of the press.
const LEVEL_M: f32 = 5e-6;
/// Edges of the shells' voxels, mm.
const VOXELS_MM: [f64; 7] = [20.0, 8.0, 4.0, 2.0, 1.0, 0.6, 0.4];

/// One press.
#[derive(Clone, Debug, Serialize)]
pub struct Press {
    /// Integrator of the object.
    pub method: &'static str,
    /// Number of points on the pressed face.
    pub points: usize,
    /// Largest minus smallest force on the handle at the end, N.
    pub unrest_n: f64,
    /// Deepest point at the end, µm.
    pub penetration_um: f64,
    /// Force on the handle at the end, mean, N.
    pub force_n: f64,
    /// Largest work of contacts on the object over any interval, mJ: generated, or stored in their springs.
    pub contact_made_mj: f64,
    /// Largest work of the device on the handle over any interval beyond what was stored at its start, mJ.
    pub handle_made_mj: f64,
}

impl std::fmt::Display for Press {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} points, {}: unrest {:.4} N, {:.2} µm deep, {:.3} N felt, contacts made {:.4} mJ",
            self.points, self.method, self.unrest_n, self.penetration_um, self.force_n, self.contact_made_mj
        )
    }
}

/// The slab under a peg whose flat end is sampled at `voxel_mm`: centres of voxels, not moved inward, so that all of them lie in one plane.
///
/// # Errors
/// Anything that prevents it from being baked.
pub fn slab(voxel_mm: f64) -> Result<Slab, LabError> {
    let variant = Variant {
        shell: PointshellKind::Classic {
            voxel_mm: Some(voxel_mm),
            shrink_percent: 0.0,
        },
        epsilon_mm: None,
        ..Variant::field(1.0)
    };
    Slab::bake(&variant, 10.0, 0.5 * voxel_mm + 0.05)
}

/// Number of points on the peg's lower end.
pub fn touching(scene: &SceneImage<'_>, part: u16) -> usize {
    let record = &scene.parts()[usize::from(part)];
    let pose = Pose::from_arrays(record.position, record.orientation);
    let points = scene.shape_of_part(usize::from(part)).points;
    let heights: Vec<f32> = (points.iter())
        .map(|point| pose.transform_point(Vec3::from_array(point.position)).z)
        .collect();
    let lowest = heights.iter().copied().fold(f32::INFINITY, f32::min);
    heights.iter().filter(|&&z| z < lowest + LEVEL_M).count()
}

/// Settings of a press that queries every point and does not slip at [`PUSH_N`].
pub fn settings(integrator: Integrator, in_all_n_per_m: f32) -> Settings {
    let mut settings = Settings {
        integrator,
        ..Settings::default()
    };
    settings.contact.total_stiffness_n_per_m = in_all_n_per_m;
    settings.contact.point_budget = 50_000;
    settings.coupling.force_max_n = 20.0;
    settings
}

/// Presses part `part`.
pub fn press(scene: &SceneImage<'_>, part: u16, settings: &Settings) -> Press {
    let mut rig = Rig::held();
    // The hand pushes and damps, without a position spring.
    rig.plant.stiffness = 0.0;
    let mut bench = Bench::new(scene, part, *settings, rig);
    let ticks = (PRESS_S / f64::from(settings.period_s)) as u32;
    let look = (LOOK_S / f64::from(settings.period_s)) as u32;
    let (mut least, mut most, mut sum, mut deepest) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0f64);
    for i in 0..ticks {
        let push = -PUSH_N * (2.0 * f64::from(i) / f64::from(ticks)).min(1.0);
        let out = bench.step(&HandCommand {
            push,
            ..HandCommand::default()
        });
        if i >= ticks - look {
            let force = f64::from(out.handle.force.z);
            least = least.min(force);
            most = most.max(force);
            sum += force;
            deepest = deepest.max(out.pairs.first().map_or(0.0, |pair| f64::from(pair.depth_m)));
        }
    }
    Press {
        method: match settings.integrator {
            Integrator::Implicit => "implicit (ours)",
            Integrator::Explicit => "explicit (textbook)",
        },
        points: touching(scene, part),
        unrest_n: most - least,
        penetration_um: 1e6 * deepest,
        force_n: sum / f64::from(look),
        contact_made_mj: 1e3 * bench.contact_made_j(),
        handle_made_mj: 1e3 * bench.handle_made_j(),
    }
}

/// Presses with a few to two thousand points of 200 kN/m each.
///
/// # Errors
/// As [`slab`].
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Press)) -> Result<Vec<Press>, LabError> {
    let mut presses = Vec::new();
    let voxels = if quick { &VOXELS_MM[2..4] } else { &VOXELS_MM[..] };
    for &voxel in voxels {
        let slab = slab(voxel)?;
        let scene = slab.scene()?;
        for integrator in [Integrator::Implicit, Integrator::Explicit] {
            let press = press(&scene, slab.part, &settings(integrator, 1e9));
            out(&press);
            presses.push(press);
        }
    }
    Ok(presses)
}

/// Variation of the force over the number of points.
pub fn chart(presses: &[Press]) -> Chart {
    // Variations below the range of the logarithmic axis are drawn at its lower end.
    const LEAST_N: f64 = 1e-5;
    let of = |method: &str| -> Vec<Point> {
        (presses.iter().filter(|press| press.method == method))
            .map(|press| Point {
                x: press.points as f64,
                y: press.unrest_n.max(LEAST_N),
                label: format!("{:.1} µm", press.penetration_um),
                at_least: false,
            })
            .collect()
    };
    let series = |name: &str, look| Series {
        name: name.into(),
        look,
        line: Line::Solid,
        points: of(name),
    };
    Chart {
        title: "Unrest of the handle's force over the number of touching points".into(),
        note: "200 kN/m a point, pressed with 10 N; object 0.1 kg, 1 kHz. Beside the marks: deepest point."
            .into(),
        x: Axis::new("touching points"),
        y: Axis::new("largest less smallest force, N"),
        series: vec![
            series("implicit (ours)", Look::BlueDisc),
            series("explicit (textbook)", Look::VermilionSquare),
        ],
    }
}
