//! The stability boundary of a wall, found with the product's tick, against the spectral radius of the linear loop.

use crate::LabError;
use crate::figures::Row;
use crate::stability::bench::Rig;
use crate::stability::boundary::stiffness_limit;
use crate::stability::oracle::{self, FINE, Law, Wall};
use crate::stability::slab::Slab;
use crate::variant::Variant;

/// Largest difference between experiment and reference, percent.
const WITHIN_PERCENT: f64 = 1.0;

/// Four walls on a handle of 0.1 kg with 0.5 N s/m at 1 kHz.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
    let scene = slab.scene()?;
    let rig = Rig::bare(0.1, 0.5);
    for (damping, delay_ticks) in [(0.0, 0), (0.0, 1), (0.4, 0), (5.0, 1)] {
        let wall = Wall {
            stiffness: 0.0,
            damping,
            filter_s: 0.0,
            period_s: 1e-3,
            delay_ticks,
        };
        let theory = oracle::stiffness_limit(&rig.plant, Law::Wall, &wall, 1e5);
        let found = stiffness_limit(&scene, slab.part, &rig, Law::Wall, &wall, theory, FINE);
        let what = format!(
            "handle 0.1 kg, 0.5 N s/m, 1 kHz; wall through coupling and contact, B = {damping} N s/m, {delay_ticks} ticks late: "
        );
        out(Row::reported(
            format!("{what}largest stable stiffness by experiment"),
            found,
            "N/m",
        ));
        out(Row::within(
            format!("{what}off the spectral radius' {theory:.1} N/m"),
            100.0 * (found / theory - 1.0),
            "%",
            -WITHIN_PERCENT,
            WITHIN_PERCENT,
        ));
    }
    Ok(())
}
