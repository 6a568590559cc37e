//! A guide on a block with a hole and a peg: its messages, and its robustness against arbitrary telemetry.

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, Face, Frame, Mesh, Part, Shape, Surface};
use mortise_guide::{Guide, GuideSettings, Standing, When};
use mortise_mating::Axis;
use mortise_mating::recognise::{Target, TargetId, Turn, Way};
use mortise_protocol::message::{
    ConstraintKind, ConstraintTarget, PathTurn, Telemetry, ToDevice, TouchingPair, WirePose, WireWrench,
};
use proptest::prelude::*;

const HOLE_MM: f64 = 9.375;
const PEG_MM: f64 = 8.875;
/// Indices of block and peg in the image, which differ from those in the model.
const BLOCK: u16 = 1;
const PEG: u16 = 0;

/// A single cylinder wall from z = 0 to `length`.
fn wall(radius: f64, length: f64, inner: bool) -> Shape {
    let frame = Frame {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
    };
    let rim = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
    let vertices = (rim.iter().map(|&p| radius * p))
        .chain(rim.iter().map(|&p| radius * p + length * DVec3::Z))
        .collect();
    let side = |i: u32| [[i, (i + 1) % 4, i + 4], [(i + 1) % 4, (i + 1) % 4 + 4, i + 4]];
    Shape {
        faces: vec![Face {
            surface: Surface::Cylinder { frame, radius },
            fit_mm: None,
            reversed: inner,
            area_mm2: std::f64::consts::TAU * radius * length,
            edges: vec![],
            color: None,
        }],
        mesh: Mesh {
            vertices,
            triangles: (0..4).flat_map(side).collect(),
            triangle_face: vec![0; 8],
        },
        ..Shape::default()
    }
}

/// The block's hole reaches from z = −40 to 0.
fn model() -> CadModel {
    let part = |name: &str, shape, z: f64| Part {
        name: name.into(),
        path: vec![],
        shape,
        placement: DAffine3::from_translation(z * DVec3::Z),
        color: None,
    };
    CadModel {
        shapes: vec![wall(HOLE_MM, 40.0, true), wall(PEG_MM, 60.0, false)],
        parts: vec![part("block", 0, -40.0), part("peg", 1, 20.0)],
        ..CadModel::default()
    }
}

fn guide(model: &CadModel, when: When) -> Guide<'_> {
    let settings = GuideSettings {
        when,
        ..GuideSettings::default()
    };
    Guide::new(model, vec![1, 0], settings)
}

fn pose(position_mm: DVec3) -> WirePose {
    WirePose {
        position: (position_mm / 1e3).as_vec3().to_array(),
        orientation: DQuat::IDENTITY.as_quat().to_array(),
    }
}

/// A sample with the peg's end at height `z` and offset `x` from the axis, mm.
fn sample(tick: u32, x: f64, z: f64, touches: bool) -> Telemetry {
    let pair = TouchingPair {
        moving_face: 0,
        static_part: BLOCK,
        static_face: 0,
        count: 3,
        depth: 1e-6,
        point: [0.0; 3],
        moving_edge_face: u16::MAX,
        static_edge_face: u16::MAX,
        insertion: 0.0,
    };
    let place = pose(DVec3::new(x, 0.0, z));
    Telemetry {
        tick,
        handle: place,
        object: Some((PEG, place)),
        wrench: WireWrench::default(),
        contact: WireWrench::default(),
        hand: None,
        cost: 0,
        points: 0,
        flags: 0,
        missed: 0,
        dropped: 0,
        guidance: Default::default(),
        pairs: touches.then_some(pair).into_iter().collect(),
    }
}

fn let_go(tick: u32) -> Telemetry {
    Telemetry {
        object: None,
        ..sample(tick, 0.0, 20.0, false)
    }
}

fn targets(messages: &[ToDevice]) -> Vec<&ConstraintTarget> {
    fn target(message: &ToDevice) -> Option<&ConstraintTarget> {
        match message {
            ToDevice::SetTarget(target) => Some(target),
            _ => None,
        }
    }
    messages.iter().filter_map(target).collect()
}

