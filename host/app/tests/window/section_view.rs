//! The section view's controls in the window, without a graphics device.

use crate::common::{click, harness, open_sample};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::cut::Across;
use mortise::ui::Window;

/// Draws frames until the areas of the present setting are there.
fn until_cut(harness: &mut Harness<'_, Window>) {
    for _ in 0..2000 {
        harness.step();
        let (session, view) = (&harness.state().session, &harness.state().view);
        let document = session.document.as_ref().expect("open");
        let wanted = view.section.setting.plane(document.extent);
        let shown = view.section.shown(document);
        if shown.is_some_and(|s| s.cut.is_some() && Some(s.plane) == wanted) {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("never cut");
}

/// Areas of the parts that are cut, mm².
fn areas(harness: &Harness<'_, Window>) -> Vec<(usize, f64)> {
    let (session, view) = (&harness.state().session, &harness.state().view);
    let document = session.document.as_ref().expect("open");
    let cut = view.section.shown(document).and_then(|s| s.cut).expect("cut");
    cut.areas.iter().map(|a| (a.part, a.area_mm2)).collect()
}

#[test]
fn the_section_is_switched_and_laid_by_key_and_buttons() {
    let mut harness = harness();
    open_sample(&mut harness);
    assert!(harness.query_by_label("Across x").is_none());
    harness.key_press(Key::X);
    harness.step();
    assert!(harness.state().view.section.on);
    until_cut(&mut harness);
    // Through the axis: two strips of the block, and the peg.
    let found = areas(&harness);
    assert_eq!(found.iter().map(|a| a.0).collect::<Vec<_>>(), [0, 1]);
    let strips = 2.0 * (25.0 - 9.375) * 40.0;
    assert!((found[0].1 - strips).abs() < 0.5, "{found:?}");

    click(&mut harness, "Across z");
    assert_eq!(harness.state().view.section.setting.across, Across::Z);
    harness.state_mut().view.section.setting.offset_mm = -10.0;
    until_cut(&mut harness);
    let frame = 2500.0 - std::f64::consts::PI * 9.375 * 9.375;
    let found = areas(&harness);
    assert!(found.len() == 1 && (found[0].1 - frame).abs() < 1.0, "{found:?}");
    let before = harness.state().view.section.setting.flipped;
    click(&mut harness, "Flip");
    assert_ne!(harness.state().view.section.setting.flipped, before);
    until_cut(&mut harness);

    // Parts that move are cut where they are.
    let document = harness.state_mut().session.document.as_mut().expect("open");
    document.poses[1].translation.z -= 40.0;
    for _ in 0..400 {
        harness.step();
        if areas(&harness).len() == 2 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(areas(&harness).len(), 2, "the peg in the bore");

    // A key ends it as it began, unless text is being typed.
    harness.key_press(Key::X);
    harness.step();
    assert!(!harness.state().view.section.on);
    harness.step();
    assert!(harness.query_by_label("Across x").is_none());
}

#[test]
fn gaps_are_shown_once_nothing_moves() {
    let mut harness = harness();
    open_sample(&mut harness);
    let document = harness.state_mut().session.document.as_mut().expect("open");
    document.poses[1].translation.z -= 55.0;
    harness.key_press(Key::X);
    harness.step();
    until_cut(&mut harness);
    let bands = |harness: &Harness<'_, Window>| {
        let (session, view) = (&harness.state().session, &harness.state().view);
        let document = session.document.as_ref().expect("open");
        let cut = view.section.shown(document).and_then(|shown| shown.cut);
        cut.and_then(|cut| cut.gaps.clone())
    };
    assert_eq!(bands(&harness), None, "only on request");
    click(&mut harness, "Gaps");
    let until_shown = |harness: &mut Harness<'_, Window>, range_mm: f64| {
        for _ in 0..2000 {
            harness.step();
            if let Some(gaps) = bands(harness)
                && gaps.range_mm == range_mm
            {
                return gaps;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        panic!("no gaps");
    };
    assert_eq!(harness.state().view.section.gaps_up_to_um, 500.0);
    harness.state_mut().view.section.gaps_up_to_um = 600.0;
    let gaps = until_shown(&mut harness, 0.6);
    let least = gaps.bands.iter().map(|band| band.distances_mm[0]);
    assert!((least.fold(f64::INFINITY, f64::min) - 0.5).abs() < 1e-6);

    // A larger range follows more, and the plane that moves is cut before the gaps are followed.
    harness.state_mut().view.section.gaps_up_to_um = 3000.0;
    assert!(until_shown(&mut harness, 3.0).bands.len() > gaps.bands.len());
    harness.state_mut().view.section.setting.offset_mm = 1.0;
    until_cut(&mut harness);
    assert!(!until_shown(&mut harness, 3.0).bands.is_empty());
    click(&mut harness, "Gaps");
    for _ in 0..400 {
        harness.step();
        if bands(&harness).is_none() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("still shown");
}
