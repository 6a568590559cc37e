//! Guidance through the window without a display: targets appear automatically, one is switched off and on, STOP ends guidance.

use std::path::Path;
use std::time::Duration;

use crate::common::{arm, click, connect, harness, holding, open_sample, until, worst};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use mortise::session::notes::Severity;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::compose::{Look, compose};
use mortise_guide::{GuideSettings, List, Row, Standing, When};
use mortise_mating::Axis;
use mortise_mating::recognise::{AlignmentError, Freedom, Target, TargetId};
use mortise_protocol::message::{ConstraintKind, DeviceState, Telemetry, TouchingPair};
use mortise_protocol::parameter::ParameterId;

fn row(session: &Session) -> Option<&Row> {
    (session.guidance.rows.iter()).find(|row| row.target.kind == ConstraintKind::Concentric)
}

fn stands(session: &Session, standing: &Standing) -> bool {
    row(session).is_some_and(|row| row.standing == *standing)
}

fn guided(session: &Session) -> u8 {
    session.telemetry.as_ref().map_or(0, |t| t.guidance.active)
}

#[test]
fn targets_appear_by_themselves_can_be_switched_off_and_end_with_stop() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    click(&mut harness, "Play insertion");
    // At the end the hand pushes the peg against the wall: the contact is recognised, and the target is sent and held by the board.
    until(&mut harness, "the peg is guided", |s| {
        stands(s, &Standing::Sent) && guided(s) == 1
    });
    let session = &harness.state().session;
    let found = row(session).expect("sent");
    assert_eq!((found.target.id.moving_part, found.target.id.fixed_part), (1, 0));
    assert!((2.0 * found.target.play_mm - 1.0).abs() < 1e-9, "1 mm clearance");
    assert_eq!(session.guidance.freedom.count(), 2, "it slides and turns");
    harness.get_by_label_contains("slides and turns about one axis (z)");
    harness.get_by_label_contains("shaft Ø 17.750 in hole Ø 18.750");
    until(&mut harness, "it is on the axis", |s| {
        row(s).is_some_and(|row| row.alignment_error.distance_mm < 0.01)
    });

    let switch = |harness: &mut Harness<'_, Window>, on: &str| {
        choose(harness, &format!("Switch {on} Concentric: peg in block"));
    };
    switch(&mut harness, "off");
    until(&mut harness, "switched off", |s| {
        stands(s, &Standing::Off) && guided(s) == 0
    });
    // With the target off, the hand's push moves the peg to the wall: half the clearance away.
    until(&mut harness, "it is at the wall", |s| {
        row(s).is_some_and(|row| row.alignment_error.distance_mm > 0.3)
    });
    switch(&mut harness, "on");
    until(&mut harness, "guided again", |s| {
        stands(s, &Standing::Sent) && guided(s) == 1
    });

    choose(&mut harness, "Pin Concentric: peg in block");
    until(&mut harness, "pinned", |s| row(s).is_some_and(|row| row.pinned));

    assert!(worst(&harness.state().session) < Severity::Warning);
    click(&mut harness, "STOP");
    until(&mut harness, "stopped", |s| {
        s.device() == Some(DeviceState::Stopped) && s.guidance.rows.is_empty()
    });
}

/// Scrolls to a control if necessary, and clicks it.
fn choose(harness: &mut Harness<'_, Window>, label: &str) {
    harness.get_by_label(label).scroll_to_me();
    for _ in 0..20 {
        harness.step();
    }
    click(harness, label);
}

#[test]
fn guidance_off_and_on_while_running() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    click(&mut harness, "Play insertion");
    until(&mut harness, "guided", |s| guided(s) == 1);
    let act = |harness: &mut Harness<'_, Window>, value| {
        let intent = Intent::SetParameter(ParameterId::Guidance, value);
        harness.state_mut().session.act(intent);
    };
    act(&mut harness, 0.0);
    until(&mut harness, "off: recognised, not sent", |s| {
        stands(s, &Standing::Waiting) && guided(s) == 0
    });
    act(&mut harness, 2.0);
    until(&mut harness, "the thesis' blend", |s| {
        stands(s, &Standing::Sent) && guided(s) == 1
    });
    let session = &mut harness.state_mut().session;
    session.act(Intent::GuideCap(1e9));
    assert!(session.guide.force_cap_n <= 8.0);
    session.act(Intent::GuideCap(f32::NAN));
    assert!(session.guide.force_cap_n.is_finite());
    assert!(worst(&harness.state().session) < Severity::Warning);
}

#[test]
fn near_guides_before_anything_touches() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    harness.state_mut().session.act(Intent::GuideWhen(When::Near));
    click(&mut harness, "Play insertion");
    until(&mut harness, "guided from before the hole", |s| {
        stands(s, &Standing::Sent)
    });
    let session = &harness.state().session;
    let inside = row(session).and_then(|row| row.inside_mm).expect("along an axis");
    assert!(inside < 10.0, "not only at the bottom: {inside} mm in");
}