#[test]
fn touch_sends_a_target_that_is_refreshed_before_it_expires_and_cleared_when_far() {
    let model = model();
    let mut guide = guide(&model, When::Touching);
    assert_eq!(guide.hear(&sample(0, 0.5, -10.0, false)), []);
    let first = guide.hear(&sample(16, 0.5, -10.0, true));
    let [target] = targets(&first)[..] else {
        panic!("one target: {first:?}")
    };
    assert_eq!(target.kind, ConstraintKind::Concentric);
    assert_eq!(target.static_part, BLOCK, "as the image counts");
    assert_eq!(target.faces.as_slice(), [(0, 0)]);
    let (id, expiry) = (target.id, u32::from(target.expiry_ticks));
    // Guided off the wall, the peg touches nothing and stays guided; each gap in telemetry is shorter than the expiry.
    let (mut heard, mut sequence) = (16, target.sequence);
    for tick in (32..2000).step_by(16) {
        for target in targets(&guide.hear(&sample(tick, 0.0, -10.0, false))) {
            assert!(tick - heard < expiry && target.id == id && target.sequence > sequence);
            (heard, sequence) = (tick, target.sequence);
        }
    }
    assert!(2000 - heard < expiry);
    let list = guide.list();
    assert_eq!(list.rows.len(), 1);
    let row = &list.rows[0];
    assert_eq!(
        (row.target.kind, &row.standing),
        (ConstraintKind::Concentric, &Standing::Sent)
    );
    // The peg's end is 10 mm deep in the hole.
    assert!((row.inside_mm.expect("along an axis") - 10.0).abs() < 1e-4);
    assert_eq!(list.freedom.count(), 2);
    let cleared = guide.hear(&sample(2016, 6.0, -10.0, false));
    assert_eq!(cleared, [ToDevice::ClearTarget { id }], "6 mm is another place");
    assert_eq!(guide.list().rows[0].standing, Standing::Candidate);
    guide.hear(&sample(2032, 15.0, -10.0, false));
    assert_eq!(guide.list().rows, [], "at 15 mm it is not listed");
}

#[test]
fn what_is_switched_off_stays_off_also_when_the_part_was_let_go() {
    let model = model();
    let mut guide = guide(&model, When::Touching);
    let id = targets(&guide.hear(&sample(0, 0.5, -10.0, true)))[0].id;
    let row = guide.list().rows[0].target.id;
    assert!(guide.recogniser().switch_off(row, true));
    assert_eq!(
        guide.hear(&sample(16, 0.5, -10.0, true)),
        [ToDevice::ClearTarget { id }]
    );
    assert_eq!(guide.list().rows[0].standing, Standing::Off);
    guide.hear(&let_go(32));
    assert_eq!(guide.list().rows, []);
    assert!(
        !guide.recogniser().switch_off(row, false),
        "nothing is in the list"
    );
    assert_eq!(guide.hear(&sample(48, 0.5, -10.0, true)), []);
    assert_eq!(guide.list().rows[0].standing, Standing::Off);
    assert!(guide.recogniser().switch_off(row, false));
    assert_eq!(targets(&guide.hear(&sample(64, 0.5, -10.0, true))).len(), 1);
}

#[test]
fn near_takes_up_what_stands_before_its_hole_and_touching_does_not() {
    let model = model();
    for (gap, near) in [(1.0, true), (3.0, false)] {
        for when in When::ALL {
            let mut guide = guide(&model, when);
            let sent = guide.hear(&sample(0, 1.0, gap, false));
            let expected = usize::from(near && when == When::Near);
            assert_eq!(targets(&sent).len(), expected, "{gap} mm in front, {when:?}");
        }
    }
    // The setting may change while a part is held.
    let mut guide = guide(&model, When::Touching);
    assert_eq!(guide.hear(&sample(0, 1.0, 1.0, false)), []);
    guide.set(GuideSettings {
        when: When::Near,
        ..GuideSettings::default()
    });
    assert_eq!(targets(&guide.hear(&sample(16, 1.0, 1.0, false))).len(), 1);
}

#[test]
fn switched_off_altogether_it_recognises_and_sends_nothing() {
    let model = model();
    let mut guide = guide(&model, When::Touching);
    let id = targets(&guide.hear(&sample(0, 0.5, -10.0, true)))[0].id;
    let silent = GuideSettings {
        sending: false,
        ..GuideSettings::default()
    };
    guide.set(silent);
    assert_eq!(
        guide.hear(&sample(16, 0.5, -10.0, true)),
        [ToDevice::ClearTarget { id }]
    );
    assert_eq!(guide.list().rows[0].standing, Standing::Waiting);
    guide.set(GuideSettings::default());
    assert_eq!(targets(&guide.hear(&sample(32, 0.5, -10.0, true))).len(), 1);
    assert_eq!(guide.list().rows[0].standing, Standing::Sent);
}

