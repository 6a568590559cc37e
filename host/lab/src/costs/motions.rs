//! Motions whose ticks are counted: free, pressed and slid, on a rim, and guided into a hole.

use mortise_bake::{Grabbable, SampleFormat};
use mortise_protocol::message::{Telemetry, ToDevice};
use mortise_protocol::parameter::ParameterId;
use mortise_scenario::{PreparedScene, Scenario};

use crate::LabError;
use crate::fit::Fit;
use crate::guided::{insertion, known_target, refreshed};
use crate::motion::{Motion, script};
use crate::table::rounded;
use crate::variant::Variant;

/// Point budget, field queries: far more than any of these motions takes, so that no tick decimates.
const BUDGET: f32 = 20_000.0;

/// Messages to send on a sample.
type Answers = dyn FnMut(&Telemetry) -> Vec<ToDevice>;

/// A motion, its scene, and its target.
pub(super) struct Course {
    pub name: String,
    pub scenario: Scenario,
    pub scene: PreparedScene,
    guided: bool,
}

impl Course {
    /// Messages to send on telemetry; the same on every rig.
    pub fn listener(&self) -> Result<Box<Answers>, LabError> {
        Ok(if self.guided {
            Box::new(refreshed(known_target(&self.scenario, &self.scene)?))
        } else {
            Box::new(|_| Vec::new())
        })
    }
}

/// Number of motions.
pub(super) const COUNT: usize = PLAYED.len();
/// Number of motions of the quick form.
pub(super) const QUICK: usize = 4;

/// What moves, and how.
struct Played {
    fit: Fit,
    variant: Variant,
    /// `None`: guided into the hole.
    motion: Option<Motion>,
}

const fn pressed(mm_per_s: f64) -> Option<Motion> {
    Some(Motion::Pressed { mm_per_s })
}

/// The first [`QUICK`] have every count of the full list.
const PLAYED: [Played; 13] = [
    row(Fit::thesis(0.02), Variant::board(0.5), pressed(10.0)),
    row(
        Fit::thesis(1.0),
        Variant::field(0.5).epsilon_mm(0.05),
        Some(Motion::Rim),
    ),
    row(Fit::thesis(0.02), Variant::board(0.5), Some(Motion::Free)),
    row(Fit::thesis(0.2), Variant::board(0.5), None),
    row(Fit::thesis(0.02), Variant::field(0.5), pressed(10.0)),
    row(Fit::thesis(0.2), Variant::field(0.5), pressed(100.0)),
    row(
        Fit::thesis(1.0),
        Variant::field(0.5).epsilon_mm(0.0005),
        Some(Motion::Rim),
    ),
    row(Fit::thesis(0.02), Variant::board(0.5), None),
    row(Fit::large(690.0), LARGE, pressed(20.0)),
    row(Fit::large(690.0), LARGE, pressed(200.0)),
    row(Fit::large(699.8), LARGE, pressed(20.0)),
    row(Fit::large(699.8), LARGE, pressed(200.0)),
    row(Fit::large(690.0), CLASSIC, pressed(20.0)),
];
const LARGE: Variant = Variant::field(10.0).epsilon_mm(0.05);
const CLASSIC: Variant = Variant::field(10.0)
    .format(SampleFormat::Int8)
    .classic_shell(8.33);

const fn row(fit: Fit, variant: Variant, motion: Option<Motion>) -> Played {
    Played { fit, variant, motion }
}

/// Bakes the scene of motion `index`.
pub(super) fn prepare(index: usize) -> Result<Course, LabError> {
    let Played { fit, variant, motion } = &PLAYED[index];
    let placed = match motion {
        Some(motion) => Some(script(fit, *motion)?),
        None => None,
    };
    let fit = placed.as_ref().map_or(*fit, |(fit, _)| *fit);
    let file = fit.file()?;
    let mut scenario = match placed {
        Some((_, scenario)) => scenario,
        None => insertion(&fit, file.path())?,
    };
    scenario.scene.step = file.path().to_owned();
    scenario.run.telemetry_every_ticks = 1;
    let budget = ParameterId::PointBudget.row().name.to_owned();
    scenario.parameters.insert(budget, BUDGET);
    let options = variant.options(Grabbable::Named(vec![scenario.scene.part.clone()]));
    let what = match motion {
        None => "guided into its hole".to_owned(),
        Some(Motion::Free) => "in free motion".to_owned(),
        Some(Motion::Rim) => "on its rim".to_owned(),
        Some(Motion::Pressed { mm_per_s }) => format!("pressed and slid at {mm_per_s} mm/s"),
    };
    Ok(Course {
        name: format!(
            "peg of {} mm, {} mm clearance, {variant}, {what}",
            fit.peg_mm,
            rounded(fit.clearance_mm(), 3)
        ),
        scene: PreparedScene::with(&scenario, &options)?,
        scenario,
        guided: motion.is_none(),
    })
}
