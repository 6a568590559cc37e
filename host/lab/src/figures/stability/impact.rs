//! A blow at a metre a second on a wall of a millimetre.

use mortise_haptics::Settings;

use crate::LabError;
use crate::figures::Row;
use crate::stability::impact::{METHODS, WALL_MM, strike, wall};

/// So many speeds up to 1 m/s, a tenth of it apart at the most: where within a tick the blow falls differs with each.
const SPEEDS: u32 = 21;

pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let most_n = f64::from(Settings::default().limits.force_n);
    for (index, (method, variant, integrator)) in METHODS.into_iter().enumerate() {
        let slab = wall(&variant)?;
        let scene = slab.scene()?;
        let blows: Vec<_> = (0..SPEEDS)
            .map(|i| 1.0 - 0.005 * f64::from(i))
            .map(|speed| strike(&scene, slab.part, method, integrator, speed))
            .collect();
        let what = format!("{SPEEDS} blows of 0.9 to 1 m/s on a wall of {WALL_MM} mm, {method}");
        let through = blows.iter().filter(|blow| blow.tunnelled).count() as f64;
        let deepest = blows
            .iter()
            .map(|blow| blow.penetration_um)
            .fold(f64::NEG_INFINITY, f64::max);
        let peak = blows.iter().map(|blow| blow.peak_force_n).fold(0.0, f64::max);
        // The first method is ours; the others stand beside it.
        if index == 0 {
            out(Row::exactly(format!("{what}: came through"), through, "", 0.0));
            out(Row::within(
                format!("{what}: largest force on the handle"),
                peak,
                "N",
                1.0,
                most_n,
            ));
        } else {
            out(Row::told(format!("{what}: came through"), through, ""));
            out(Row::told(
                format!("{what}: largest force on the handle"),
                peak,
                "N",
            ));
        }
        out(Row::told(format!("{what}: deepest"), deepest, "µm"));
    }
    Ok(())
}