/// The way of the peg down into the hole, whose end is `z` above the hole's lower end, `x` off its axis.
fn way(turn: Turn, x: f64, z: f64) -> Target {
    let down = |origin: DVec3| Axis {
        origin,
        direction: -DVec3::Z,
    };
    Target {
        id: TargetId {
            moving_part: 1,
            fixed_part: 0,
            surfaces: None,
        },
        kind: ConstraintKind::Path,
        moving: down(DVec3::ZERO),
        fixed: down(DVec3::new(x, 0.0, z)),
        play_mm: 0.5,
        radius_mm: 0.0,
        inner_moves: true,
        moving_faces: vec![0],
        fixed_faces: vec![0],
        way: Some(Way {
            orientation: DQuat::IDENTITY,
            turn,
            length_mm: 40.0,
            ends: true,
            sliding: vec![[0, 0]],
        }),
    }
}

fn kinds(messages: &[ToDevice]) -> Vec<ConstraintKind> {
    targets(messages).iter().map(|target| target.kind).collect()
}

#[test]
fn a_way_is_followed_with_recognition_off_on_contact_or_when_near() {
    let model = model();
    for when in When::ALL {
        let mut guide = guide(&model, when);
        guide.set(GuideSettings {
            when,
            recognising: false,
            ..GuideSettings::default()
        });
        guide.follow(vec![way(Turn::Geared(0.0), 0.0, 0.0)]);
        assert_eq!(guide.hear(&sample(0, 0.5, 5.0, false)), [], "5 mm in front");
        let in_front = guide.hear(&sample(16, 0.5, 1.0, false));
        assert_eq!(targets(&in_front).len(), usize::from(when == When::Near));
        let sent = match when {
            When::Near => in_front,
            When::Touching => guide.hear(&sample(32, 0.5, 0.0, true)),
        };
        let [target] = targets(&sent)[..] else {
            panic!("one target: {sent:?}")
        };
        assert_eq!((target.kind, target.static_part), (ConstraintKind::Path, BLOCK));
        let path = target.path.expect("of a path");
        assert_eq!(path.turn, PathTurn::Geared(0.0));
        assert!(path.ends && target.faces.as_slice() == [(0, 0)]);
        // Off the walls it touches nothing, and stays guided.
        for tick in (48..600).step_by(16) {
            let messages = guide.hear(&sample(tick, 0.0, -10.0, false));
            assert!(
                messages.iter().all(|m| matches!(m, ToDevice::SetTarget(_))),
                "{messages:?}"
            );
        }
        assert_eq!(guide.list().rows.len(), 1);
        assert_eq!(guide.list().rows[0].standing, Standing::Sent);
        let id = target.id;
        guide.follow(Vec::new());
        let cleared: Vec<ToDevice> = (600..2000)
            .step_by(16)
            .flat_map(|tick| guide.hear(&sample(tick, 0.0, -10.0, false)))
            .filter(|message| *message == ToDevice::ClearTarget { id })
            .collect();
        assert_eq!(cleared.len(), 1, "no longer followed");
    }
}

/// At the end of a screw whose part is turned as the fit asks; a turn later along the way it is aligned again, and between it is not.
#[test]
fn a_screw_is_aligned_where_its_turn_agrees_with_the_travel() {
    let model = model();
    let pitch_mm = 8.0;
    for (short_mm, aligned) in [(0.0, true), (8.0, true), (4.0, false)] {
        let mut guide = guide(&model, When::Touching);
        guide.set(GuideSettings {
            recognising: false,
            ..GuideSettings::default()
        });
        let turn = Turn::Geared(std::f64::consts::TAU / pitch_mm);
        guide.follow(vec![way(turn, 0.0, 10.0)]);
        // The way ends with the peg's end at −30.
        let sent = guide.hear(&sample(0, 0.2, -30.0 + short_mm, true));
        assert_eq!(targets(&sent).len(), usize::from(aligned), "{short_mm} mm short");
        if let [target] = targets(&sent)[..] {
            let turn = target.path.map(|path| path.turn);
            assert_eq!(
                turn,
                Some(PathTurn::Geared((1e3 * std::f64::consts::TAU / pitch_mm) as f32))
            );
        }
    }
}

