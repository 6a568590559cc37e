//! Flats on flats with bores in line: the motor's covers on its body, from where the exploded file has them and from any place.

use crate::support;
use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::CadModel;
use mortise_words::{Outcome, Session};

const COVERS: [&str; 2] = ["back-cover", "front-cover"];

fn number(model: &CadModel, name: &str) -> usize {
    model
        .parts
        .iter()
        .position(|part| part.name == name)
        .expect("a part of the motor")
}

/// Places of the covers against the body.
fn places(parts: &[mortise_brep::Part]) -> Vec<DAffine3> {
    let place = |name: &str| {
        parts
            .iter()
            .find(|part| part.name == name)
            .expect("a part of the motor")
            .placement
    };
    COVERS
        .map(|cover| place("body").inverse() * place(cover))
        .to_vec()
}

#[test]
fn covers_come_to_their_designed_places() {
    let (Some(exploded), Some(designed)) = (
        support::motor("motor_exploded.step"),
        support::motor("motor_flat.step"),
    ) else {
        return;
    };
    let mut session = Session::new(exploded).expect("an assembly");
    for cover in ["back", "front"] {
        let turn = session.say(&format!("put the {cover} cover onto the body"));
        assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
    }
    let far = (places(session.parts()).iter().zip(places(&designed.parts)))
        .flat_map(|(found, wanted)| {
            [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| {
                found
                    .transform_point3(60.0 * p)
                    .distance(wanted.transform_point3(60.0 * p))
            })
        })
        .fold(0.0, f64::max);
    assert!(far < 1e-3, "{far} mm");
    // Undone by the same words as what the file has together.
    let turn = session.say("take off the front cover");
    assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
}

#[test]
fn from_any_place_flats_meet_and_bores_are_in_line() {
    let Some(model) = support::motor("motor_exploded.step") else {
        return;
    };
    let mut random = fastrand::Rng::with_seed(11);
    for _ in 0..6 {
        let mut model = model.clone();
        let (cover, body) = (number(&model, COVERS[0]), number(&model, "body"));
        let mut any = || 2.0 * random.f64() - 1.0;
        let turn = DQuat::from_xyzw(any(), any(), any(), any()).normalize();
        let at = DVec3::new(any(), any(), any()) * 200.0 + DVec3::new(900.0, 0.0, 0.0);
        model.parts[cover].placement = DAffine3::from_rotation_translation(turn, at);
        let mut session = Session::new(model).expect("an assembly");
        let turn = session.say("put the back cover onto the body");
        assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
        assert!(session.world().flange(cover, body).is_some());
        assert!(session.world().blocker(cover).is_none());
    }
}

/// A cover brings along the bearing and the seal that are in it.
#[test]
fn what_is_in_a_cover_comes_along() {
    let Some(exploded) = support::motor("motor_exploded.step") else {
        return;
    };
    let mut session = Session::new(exploded).expect("an assembly");
    let place = |session: &Session, name: &str| {
        let part = session.parts().iter().find(|part| part.name == name);
        part.expect("a part of the motor").placement
    };
    for words in [
        "insert the front bearing into the front cover",
        "insert the seal into the front cover",
    ] {
        let turn = session.say(words);
        assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
    }
    let within =
        |session: &Session, name: &str| place(session, "front-cover").inverse() * place(session, name);
    let before = ["bearing-front", "seal"].map(|name| within(&session, name));
    let turn = session.say("put the front cover onto the body");
    assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
    assert_eq!(turn.moved.len(), 3, "{turn:?}");
    for (name, before) in ["bearing-front", "seal"].into_iter().zip(before) {
        assert!(within(&session, name).abs_diff_eq(before, 1e-9), "{name}");
    }
    let turn = session.say("undo");
    assert_eq!((turn.outcome, turn.moved.len()), (Outcome::Done, 3), "{turn:?}");
}
