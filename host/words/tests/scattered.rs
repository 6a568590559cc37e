//! The motor from its parts scattered: magnets laid on flats, and everything put together by words.

use crate::support;
use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::Part;
use mortise_words::{Code, Outcome, Session};

fn part<'a>(parts: &'a [Part], name: &str) -> &'a Part {
    let found = parts.iter().find(|part| part.name == name);
    found.expect("a part of the motor")
}

/// Place of a part against another.
fn against(parts: &[Part], name: &str, base: &str) -> DAffine3 {
    part(parts, base).placement.inverse() * part(parts, name).placement
}

/// Farthest of a part's points within 20 mm of its origin from where it is elsewhere, mm.
fn off(a: DAffine3, b: DAffine3) -> f64 {
    [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
        .map(|p| {
            a.transform_point3(20.0 * p)
                .distance(b.transform_point3(20.0 * p))
        })
        .into_iter()
        .fold(0.0, f64::max)
}

/// Wherever the rotor stands and however a magnet is turned, the magnet lies on the middle of a side, with its edges along the side's: at one of the places the design has, or turned about them by
/// half a turn or upside down.
#[test]
fn a_magnet_comes_to_the_middle_of_a_side() {
    let (Some(exploded), Some(designed)) = (
        support::motor("motor_exploded.step"),
        support::motor("motor_flat.step"),
    ) else {
        return;
    };
    let mut random = fastrand::Rng::with_seed(5);
    for _ in 0..12 {
        let mut model = exploded.clone();
        let mut any = || 2.0 * random.f64() - 1.0;
        for name in ["magnet-1", "rotor-back"] {
            let turn = DQuat::from_xyzw(any(), any(), any(), any()).normalize();
            let at = DVec3::new(any(), any(), any()) * 100.0 + DVec3::new(700.0, 0.0, 0.0);
            let index = model.parts.iter().position(|part| part.name == name).unwrap();
            let far = if name == "magnet-1" { 300.0 } else { 0.0 };
            model.parts[index].placement = DAffine3::from_rotation_translation(turn, at + far * DVec3::X);
        }
        let mut session = Session::new(model).unwrap();
        let turn = session.say("put magnet 1 onto the rear rotor");
        assert_eq!(turn.outcome, Outcome::Done, "{turn:?}");
        let parts = session.parts();
        // The middle of the magnet, as its box has it.
        let shape = |parts: &[Part]| parts.iter().position(|part| part.name == "magnet-1").unwrap();
        let (low, high) = session.world().assembly().body(shape(parts)).bounds();
        let middle = (low + high) / 2.0;
        let here = against(parts, "magnet-1", "rotor-back").transform_point3(middle);
        let places = [1, 2, 3, 4]
            .map(|n| against(&designed.parts, &format!("magnet-{n}"), "rotor-back").transform_point3(middle));
        let nearest = places
            .iter()
            .map(|p| p.distance(here))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-6, "{here} {places:?}");
        // Held there: it goes where the rotor goes.
        let before = against(parts, "magnet-1", "rotor-back");
        let turn = session.say("put the rear rotor onto the axle");
        assert_eq!((turn.outcome, turn.moved.len()), (Outcome::Done, 2), "{turn:?}");
        assert!(off(against(session.parts(), "magnet-1", "rotor-back"), before) < 1e-6);
    }
}

/// Flats alone state no place on a much larger flat, none of a part that is to go inside, and none beside shafts and bores that fit.
#[test]
fn flats_do_not_stand_in_for_other_places() {
    let Some(exploded) = support::motor("motor_exploded.step") else {
        return;
    };
    let mut session = Session::new(exploded).unwrap();
    for words in [
        "put magnet 1 onto the axle",
        "put magnet 1 onto the body",
        "put the rear rotor onto the body",
        "put the seal onto the stator",
        "put the magnets into the rear rotor",
    ] {
        let turn = session.say(words);
        assert_eq!(turn.outcome, Outcome::Refuse, "{words}: {turn:?}");
        assert_eq!(
            turn.reason.map(|reason| reason.code),
            Some(Code::NoFit),
            "{words}"
        );
        assert!(turn.moved.is_empty());
    }
}

/// By words, with amounts where no surface states how far, every part comes to its designed place within a micrometre.
#[test]
fn all_parts_come_to_their_designed_places() {
    let (Some(exploded), Some(designed)) = (
        support::motor("motor_exploded.step"),
        support::motor("motor_flat.step"),
    ) else {
        return;
    };
    let mut session = Session::new(exploded).unwrap();
    for words in [
        "insert the stator into the body",
        "insert the rear bearing into the rear cover",
        "put the rear cover onto the body",
        "put the rear rotor onto the axle",
        "move the rear rotor down by 8.5 mm",
        "put the magnets onto the rear rotor",
        "put the front rotor onto the axle from above",
        "insert the front bearing into the front cover",
        "pull the front bearing out by 1 mm",
        "insert the seal into the front cover",
        "pull the seal out by 1 mm",
        "insert the axle into the front bearing from below",
        "put the front cover onto the body",
        "put all four screws into the front cover",
    ] {
        let turn = session.say(words);
        assert_eq!(turn.outcome, Outcome::Done, "{words}: {turn:?}");
    }
    for of in &designed.parts {
        let (now, wanted) = (
            against(session.parts(), &of.name, "body"),
            against(&designed.parts, &of.name, "body"),
        );
        assert!(off(now, wanted) < 1e-3, "{}: {} mm", of.name, off(now, wanted));
    }
}