/// A round peg that may turn needs no more than the axis; one that must not turn is held by both.
#[test]
fn a_way_guides_only_where_it_holds_more_than_recognised_surfaces() {
    let model = model();
    use ConstraintKind::{Concentric, Path};
    for (turn, expected) in [
        (Turn::Free, vec![Concentric]),
        (Turn::Geared(0.0), vec![Concentric, Path]),
    ] {
        let mut guide = guide(&model, When::Touching);
        guide.follow(vec![way(turn, 0.0, 0.0)]);
        let sent = guide.hear(&sample(0, 0.5, -10.0, true));
        assert_eq!(kinds(&sent), expected, "{turn:?}");
        assert_eq!(guide.list().rows.len(), expected.len());
        assert_eq!(guide.list().freedom.count(), 3 - expected.len());
    }
}

#[test]
fn of_several_places_the_nearest_guides_and_another_choice_goes_to_the_board_at_once() {
    let model = model();
    let mut guide = guide(&model, When::Touching);
    guide.set(GuideSettings {
        recognising: false,
        ..GuideSettings::default()
    });
    let places = [0.0, 2.0].map(|x| way(Turn::Geared(0.0), x, 0.0));
    guide.follow(places.to_vec());
    let sent = guide.hear(&sample(0, 1.7, -10.0, true));
    let [first] = targets(&sent)[..] else {
        panic!("one target: {sent:?}")
    };
    assert_eq!(first.fixed.point[0], 2e-3);
    // It stays with what guides, although the other is nearer now.
    assert_eq!(targets(&guide.hear(&sample(16, 0.4, -10.0, true))).len(), 0);
    guide.follow(vec![way(Turn::Geared(0.0), 0.0, 5.0)]);
    let sent = guide.hear(&sample(32, 0.4, -10.0, true));
    let [second] = targets(&sent)[..] else {
        panic!("one target: {sent:?}")
    };
    assert_eq!((second.id, second.fixed.point), (first.id, [0.0, 0.0, 5e-3]));
}

#[test]
fn another_cap_goes_to_the_board_at_once_and_its_refusal_is_reported() {
    let model = model();
    let mut guide = guide(&model, When::Touching);
    guide.hear(&sample(0, 0.5, -10.0, true));
    guide.set(GuideSettings {
        force_cap_n: 1.0,
        ..GuideSettings::default()
    });
    let sent = guide.hear(&sample(16, 0.5, -10.0, true));
    let [target] = targets(&sent)[..] else {
        panic!("sent again: {sent:?}")
    };
    assert_eq!(target.force_cap, 1.0);
    guide.answered(target.id, Err("busy".into()));
    guide.answered(target.id.wrapping_add(7), Err("of no one".into()));
    assert_eq!(guide.list().rows[0].standing, Standing::Refused("busy".into()));
    guide.answered(target.id, Ok(()));
    assert_eq!(guide.list().rows[0].standing, Standing::Sent);
}

proptest! {
    /// Parts and faces that do not exist, and invalid poses: no message names them, and nothing fails.
    #[test]
    fn odd_telemetry_does_no_harm(
        held in any::<u16>(),
        position in any::<[f32; 3]>(),
        orientation in any::<[f32; 4]>(),
        pairs in proptest::collection::vec(any::<(u16, u16, u16, f32)>(), 0..8),
        near in any::<bool>(),
        known in any::<bool>(),
    ) {
        let model = model();
        let when = if near { When::Near } else { When::Touching };
        let mut guide = guide(&model, when);
        let odd = WirePose { position, orientation };
        for tick in 0..3 {
            let mut sample = sample(tick, 0.0, -10.0, false);
            sample.object = Some((if known { PEG } else { held }, odd));
            for &(moving_face, static_part, static_face, depth) in &pairs {
                let pair = TouchingPair { moving_face, static_part, static_face, moving_edge_face: u16::MAX, static_edge_face: u16::MAX, count: 1, depth, point: position, insertion: 0.0 };
                let _ = sample.pairs.push(pair);
            }
            for target in targets(&guide.hear(&sample)) {
                prop_assert!(target.static_part <= BLOCK);
                prop_assert!(target.moving.point.iter().all(|x| x.is_finite()));
            }
            guide.list();
        }
    }
}
