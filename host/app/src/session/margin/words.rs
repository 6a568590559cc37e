//! A margin in words.

use super::limits::{Limit, Margin, RESERVE};
use super::{Motion, Plane};
use crate::session::number::number;

/// Units of a motion: stiffness, damping.
pub const fn units(motion: Motion) -> [&'static str; 2] {
    match motion {
        Motion::Translation => ["N/m", "N·s/m"],
        Motion::Rotation => ["N·m/rad", "N·m·s/rad"],
    }
}

/// Name of a motion.
pub const fn name(motion: Motion) -> &'static str {
    match motion {
        Motion::Translation => "Translation",
        Motion::Rotation => "Rotation",
    }
}

/// By how much the stiffness may rise, and what ends it.
pub fn stiffness(plane: &Plane, margin: &Margin) -> String {
    let [unit, damping_unit] = units(plane.motion);
    let (now, most) = (number(margin.gains.stiffness), number(margin.stiffness));
    let why = match margin.by {
        Limit::Oscillation => "limited by oscillation of the sampled loop".to_owned(),
        Limit::Trembling => {
            "limited by trembling: dry friction no longer holds the handle between two counts".to_owned()
        }
        Limit::Board => "limited by what the board takes".to_owned(),
    };
    if margin.stiffness <= 0.0 {
        let damping = number(margin.gains.damping);
        return format!(
            "No stiffness is stable with a damping of {damping} {damping_unit}: it is {}",
            beside(plane, margin)
        );
    }
    let times = margin.times();
    if times >= 1.0 && times.is_finite() {
        let times = number(times);
        format!("Stiffness may rise by {times} times, from {now} to {most} {unit}; {why}")
    } else if times >= 1.0 {
        format!("Stiffness may rise from 0 to {most} {unit}; {why}")
    } else {
        format!(
            "Stiffness is {} times too high: {now} {unit}, at most {most}; {why}",
            number(1.0 / times)
        )
    }
}

/// Which damping would do, where the damping in use does not.
fn beside(plane: &Plane, margin: &Margin) -> &'static str {
    match plane.map.rows.iter().rfind(|row| row.stable > 0.0) {
        Some(row) if row.damping < margin.gains.damping => "too high",
        _ => "too low",
    }
}

/// Between which dampings this stiffness is stable.
pub fn damping(plane: &Plane, margin: &Margin) -> String {
    let [unit, damping_unit] = units(plane.motion);
    let now = number(margin.gains.stiffness);
    match margin.damping {
        Some([low, high]) => format!(
            "At {now} {unit} damping may be {} to {} {damping_unit}",
            number(low),
            number(high)
        ),
        None => format!("At {now} {unit} no damping that the board takes is stable"),
    }
}

/// Whether the loop is passive with any hand.
pub fn passivity(plane: &Plane, margin: &Margin) -> String {
    let [_, unit] = units(plane.motion);
    let (needed, has) = (
        number(margin.viscous_for_passivity),
        number(plane.handle.axis.viscous),
    );
    if margin.viscous_for_passivity <= plane.handle.axis.viscous {
        format!("Passive with any hand: takes {needed} of the handle's {has} {unit}")
    } else {
        format!(
            "Not passive with every hand: takes {needed} {unit} of the handle's own friction, which has {has}"
        )
    }
}

/// What the limits are computed from.
pub fn basis(plane: &Plane) -> String {
    let (handle, axis) = (&plane.handle, &plane.handle.axis);
    let (inertia, unit, friction, count) = match plane.motion {
        Motion::Translation => (
            format!("{} kg", number(axis.inertia)),
            "N·s/m",
            format!("{} N", number(handle.coulomb)),
            format!("{} µm", number(1e6 * handle.count)),
        ),
        Motion::Rotation => (
            format!("{} g·m²", number(1e3 * axis.inertia)),
            "N·m·s/rad",
            format!("{} mN·m", number(1e3 * handle.coulomb)),
            format!("{}°", number(handle.count.to_degrees())),
        ),
    };
    let late = match axis.delay {
        0 => "in time".to_owned(),
        1 => "1 tick late".to_owned(),
        ticks => format!("{ticks} ticks late"),
    };
    format!(
        "{inertia}, {} {unit} and {friction} of friction, counts of {count}, {} Hz, speed filtered by {} ms, force {late}",
        number(axis.viscous),
        number(1.0 / axis.period_s),
        number(1e3 * axis.filter_s),
    )
}

