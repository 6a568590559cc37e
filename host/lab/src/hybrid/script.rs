//! The course of the hybrid study: where the hand moves, and from which start.

use std::path::Path;

use mortise_protocol::parameter::ParameterId;
use mortise_scenario::{Depth, Key, Scenario};
use serde::Serialize;

use crate::LabError;
use crate::fit::Fit;
use crate::guided::key;

/// Diameters of the pegs, mm: high clearance, low clearance.
pub const PEGS_MM: [f64; 2] = [650.0, 690.0];
/// Distance of the peg's end beyond its hole at the end of the script, mm.
const BEYOND_MM: f64 = 10.0;
/// Speed of the hand, mm/s; time until it is off the axis, and at the end, s.
const MM_PER_S: f64 = 400.0;
const COMES_S: f64 = 0.3;
const ENDS_S: f64 = 0.3;
/// Place of the axis on the face, mm beside the hole's: the peg overlaps the face on an arc of more than half of its rim, so that it does not tip, and
/// is within the block.
const BESIDE_MM: f64 = 150.0;
/// Distance of the hand below the place where the peg meets the face, mm: the springs of hand and coupling, 286 N/m in series, press with 2.9 N.
const PRESS_MM: f64 = 10.0;
/// Time on the face, s.
pub(super) const PRESSED_S: f64 = 0.3;
/// Time over the hole, in which the peg comes to rest, s.
const RESTS_S: f64 = 0.3;
/// Depth of the peg where the hand begins to move to the wall, mm: the grip, in the peg's middle, is 100 mm below the mouth.
const LEANS_AT_MM: f64 = 600.0;
/// Way along the hole on which it does so, mm, and speed of the hand from there on, mm/s: the wide peg moves sideways with 17.5 mm/s.
const LEANS_OVER_MM: f64 = 100.0;
const LEANING_MM_PER_S: f64 = 100.0;

/// Start condition of an insertion: each differs from the first, the thesis', in one respect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Description.
    pub name: &'static str,
    /// Depth of the peg at the start, mm; negative above the hole. A peg that starts inside is not pressed on the face before.
    pub(super) engaged_mm: f64,
    /// Offset of the hand: a share of the radial clearance, and degrees.
    off: f64,
    tilt_deg: f64,
    /// Distance of the hand beyond the wall from [`LEANS_AT_MM`] on, mm; `None`: it stays where it is.
    lean_mm: Option<f64>,
    /// Contact stiffness of a point, N/m; `None`: the default.
    stiffness_n_per_m: Option<f32>,
    /// True for the textbook's explicit step, with the stiffness of ten points in all contacts together.
    explicit: bool,
}

/// All cases. Every hand trembles by 0.1 mm.
pub const CASES: [Case; 5] = [
    FROM_ABOVE,
    Case {
        name: "from above, hand on the axis",
        off: 0.0,
        tilt_deg: 0.0,
        lean_mm: None,
        ..FROM_ABOVE
    },
    Case {
        name: "from 30 mm inside",
        engaged_mm: 30.0,
        ..FROM_ABOVE
    },
    Case {
        name: "from above, points of 1 kN/m",
        stiffness_n_per_m: Some(1e3),
        ..FROM_ABOVE
    },
    Case {
        name: "from above, points of 1 kN/m, explicit step",
        stiffness_n_per_m: Some(1e3),
        explicit: true,
        ..FROM_ABOVE
    },
];
const FROM_ABOVE: Case = Case {
    name: "from above",
    engaged_mm: -20.0,
    off: 0.5,
    tilt_deg: 0.25,
    // 1.4 N of the springs in series.
    lean_mm: Some(5.0),
    stiffness_n_per_m: None,
    explicit: false,
};
/// Ticks between evaluations of constraints, as in the thesis.
const HEED_TICKS: u16 = 10;

/// The thesis' pair, its lengths as in the documentation of the module above.
pub(super) fn fit(peg_mm: f64, engaged_mm: f64) -> Fit {
    Fit {
        width_mm: 1000.0,
        height_mm: 1000.0,
        hole_mm: 700.0,
        peg_mm,
        length_mm: 1000.0,
        engaged_mm,
    }
}