#[test]
fn without_telemetry_or_with_parts_that_are_not_there_nothing_breaks() {
    let mut harness = harness();
    open_sample(&mut harness);
    let unknown = TargetId {
        moving_part: 7,
        fixed_part: 8,
        surfaces: Some([99, 99]),
    };
    let session = &harness.state().session;
    for intent in [
        Intent::PinTarget(unknown, true),
        Intent::SwitchTargetOff(unknown, true),
    ] {
        let reason = obstacle(session, &intent).expect("no rig");
        assert!(reason.len() > 5);
    }
    connect(&mut harness);
    arm(&mut harness);
    click(&mut harness, "peg");
    click(&mut harness, "Grab");
    until(&mut harness, "the peg is held", |s| s.grabbed() == Some(1));
    let session = &mut harness.state_mut().session;
    assert!(obstacle(session, &Intent::SwitchTargetOff(unknown, true)).is_some());

    // A list and touching pairs that belong to another assembly.
    let mut telemetry: Box<Telemetry> = session.telemetry.clone().expect("in hand");
    let pair = TouchingPair {
        moving_face: u16::MAX,
        static_part: 400,
        static_face: 4000,
        count: 0,
        depth: f32::NAN,
        point: [f32::INFINITY; 3],
        moving_edge_face: u16::MAX,
        static_edge_face: u16::MAX,
        insertion: 0.0,
    };
    let at_edges = TouchingPair {
        moving_face: 2,
        moving_edge_face: 0,
        static_part: 0,
        static_face: 3,
        static_edge_face: 5,
        ..pair
    };
    telemetry.pairs.clear();
    for pair in [pair, at_edges, at_edges] {
        telemetry.pairs.push(pair).expect("room");
    }
    session.telemetry = Some(telemetry);
    let document = session.document.as_ref().expect("the sample");
    let items = compose(session, document, &Look::default()).items;
    assert_eq!(items[1].lit_edges, [[0, 2]], "the touching edge of the held part");
    assert_eq!(items[0].lit_edges, [[3, 5]], "and that of the other");
    let mut odd = List {
        held: Some(1),
        freedom: Freedom::default(),
        ..List::default()
    };
    for standing in [
        Standing::Conflict(vec![unknown]),
        Standing::Conflict(vec![]),
        Standing::Refused("no".into()),
        Standing::Candidate,
        Standing::Sent,
    ] {
        odd.rows.push(Row {
            target: Target {
                id: unknown,
                kind: ConstraintKind::Concentric,
                moving: axis(),
                fixed: axis(),
                play_mm: f64::NAN,
                radius_mm: f64::INFINITY,
                inner_moves: true,
                moving_faces: vec![],
                fixed_faces: vec![u32::MAX],
                way: None,
            },
            standing,
            alignment_error: AlignmentError {
                distance_mm: f64::NAN,
                angle_rad: f64::NAN,
            },
            depth_mm: 0.0,
            inside_mm: None,
            pinned: true,
        });
    }
    session.guidance = odd;
    let document = session.document.as_ref().expect("open");
    let look = Look {
        see_through: true,
        ..Look::default()
    };
    let picture = compose(session, document, &look);
    assert!(picture.items.iter().all(|item| item.mates.is_empty()));
    harness.step();

    // A lost link clears the list.
    harness.state_mut().session.act(Intent::Disconnect);
    until(&mut harness, "disconnected", |s| s.connection().is_none());
    std::thread::sleep(Duration::from_millis(50));
    harness.step();
    let session = &harness.state().session;
    assert_eq!(session.guidance, List::default());
    assert_eq!(session.guide, GuideSettings::default());
}

/// Of two targets that contradict each other the later one names the other, where it is listed.
#[test]
fn a_target_in_conflict_names_the_other() {
    let mut harness = holding();
    let row = |radius_mm: f64, surface: usize, standing: Standing| Row {
        target: Target {
            id: TargetId {
                moving_part: 1,
                fixed_part: 0,
                surfaces: Some([0, surface]),
            },
            kind: ConstraintKind::Concentric,
            moving: axis(),
            fixed: axis(),
            play_mm: 0.1,
            radius_mm,
            inner_moves: true,
            moving_faces: vec![0],
            fixed_faces: vec![0],
            way: None,
        },
        standing,
        alignment_error: AlignmentError {
            distance_mm: 0.0,
            angle_rad: 0.0,
        },
        depth_mm: 0.0,
        inside_mm: None,
        pinned: false,
    };
    let first = row(6.0, 0, Standing::Sent);
    let other = row(4.0, 1, Standing::Conflict(vec![first.target.id]));
    let session = &mut harness.state_mut().session;
    session.guidance = List {
        held: Some(1),
        rows: vec![first, other],
        ..List::default()
    };
    // Drawn at once: the guidance thread replaces the list.
    harness.step();
    let named = harness.query_all_by_label_contains("Contradicts “Concentric: peg in block”");
    assert!(named.count() > 0);
}

fn axis() -> Axis {
    Axis {
        origin: DVec3::ZERO,
        direction: DVec3::Z,
    }
}

#[test]
fn two_pins_in_two_holes_are_two_targets_and_leave_a_slide() {
    let mut harness = harness();
    harness.step();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../mating/tests/data/two_pin_exact.step");
    // As delivered, the assembly has no pressure between its parts and so no contact.
    harness.state_mut().session.act(Intent::GuideWhen(When::Near));
    harness.state_mut().session.act(Intent::Open(file));
    until(&mut harness, "it is baked", |s| {
        s.document.as_ref().is_some_and(|d| d.baked.is_some())
    });
    connect(&mut harness);
    arm(&mut harness);
    let link = harness.state().session.document.as_ref().map(|d| {
        let count = d.model.parts.len();
        (0..count).find(|&part| d.is_grabbable(part))
    });
    let link = link.flatten().expect("one of both moves");
    harness.state_mut().session.act(Intent::Grab(link));
    let sent = |s: &Session| {
        let rows = s.guidance.rows.iter();
        rows.filter(|row| row.standing == Standing::Sent).count()
    };
    until(&mut harness, "both pins are guided", |s| {
        sent(s) == 2 && guided(s) == 2
    });
    let freedom = &harness.state().session.guidance.freedom;
    let left = (freedom.slides.len(), freedom.turns.len());
    assert_eq!(left, (1, 0), "{freedom}");
    assert!(worst(&harness.state().session) < Severity::Warning);
}
