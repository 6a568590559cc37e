//! Two thousand points in contact at once.

use mortise_haptics::Integrator;

use crate::LabError;
use crate::figures::Row;
use crate::stability::press::{PUSH_N, press, settings, slab, touching};

/// Total stiffness of the contacts, N/m.
const IN_ALL_N_PER_M: f32 = 1e6;
/// Deepest penetration at [`PUSH_N`], µm.
const DEEPEST_UM: f64 = 20.0;
/// Largest variation of the force at rest: a thousandth.
const STILL_N: f64 = 1e-3 * PUSH_N;
/// Perceptible vibration, N.
const FELT_N: f64 = 0.5;

pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let slab = slab(0.39)?;
    let scene = slab.scene()?;
    let what = format!("points of a flat face pressed with {PUSH_N} N, 1 MN/m in all");
    let points = touching(&scene, slab.part) as f64;
    out(Row::within(
        format!("{what}: at once"),
        points,
        "points",
        2000.0,
        f64::INFINITY,
    ));
    let implicit = press(&scene, slab.part, &settings(Integrator::Implicit, IN_ALL_N_PER_M));
    let explicit = press(&scene, slab.part, &settings(Integrator::Explicit, IN_ALL_N_PER_M));
    out(Row::at_most(
        format!("{what}, implicit: largest less smallest force of half a second"),
        implicit.unrest_n,
        "N",
        STILL_N,
    ));
    out(Row::within(
        format!("{what}, implicit: deepest point"),
        implicit.penetration_um,
        "µm",
        0.1,
        DEEPEST_UM,
    ));
    out(Row::at_most(
        format!("{what}, implicit: energy that contacts made at the object over any interval"),
        implicit.contact_made_mj,
        "mJ",
        1.0,
    ));
    out(Row::within(
        format!("{what}, explicit beside it: largest less smallest force (it trembles)"),
        explicit.unrest_n,
        "N",
        FELT_N,
        f64::INFINITY,
    ));
    out(Row::reported(
        format!("{what}, explicit beside it: deepest point"),
        explicit.penetration_um,
        "µm",
    ));
    out(Row::reported(
        format!("{what}, explicit beside it: energy that contacts made at the object over any interval"),
        explicit.contact_made_mj,
        "mJ",
    ));
    Ok(())
}