pub(super) fn scenario(fit: &Fit, case: &Case, step: &Path) -> Result<Scenario, LabError> {
    let mut scenario = Scenario::insertion(step)?;
    scenario.hand.tremor_mm = 0.1;
    scenario.hand.tremor_hz = 10.0;
    scenario.hand.grip_mm = [0.0, 0.0, 0.5 * fit.length_mm - fit.engaged_mm];
    let mut keys = vec![key(0.0, [0.0; 3], [0.0; 3])];
    let mut t_s = 0.0;
    if case.engaged_mm < 0.0 {
        let pressed = case.engaged_mm - PRESS_MM;
        for (after_s, z) in [
            (BESIDE_MM / MM_PER_S, 0.0),
            (COMES_S, pressed),
            (PRESSED_S, pressed),
            (COMES_S, 0.0),
        ] {
            t_s += after_s;
            keys.push(key(t_s, [BESIDE_MM, 0.0, z], [0.0; 3]));
        }
        t_s += BESIDE_MM / MM_PER_S;
    }
    let turn_deg = [0.0, case.tilt_deg, 0.0];
    let radial = 0.5 * fit.clearance_mm();
    let aside = case.off * radial;
    for after_s in [COMES_S, RESTS_S] {
        t_s += after_s;
        keys.push(key(t_s, [aside, 0.0, 0.0], turn_deg));
    }
    let rested_s = t_s;
    let at = |deep: f64| {
        let upright = deep.min(LEANS_AT_MM);
        rested_s + (upright - fit.engaged_mm) / MM_PER_S + (deep - upright) / LEANING_MM_PER_S
    };
    let beyond = fit.height_mm + BEYOND_MM;
    let leaning = case.lean_mm.map_or(aside, |lean| radial + lean);
    for (deep, x) in [
        (LEANS_AT_MM, aside),
        (LEANS_AT_MM + LEANS_OVER_MM, leaning),
        (beyond, leaning),
    ] {
        keys.push(key(at(deep), [x, 0.0, fit.engaged_mm - deep], turn_deg));
    }
    let arrives = at(beyond);
    scenario.hand.keyframes = keys;
    scenario.depth = Some(Depth {
        fixed: "block".into(),
        axis: [0.0, 0.0, -1.0],
        through_mm: [0.0; 3],
    });
    scenario.run.duration_s = arrives + ENDS_S;
    scenario.run.telemetry_every_ticks = 1;
    scenario.run.heed_every_ticks = Some(HEED_TICKS);
    let mut set = |id: ParameterId, value: f32| scenario.parameters.insert(id.row().name.to_owned(), value);
    set(ParameterId::PointBudget, ParameterId::PointBudget.row().max);
    if let Some(stiffness) = case.stiffness_n_per_m {
        set(ParameterId::ContactStiffness, stiffness);
    }
    if case.explicit {
        set(ParameterId::Integrator, 1.0);
    }
    Ok(scenario)
}

/// Time at which the hand begins to lift the peg off the face, s from its start; 0 if it is not pressed there.
pub(super) fn lifted_s(scenario: &Scenario) -> f64 {
    let keys = &scenario.hand.keyframes;
    let lifts = keys
        .windows(2)
        .find(|pair| pair[0].offset_mm[2] < pair[1].offset_mm[2]);
    lifts.map_or(0.0, |pair| pair[0].t_s)
}

/// Time at which the hand begins its last way down, into the hole, s from its start.
pub(super) fn inserts_s(scenario: &Scenario) -> f64 {
    let keys = &scenario.hand.keyframes;
    let down = |pair: &[Key]| pair[0].offset_mm[2] > pair[1].offset_mm[2];
    let rests = (keys.windows(2)).rposition(|pair| !down(pair));
    rests.map_or(0.0, |place| keys[place + 1].t_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On the face the peg's overlap must surround its middle, or it tips; it must not hang over the block's edge, and must be pressed before it is moved.
    #[test]
    fn the_course_begins_on_the_face_and_leans_where_it_is_carried() {
        for peg_mm in PEGS_MM {
            let fit = fit(peg_mm, FROM_ABOVE.engaged_mm);
            // The line through both points in which the peg's outline crosses the hole's is the end of the overlap.
            let [hole, peg] = [0.5 * fit.hole_mm, 0.5 * fit.peg_mm];
            let ends = (hole * hole - peg * peg + BESIDE_MM * BESIDE_MM) / (2.0 * BESIDE_MM);
            assert!(ends + 10.0 < BESIDE_MM, "{peg_mm}: {ends}");
            assert!(BESIDE_MM + peg < 0.5 * fit.width_mm);
            // The grip is between the mouth and the peg's end.
            assert!(LEANS_AT_MM > 0.5 * fit.length_mm);
            let scenario = scenario(&fit, &FROM_ABOVE, Path::new("pair.step")).expect("sound");
            let keys = &scenario.hand.keyframes;
            assert!(keys.windows(2).all(|pair| pair[0].t_s < pair[1].t_s));
            assert_eq!(
                keys[3].offset_mm,
                [BESIDE_MM, 0.0, FROM_ABOVE.engaged_mm - PRESS_MM]
            );
            assert_eq!(lifted_s(&scenario), keys[3].t_s);
            assert_eq!(inserts_s(&scenario), keys[6].t_s);
            assert_eq!(keys[6].offset_mm, [0.25 * fit.clearance_mm(), 0.0, 0.0]);
            let lean = 0.5 * fit.clearance_mm() + 5.0;
            assert_eq!(keys.last().expect("keys").offset_mm, [lean, 0.0, -1030.0]);
        }
        let inside = Case {
            engaged_mm: 30.0,
            ..FROM_ABOVE
        };
        let fit = fit(PEGS_MM[1], inside.engaged_mm);
        let scenario = scenario(&fit, &inside, Path::new("pair.step")).expect("sound");
        assert_eq!(lifted_s(&scenario), 0.0);
        assert_eq!(scenario.hand.keyframes.len(), 6);
    }
}