/// What a position scale does to the limits; `None` where it does nothing.
pub fn scaled(scale: f64) -> Option<String> {
    (scale != 1.0).then(|| {
        format!(
            "Seen through a position scale of {}: at the part it has its inertia and friction divided by {}",
            number(scale),
            number(scale * scale)
        )
    })
}

/// What the limits hold for.
pub fn class() -> String {
    format!(
        "By theory, with a reserve of {:.0} % for rounded readings, where the handle is lightest; for a part held near its middle that rests in contact, and a hand that damps, or none.",
        100.0 * (RESERVE - 1.0)
    )
}

#[cfg(test)]
mod tests {
    use super::super::{Limits, Subject};
    use super::*;
    use mortise_protocol::parameter::{PARAMETERS, ParameterId};
    use mortise_rig::{EXAMPLES, parse_rig};

    fn defaults() -> Vec<f32> {
        PARAMETERS.iter().map(|row| row.default).collect()
    }

    #[test]
    fn the_simulated_handle_trembles_before_it_oscillates() {
        let limits = Limits::new(&Subject::Simulated, 1.0).expect("limits");
        let [translation, rotation] = &limits.planes[..] else {
            panic!("two motions")
        };
        let margin = translation.margin(&defaults());
        let words = stiffness(translation, &margin);
        assert_eq!(
            words,
            "Stiffness may rise by 3.14 times, from 1000 to 3142 N/m; limited by trembling: dry friction no longer holds the handle between two counts"
        );
        assert_eq!(
            damping(translation, &margin),
            "At 1000 N/m damping may be 0 to 50 N·s/m"
        );
        assert!(
            basis(translation)
                .starts_with("0.15 kg, 1 N·s/m and 0.01 N of friction, counts of 5 µm, 1000 Hz")
        );
        let margin = rotation.margin(&defaults());
        assert!(stiffness(rotation, &margin).contains("N·m/rad; limited by trembling"));
    }

    /// The default damping of 20 N·s/m is too much for a light handle whose motors act a tick late, once stiffness rises.
    #[test]
    fn a_light_real_handle_oscillates_and_the_words_say_at_what() {
        let rig = parse_rig(EXAMPLES[0].1, "hapkit").expect("hapkit");
        let subject = Subject::Described {
            rig: Box::new(rig),
            real: true,
        };
        let limits = Limits::new(&subject, 1.0).expect("limits");
        let [plane] = &limits.planes[..] else {
            panic!("no torque")
        };
        let mut parameters = defaults();
        let margin = plane.margin(&parameters);
        let words = stiffness(plane, &margin);
        assert!(
            words.starts_with("Stiffness may rise by 1.")
                && words.ends_with("limited by oscillation of the sampled loop"),
            "{words}"
        );
        assert!(passivity(plane, &margin).starts_with("Not passive with every hand"));
        parameters[ParameterId::CouplingStiffness as usize] = 3000.0;
        let words = stiffness(plane, &plane.margin(&parameters));
        assert!(
            words.starts_with("Stiffness is 1.") && words.contains("times too high: 3000 N/m, at most 1"),
            "{words}"
        );
        parameters[ParameterId::CouplingDamping as usize] = 50.0;
        let words = stiffness(plane, &plane.margin(&parameters));
        assert_eq!(
            words,
            "No stiffness is stable with a damping of 50 N·s/m: it is too high"
        );
        parameters[ParameterId::CouplingStiffness as usize] = 0.0;
        parameters[ParameterId::CouplingDamping as usize] = 0.0;
        let margin = plane.margin(&parameters);
        assert!(stiffness(plane, &margin).starts_with("Stiffness may rise from 0 to "));
        assert!(passivity(plane, &margin).starts_with("Passive with any hand"));
    }
}
