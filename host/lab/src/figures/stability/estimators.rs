//! Which velocity estimator bears the stiffest coupling.

use crate::LabError;
use crate::figures::Row;
use crate::stability::estimators::largest;
use crate::stability::sensor::Counted;
use crate::stability::slab::Slab;
use crate::variant::Variant;

/// Step of the encoder at the handle, m: the simulated mechanism's.
const RESOLUTION_M: f64 = 5e-6;
/// Largest stiffness of another estimator, of that of the one in use, %. Either search ends within 1 %.
const MOST_PERCENT: f64 = 102.0;

/// The estimator in use beside the others, force in time and late.
pub(super) fn measure(out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let slab = Slab::bake(&Variant::board(1.0), 10.0, 0.0)?;
    let scene = slab.scene()?;
    let [in_use, others @ ..] = Counted::ALL;
    for delay_ticks in 0..3 {
        let measured = |counted: Counted| largest(&scene, slab.part, counted, delay_ticks, RESOLUTION_M);
        let what =
            |counted: &Counted| format!("velocity by a {}, force {delay_ticks} ticks late", counted.name());
        let stiffness = measured(in_use);
        out(Row::reported(
            format!("{}: largest stiffness that rests", what(&in_use)),
            stiffness,
            "N/m",
        ));
        for other in others {
            out(Row::at_most(
                format!("{}: the same, of that of the estimator in use", what(&other)),
                100.0 * measured(other) / stiffness,
                "%",
                MOST_PERCENT,
            ));
        }
    }
    Ok(())
}
