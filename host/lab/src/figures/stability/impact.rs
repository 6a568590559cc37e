//! Impact at a metre per second on a thin wall, flat and tilted.

use mortise_haptics::Settings;

use crate::LabError;
use crate::figures::Row;
use crate::stability::impact::{METHODS, Strike, WALL_MM, strike, wall};

/// Number of speeds up to 1 m/s, at most a tenth of it apart: the phase of the impact within a tick differs with each.
const SPEEDS: u32 = 21;
/// A wall thinner than half a cell, mm.
const THIN_MM: f64 = 0.2;
/// Angles of the part's axis off the wall's normal, degrees: flat, and on its rim.
const TILTS_DEG: [f64; 2] = [0.0, 10.0];
/// Deepest penetration, µm: 12 N, the largest force at the handle, on the one point with which a rim touches, and as much for the impact.
const DEEPEST_UM: f64 = 120.0;

pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let most_n = f64::from(Settings::default().limits.force_n);
    for (index, (method, variant, integrator)) in METHODS.into_iter().enumerate() {
        // The first method is Mortise's; the others are compared flat on the thicker wall.
        let ours = index == 0;
        let walls: &[f64] = if ours { &[WALL_MM, THIN_MM] } else { &[WALL_MM] };
        for &thick_mm in walls {
            let slab = wall(&variant, thick_mm)?;
            let scene = slab.scene()?;
            for &tilt_deg in if ours { &TILTS_DEG[..] } else { &TILTS_DEG[..1] } {
                let blows: Vec<_> = (0..SPEEDS)
                    .map(|i| 1.0 - 0.005 * f64::from(i))
                    .map(|speed| {
                        strike(&Strike {
                            slab: &slab,
                            scene: &scene,
                            thick_mm,
                            tilt_deg,
                            method,
                            integrator,
                            speed,
                        })
                    })
                    .collect();
                let how = if tilt_deg == 0.0 {
                    "flat".to_owned()
                } else {
                    format!("tilted by {tilt_deg}°")
                };
                let what =
                    format!("{SPEEDS} blows of 0.9 to 1 m/s on a wall of {thick_mm} mm, {how}, {method}");
                let through = blows.iter().filter(|blow| blow.tunnelled).count() as f64;
                let deepest = blows
                    .iter()
                    .map(|blow| blow.penetration_um)
                    .fold(f64::NEG_INFINITY, f64::max);
                let peak = blows.iter().map(|blow| blow.peak_force_n).fold(0.0, f64::max);
                let [through_of, peak_of, deepest_of] = [
                    "came through",
                    "largest force on the handle",
                    "deepest, closed form",
                ]
                .map(|of| format!("{what}: {of}"));
                if ours {
                    out(Row::exactly(through_of, through, "", 0.0));
                    out(Row::within(peak_of, peak, "N", 1.0, most_n));
                    out(Row::at_most(
                        deepest_of,
                        deepest,
                        "µm",
                        DEEPEST_UM.min(500.0 * thick_mm),
                    ));
                } else {
                    out(Row::reported(through_of, through, ""));
                    out(Row::reported(peak_of, peak, "N"));
                    out(Row::reported(deepest_of, deepest, "µm"));
                }
            }
        }
    }
    Ok(())
}
