//! The list of gaps and clashes in the window: searched on request, and a click shows the place.

use crate::common::{click, harness, open_sample};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::ui::Window;
use mortise::viewport::compose::{Look, compose};

/// Draws frames until a control's accessible name contains `text`.
fn until_listed(harness: &mut Harness<'_, Window>, text: &str) {
    for _ in 0..4000 {
        harness.step();
        if harness.query_by_label_contains(text).is_some() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("never listed: {text}");
}

/// The sample's peg of 17.75 mm in its bore of 18.75 mm: a gap of half a millimetre; moved aside by 0.75 mm an overlap of 0.25 mm.
#[test]
fn gaps_and_clashes_are_listed_and_a_click_shows_the_place() {
    let mut harness = harness();
    open_sample(&mut harness);
    let aside = |harness: &mut Harness<'_, Window>, x: f64, z: f64| {
        let document = harness.state_mut().session.document.as_mut().expect("open");
        document.poses[1].translation.x += x;
        document.poses[1].translation.z += z;
        harness.step();
    };
    aside(&mut harness, 0.0, -55.0);
    click(&mut harness, "Clearances");
    harness.run_steps(20);
    click(&mut harness, "Search clearances");
    until_listed(&mut harness, "gap 500.0 µm");
    // The panel grows with its contents.
    harness.run_steps(3);
    harness.get_by_label_contains("gap 500.0 µm").click();
    // The camera glides there.
    for _ in 0..200 {
        harness.step();
    }
    let view = &harness.state().view;
    assert_eq!(view.marked.parts, [0, 1]);
    let place = view.marked.place.expect("marked");
    let from_axis = place.truncate().length();
    assert!((8.8..9.4).contains(&from_axis), "{place}");
    assert!((view.camera.target - place).length() < 1e-6);

    // Both parts are outlined, in the list too.
    let document = harness.state().session.document.as_ref().expect("open");
    let look = |marked| Look {
        marked,
        ..Look::default()
    };
    let lines = |look: Look<'_>| -> Vec<[f32; 4]> {
        let picture = compose(&harness.state().session, document, &look);
        picture.items.iter().map(|item| item.line).collect()
    };
    let (marked, plain) = (lines(look(&view.marked.parts)), lines(look(&[])));
    assert!(marked.iter().zip(&plain).all(|(a, b)| a != b));

    // A section that is on is moved to the place.
    let plane = |harness: &Harness<'_, Window>| {
        let document = harness.state().session.document.as_ref().expect("open");
        harness.state().view.section.setting.plane(document.extent)
    };
    harness.key_press(Key::X);
    harness.step();
    harness.state_mut().view.section.setting.offset_mm = 20.0;
    harness.get_by_label_contains("gap 500.0 µm").click();
    harness.run_steps(3);
    assert!(plane(&harness).expect("a plane").height(place).abs() < 1e-9);
    harness.key_press(Key::X);
    harness.step();

    // The list states that it is out of date once a part has moved.
    aside(&mut harness, 0.75, 0.0);
    harness.step();
    assert!(harness.query_by_label_contains("Parts have moved").is_some());
    click(&mut harness, "Search clearances");
    until_listed(&mut harness, "overlap 250.0 µm");
    assert!(harness.query_by_label_contains("Parts have moved").is_none());
}
