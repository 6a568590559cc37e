//! Effect of a slower tick: the coupling stays passive, at a lower stiffness.

use mortise_haptics::Settings;

use crate::LabError;
use crate::figures::Row;
use crate::stability::bench::{Bench, HandCommand, Rig};
use crate::stability::boundary::stiffness_limit;
use crate::stability::oracle::{self, COARSE, Law, Wall};
use crate::stability::slab::Slab;
use crate::variant::Variant;

/// Press force, N, tap speed, m/s, and duration, s.
const PRESS_N: f64 = 5.0;
const TAP_M_PER_S: f64 = 0.1;
const WATCH_S: f64 = 4.0;
/// Largest energy generated, mJ.
const MADE_MJ: f64 = 1.0;

/// Default settings at 1000, 500 and 250 Hz: a loose hand presses, taps every half second, and lets go.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.05)?;
    let scene = slab.scene()?;
    // The hand has no damping: only the mechanism's own friction remains.
    let mut rig = Rig::held();
    rig.plant.stiffness = 0.0;
    rig.plant.damping = 1.0;
    rig.hand_damping = 0.0;
    let mut fastest = f64::NAN;
    for hertz in [1000.0, 500.0, 250.0] {
        let settings = Settings {
            period_s: (1.0 / hertz) as f32,
            ..Settings::default()
        };
        let mut bench = Bench::new(&scene, slab.part, settings, rig);
        let ticks = (WATCH_S * hertz) as u32;
        let half = (0.5 * hertz) as u32;
        for i in 0..ticks {
            if i % half == half / 2 {
                bench.speed += TAP_M_PER_S;
            }
            let t = f64::from(i) / hertz;
            let push = -PRESS_N * t.min(1.0).min(WATCH_S - t);
            bench.step(&HandCommand {
                push,
                ..HandCommand::default()
            });
        }
        let what =
            format!("{hertz} Hz, default gains, pressed with {PRESS_N} N, tapped with {TAP_M_PER_S} m/s");
        out(Row::at_most(
            format!("{what}: energy made at the handle over any interval"),
            1e3 * bench.handle_made_j(),
            "mJ",
            MADE_MJ,
        ));
        out(Row::at_most(
            format!("{what}: the same, of what passed"),
            100.0 * bench.handle_made_j() / bench.handle_passed_j(),
            "%",
            1.0,
        ));
        out(Row::reported(
            format!("{what}: stiffness the valve took"),
            100.0 * f64::from(bench.passivity().softened),
            "%",
        ));
        let wall = Wall {
            stiffness: 0.0,
            damping: 20.0,
            filter_s: 3e-3,
            period_s: 1.0 / hertz,
            delay_ticks: 0,
        };
        let bare = Rig::bare(0.15, 1.0);
        let theory = oracle::stiffness_limit(&bare.plant, Law::Coupling, &wall, 1e5);
        let found = stiffness_limit(&scene, slab.part, &bare, Law::Coupling, &wall, theory, COARSE);
        if fastest.is_nan() {
            fastest = found;
        }
        let what = format!("{hertz} Hz, b_T = 20 N s/m, handle 0.15 kg that nobody holds");
        out(Row::reported(format!("{what}: largest stable k_T"), found, "N/m"));
        out(Row::within(
            format!("{what}: the same off the spectral radius' {theory:.0} N/m"),
            100.0 * (found / theory - 1.0),
            "%",
            -3.0,
            3.0,
        ));
        out(Row::reported(
            format!("{what}: loss against 1000 Hz"),
            100.0 * (1.0 - found / fastest),
            "%",
        ));
    }
    Ok(())
}
