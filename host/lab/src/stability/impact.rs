//! Impact on a thin wall: penetration, tunnelling, and the force on the handle.

use glam::{DAffine3, DQuat, DVec3};
use mortise_haptics::{Integrator, Quat, Settings};
use mortise_protocol::image::SceneImage;
use serde::Serialize;

use super::bench::{Bench, HandCommand, Rig};
use super::slab::Slab;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::error::LabError;
use crate::variant::Variant;

/// Thickness of the wall, and height of the part's start above it, mm.
pub const WALL_MM: f64 = 1.0;
const GAP_MM: f64 = 20.0;
/// Ticks in which a part reaches the tilt of its impact.
const TILT_TICKS: u32 = 400;
/// Target of the hand beyond first contact, mm, and how long it stays there, s.
const BEYOND_MM: f64 = 5.0;
const STAY_S: f64 = 0.5;
/// Speeds, m/s.
const SPEEDS: [f64; 6] = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0];

/// One impact.
#[derive(Clone, Debug, Serialize)]
pub struct Blow {
    /// Model of the scene and integration step.
    pub method: &'static str,
    /// Speed, m/s.
    pub speed: f64,
    /// Angle of the part's axis off the wall's normal, degrees.
    pub tilt_deg: f64,
    /// Largest depth of the part's lowest point below the wall's face, closed form, µm; negative when it stopped above the wall.
    pub penetration_um: f64,
    /// True if it was ever past the wall's middle.
    pub tunnelled: bool,
    /// Largest force on the handle, N.
    pub peak_force_n: f64,
    /// Largest work of the device on the handle over any interval beyond what was stored at its start, mJ.
    pub handle_made_mj: f64,
}

impl std::fmt::Display for Blow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, {} m/s: {:.1} µm deep, {:.2} N{}",
            self.method,
            self.speed,
            self.penetration_um,
            self.peak_force_n,
            if self.tunnelled { ", came through" } else { "" }
        )
    }
}

/// Models of wall and integration step.
pub const METHODS: [(&str, Variant, Integrator); 3] = [
    (
        "field, implicit (ours)",
        Variant::board(0.5),
        Integrator::Implicit,
    ),
    ("field, explicit", Variant::board(0.5), Integrator::Explicit),
    (
        "voxmap 0.5 mm, explicit (textbook)",
        Variant::textbook(0.5),
        Integrator::Explicit,
    ),
];

/// The thin wall, baked.
///
/// # Errors
/// Anything that prevents it from being baked.
pub fn wall(variant: &Variant, thick_mm: f64) -> Result<Slab, LabError> {
    Slab::bake(variant, thick_mm, GAP_MM)
}

/// Conditions of an impact.
#[derive(Clone, Copy)]
pub struct Strike<'a> {
    /// The wall.
    pub slab: &'a Slab,
    /// The wall's scene.
    pub scene: &'a SceneImage<'a>,
    /// Thickness of the wall, mm.
    pub thick_mm: f64,
    /// Angle of the part's axis off the wall's normal, degrees.
    pub tilt_deg: f64,
    /// Name of the model.
    pub method: &'static str,
    /// Integrator of the object.
    pub integrator: Integrator,
    /// Speed, m/s.
    pub speed: f64,
}

/// Plays one impact: the part reaches its tilt at rest, then goes down.
pub fn strike(blow: &Strike<'_>) -> Blow {
    let &Strike {
        slab,
        scene,
        thick_mm,
        tilt_deg,
        method,
        integrator,
        speed,
    } = blow;
    let settings = Settings {
        integrator,
        ..Settings::default()
    };
    let period = f64::from(settings.period_s);
    let mut bench = Bench::new(scene, slab.part, settings, Rig::held());
    bench.orientation = Quat::from_rotation_y(tilt_deg.to_radians() as f32);
    if tilt_deg != 0.0 {
        for _ in 0..TILT_TICKS {
            bench.step(&HandCommand::default());
        }
    }
    bench.speed = -speed;
    let end = -1e-3 * (GAP_MM + BEYOND_MM);
    let ticks = ((-end / speed + STAY_S) / period) as u32;
    let (mut deepest, mut peak) = (f64::NEG_INFINITY, 0.0f64);
    for i in 0..ticks {
        let wanted = -speed * period * f64::from(i);
        let out = bench.step(&HandCommand {
            position: wanted.max(end),
            speed: if wanted > end { -speed } else { 0.0 },
            push: 0.0,
        });
        let position = 1e3 * DVec3::from_array(out.object.position.to_array().map(f64::from));
        let [x, y, z, w] = out.object.orientation.to_array().map(f64::from);
        let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
        let pose = DAffine3::from_rotation_translation(rotation, position);
        deepest = deepest.max(slab.exact.depth_mm(&pose));
        peak = peak.max(f64::from(out.handle.force.length()));
    }
    Blow {
        method,
        speed,
        tilt_deg,
        penetration_um: 1e3 * deepest,
        tunnelled: deepest > 0.5 * thick_mm,
        peak_force_n: peak,
        handle_made_mj: 1e3 * bench.handle_made_j(),
    }
}

/// All methods at all speeds.
///
/// # Errors
/// As [`wall`].
pub fn sweep(quick: bool, out: &mut dyn FnMut(&Blow)) -> Result<Vec<Blow>, LabError> {
    let mut blows = Vec::new();
    for (method, variant, integrator) in METHODS {
        let slab = wall(&variant, WALL_MM)?;
        let scene = slab.scene()?;
        let speeds = if quick { &SPEEDS[4..] } else { &SPEEDS[..] };
        for &speed in speeds {
            let blow = strike(&Strike {
                slab: &slab,
                scene: &scene,
                thick_mm: WALL_MM,
                tilt_deg: 0.0,
                method,
                integrator,
                speed,
            });
            out(&blow);
            blows.push(blow);
        }
    }
    Ok(blows)
}

/// Penetration over speed.
pub fn chart(blows: &[Blow]) -> Chart {
    // Parts that stopped above the wall, as with voxels, or did not penetrate are drawn at the lower end of the axis.
    const LEAST_UM: f64 = 0.1;
    let series = METHODS.iter().enumerate().map(|(index, (method, ..))| Series {
        name: (*method).into(),
        look: [Look::BlueDisc, Look::PurpleDiamond, Look::VermilionSquare][index],
        line: Line::Solid,
        points: (blows.iter().filter(|blow| blow.method == *method))
            .map(|blow| Point {
                x: blow.speed,
                y: blow.penetration_um.max(LEAST_UM),
                label: if blow.tunnelled {
                    "through".into()
                } else {
                    String::new()
                },
                at_least: blow.tunnelled,
            })
            .collect(),
    });
    Chart {
        title: "A blow on a wall of 1 mm: penetration over speed".into(),
        note: "Peg ø20 mm flat on a slab, hand 400 N/m, 4 N s/m, handle 0.15 kg, 1 kHz. At the foot: 0.1 µm or less, or held off by voxels.".into(),
        x: Axis::new("speed, m/s").with_ticks(&SPEEDS),
        y: Axis::new("deepest, µm"),
        series: series.collect(),
    }
}
