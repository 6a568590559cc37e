//! Contact: accurate to micrometres, at a cost that the board can afford.

mod accuracy;
mod baking;
mod bars;
mod blows;
mod convex_pairs;
mod direction;
mod errors;
mod free_form;
mod ghosts;
mod hands;
mod insertion;
mod limits;
mod random_fits;
mod ticks;
mod two_solids;

use super::{Plan, Row};
use crate::LabError;

/// Measures some rows.
type Measure = fn(&Plan<'_>, &mut dyn FnMut(Row)) -> Result<(), LabError>;

/// The table's parts, in its order.
const PARTS: &[(&str, Measure)] = &[
    ("accuracy", |_, out| {
        accuracy::scene_p(out)?;
        accuracy::centred(out)
    }),
    ("insertion", insertion::tight),
    ("ticks", |plan, out| {
        ticks::tight(plan, out)?;
        ticks::large_classic(plan, out)?;
        ticks::large(plan, out)?;
        ticks::more_points(plan, out)
    }),
    ("convex-pairs", convex_pairs::measure),
    ("crossing-bars", bars::measure),
    ("blows", blows::measure),
    ("ghosts", ghosts::measure),
    ("hands", hands::measure),
    ("direction", direction::measure),
    ("planned-pairs", free_form::planned),
    ("random-fits", |plan, out| {
        random_fits::measure(plan, out)?;
        free_form::search(plan, out)
    }),
    ("exact-pairs", free_form::exact),
    ("baking", |plan, out| {
        baking::motor(plan, out)?;
        baking::real_parts(plan, out)
    }),
];

/// Measures every row, or those of one part.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let wanted = |name: &str| plan.only.is_none_or(|only| only == name);
    if let Some(only) = plan.only
        && !PARTS.iter().any(|(name, _)| wanted(name))
    {
        return Err(LabError::NoSuchFigures {
            name: only.to_owned(),
            known: PARTS.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
        });
    }
    (PARTS.iter().filter(|(name, _)| wanted(name))).try_for_each(|(_, measure)| measure(plan, out))
}
