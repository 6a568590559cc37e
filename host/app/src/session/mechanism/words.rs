//! What the picture of a mechanism shows, in words.

use super::Mechanism;
use super::links::Skeleton;

/// Extents below this are one place, mm.
const ONE_PLACE: f64 = 0.05;

/// The reach in numbers.
pub fn reach(mechanism: &Mechanism) -> String {
    let extents = ["x", "y", "z"].into_iter().zip(mechanism.reach.world);
    let each: Vec<String> = extents
        .map(|(axis, [low, high])| match high - low < ONE_PLACE {
            true => format!("{axis} at {} mm", number(0.5 * (low + high))),
            false => format!("{axis} from {} to {} mm", number(low), number(high)),
        })
        .collect();
    format!("The handle reaches {}", each.join(", "))
}

/// Where the drawn handle is.
pub fn place(skeleton: &Skeleton) -> String {
    match skeleton.in_world {
        None => "At these angles the links do not reach each other".to_owned(),
        Some(at) => {
            let force = match skeleton.share {
                share if share >= 1.0 => String::new(),
                share if share > 0.0 => {
                    format!("; near a singular posture, force fades to {:.0} %", 100.0 * share)
                }
                _ => "; in a singular posture, no force".to_owned(),
            };
            let [x, y, z] = at.to_array().map(number);
            format!("Handle at x {x}, y {y}, z {z} mm{force}")
        }
    }
}

/// What else the picture does not show.
pub fn remarks(mechanism: &Mechanism) -> Option<String> {
    let wrist = "The three axes of the wrist turn the handle where it is, without limits";
    let gaps = "Within the joints' ranges there are angles at which the links do not reach each other";
    let both: Vec<&str> = [
        (mechanism.links.has_wrist(), wrist),
        (mechanism.reach.has_gaps, gaps),
    ]
    .into_iter()
    .filter_map(|(holds, words)| holds.then_some(words))
    .collect();
    (!both.is_empty()).then(|| both.join(". "))
}

/// A length or an angle with a decimal.
pub fn number(value: f64) -> String {
    let text = format!("{value:.1}");
    let short = text.strip_suffix(".0").unwrap_or(&text);
    match short {
        "-0" => "0".to_owned(),
        _ => short.replace('-', "−"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::links::tests::{example, loose};
    use super::*;

    #[test]
    fn the_reach_of_an_example_in_words() {
        let paddle = Mechanism::new(&example(0)).expect("a mechanism");
        assert_eq!(
            reach(&paddle),
            "The handle reaches x from −42.2 to 42.2 mm, y from −15.4 to 0 mm, z at 0 mm"
        );
        let skeleton = paddle.links.skeleton(paddle.links.home());
        assert_eq!(place(&skeleton), "Handle at x 0, y 0, z 0 mm");
        assert_eq!(remarks(&paddle), None);
        let polhem = Mechanism::new(&example(3)).expect("a mechanism");
        assert!(remarks(&polhem).expect("a wrist").contains("wrist"));
    }

    #[test]
    fn links_that_do_not_reach_each_other_are_said() {
        let loose = Mechanism::new(&loose()).expect("a mechanism");
        let skeleton = loose.links.skeleton([core::f64::consts::PI, 0.0, 0.0]);
        assert_eq!(
            place(&skeleton),
            "At these angles the links do not reach each other"
        );
        assert_eq!(skeleton.links.len(), 2);
        assert!(
            remarks(&loose)
                .expect("a remark")
                .contains("do not reach each other")
        );
    }
}
