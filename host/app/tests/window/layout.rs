//! STOP and the state at every window size and scale: complete, on screen, and not covered.

use crate::common::{arm, click, connect, harness, open_sample, until};
use egui::{Rect, Role, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use mortise::session::notes::Severity;
use mortise::session::purpose::Purpose;
use mortise::ui::Window;

/// Resolutions of common screens, pixels, from the smallest projector to 4K.
const SCREENS: [(f32, f32); 9] = [
    (800.0, 600.0),
    (1024.0, 768.0),
    (1280.0, 720.0),
    (1366.0, 768.0),
    (1600.0, 1000.0),
    (1920.0, 1080.0),
    (2560.0, 1440.0),
    (3440.0, 1440.0),
    (3840.0, 2160.0),
];
const SCALES: [f32; 6] = [1.0, 1.25, 1.5, 2.0, 2.5, 3.0];

/// Whether a node is visible content; the other roles only group nodes.
fn is_leaf(role: Role) -> bool {
    matches!(
        role,
        Role::Button
            | Role::Label
            | Role::Image
            | Role::ComboBox
            | Role::Slider
            | Role::TextInput
            | Role::CheckBox
            | Role::SpinButton
            | Role::ListBoxOption
    )
}

/// A window of `size` points.
fn resize(harness: &mut Harness<'_, Window>, size: Vec2, scale: f32) {
    // A new scale stretches the existing window, so the size is set second.
    harness.set_pixels_per_point(scale);
    harness.step();
    harness.set_size(size);
    // Panels know their sizes from the second frame on.
    harness.run_steps(3);
    let off = harness.ctx.content_rect().size() - size;
    // A window has a whole number of pixels.
    assert!(off.length() < 1.0 / scale, "{off}");
}

/// Checks the rectangles of STOP and the state.
fn check(harness: &mut Harness<'_, Window>, state: &str, what: &str) {
    for &(width, height) in &SCREENS {
        for scale in SCALES {
            let size = Vec2::new(width, height) / scale;
            resize(harness, size, scale);
            let screen = Rect::from_min_size(egui::Pos2::ZERO, size);
            let at = format!("{what}, {width} × {height} at {scale}");
            let stop = harness.get_by_role_and_label(Role::Button, "STOP");
            // The chip is the only node in the bar with this text that is higher than a line of text.
            let chip = harness
                .get_all_by_role(Role::Label)
                .find(|node| {
                    let node_itself = node.accesskit_node();
                    let words = node_itself.value().or_else(|| node_itself.label());
                    words.is_some_and(|l| l.starts_with(state)) && node.rect().height() > 26.0
                })
                .unwrap_or_else(|| panic!("{at}: no state"));
            for (name, rect, least) in [("STOP", stop.rect(), 100.0), ("state", chip.rect(), 60.0)] {
                // Rounding to pixels: half a pixel on each side.
                let slack = 0.5 / scale;
                assert!(
                    screen.expand(slack).contains_rect(rect),
                    "{at}: {name} at {rect} of {screen}"
                );
                assert!(
                    rect.width() >= least && rect.height() >= 27.0,
                    "{at}: {name} is {rect}"
                );
                for other in harness.root().children_recursive() {
                    let node = other.accesskit_node();
                    // A node without bounds is not drawn.
                    let placed = node.raw_bounds().is_some();
                    if !is_leaf(node.role()) || !placed || other.rect() == rect {
                        continue;
                    }
                    let shared = other.rect().intersect(rect);
                    assert!(
                        !(shared.width() > 2.0 * slack && shared.height() > 2.0 * slack),
                        "{at}: {:?} {:?} at {} lies over {name} at {rect}",
                        node.role(),
                        node.label(),
                        other.rect()
                    );
                }
            }
        }
    }
    resize(harness, Vec2::new(1500.0, 940.0), 1.0);
}

#[test]
fn stop_and_the_state_are_on_screen_in_the_workspace_for_the_rig() {
    use mortise::session::Intent;
    use mortise::session::rig_page::RigIntent;
    use mortise::session::workspace::Workspace;
    let mut harness = harness();
    let session = &mut harness.state_mut().session;
    session.act(Intent::Show(Workspace::Rig));
    session.act(Intent::Rig(RigIntent::Example(3)));
    session.act(Intent::Connect);
    until(&mut harness, "the description was read", |s| {
        s.rig_page.on_board.is_some()
    });
    harness.state_mut().session.act(Intent::Rig(RigIntent::Send));
    until(&mut harness, "the board uses it", |s| s.rig_page.is_in_use());
    harness.state_mut().session.act(Intent::Rig(RigIntent::Begin));
    check(&mut harness, "Idle", "commissioning");
}

#[test]
fn stop_and_the_state_are_on_screen_at_every_size_and_scale() {
    let mut harness = harness();
    harness.run_steps(2);
    check(&mut harness, "No rig", "nothing open");
    open_sample(&mut harness);
    // A title longer than any bar.
    {
        let document = harness.state_mut().session.document.as_mut().expect("open");
        document.title = "left-bearing-housing-with-extra-long-name-revision-12.step".repeat(3);
        let model = std::sync::Arc::make_mut(&mut document.model);
        model.parts[1].name = "peg of a name that no bar of any window has space for ".repeat(4);
    }
    connect(&mut harness);
    check(&mut harness, "Idle", "connected");
    arm(&mut harness);
    harness.state_mut().session.act(mortise::session::Intent::Grab(1));
    until(&mut harness, "the peg is held", |s| s.grabbed() == Some(1));
    check(&mut harness, "Holding", "a part is held");
    // The path dialog lies over everything else.
    harness.state_mut().session.wants_path = Some(Purpose::OpenModel);
    harness.run_steps(2);
    check(&mut harness, "Holding", "a dialog is open");
    click(&mut harness, "STOP");
}

/// A press on STOP at the smallest window size.
#[test]
fn stop_works_in_the_smallest_window() {
    let mut harness = harness();
    open_sample(&mut harness);
    connect(&mut harness);
    arm(&mut harness);
    resize(&mut harness, Vec2::new(266.0, 200.0), 3.0);
    let at = harness.get_by_label("STOP").rect().center();
    assert!(at.x < 266.0 && at.y < 200.0, "{at}");
    harness.drag_at(at);
    until(&mut harness, "stopped", |s| {
        s.device() == Some(mortise_protocol::message::DeviceState::Stopped)
    });
}

/// Below 1200 points a drawer holds the panels: a click on a tab opens it, one on the open tab closes it.
#[test]
fn under_1200_points_panels_are_in_a_drawer() {
    let mut harness = harness();
    open_sample(&mut harness);
    resize(&mut harness, Vec2::new(1180.0, 800.0), 1.0);
    let heading = |harness: &Harness<'_, Window>, text: &str| harness.query_all_by_label(text).count();
    assert_eq!(heading(&harness, "Connect"), 1, "the rig is in the drawer");
    click(&mut harness, "Show Parts");
    assert_eq!(
        [heading(&harness, "Search parts"), heading(&harness, "Connect")],
        [1, 0]
    );
    click(&mut harness, "Show Parts");
    assert_eq!(heading(&harness, "Search parts"), 0, "the drawer is closed");
    click(&mut harness, "Analyse");
    click(&mut harness, "Show Runs");
    assert_eq!(heading(&harness, "Open a run"), 1);
    click(&mut harness, "Assemble");
    resize(&mut harness, Vec2::new(1230.0, 800.0), 1.0);
    assert_eq!(
        [heading(&harness, "Search parts"), heading(&harness, "Connect")],
        [1, 1]
    );
}

#[test]
fn plots_and_messages_fold_to_the_newest_message() {
    let mut harness = harness();
    open_sample(&mut harness);
    let count = |harness: &Harness<'_, Window>, text: &str| harness.query_all_by_label(text).count();
    assert_eq!(count(&harness, "Export…"), 1);
    click(&mut harness, "Fold");
    assert_eq!(count(&harness, "Export…"), 0);
    let newest = harness
        .state()
        .session
        .notes
        .iter()
        .next()
        .expect("a message")
        .text
        .clone();
    assert_eq!(count(&harness, &newest), 1);
    click(&mut harness, "Plots and messages");
    assert_eq!(count(&harness, "Export…"), 1);
}

#[test]
fn messages_can_be_filtered_by_severity() {
    let mut harness = harness();
    let notes = &mut harness.state_mut().session.notes;
    notes.add(Severity::Info, "for the record");
    notes.add(Severity::Warning, "to know about");
    notes.add(Severity::Error, "it failed");
    harness.run_steps(2);
    let seen = |harness: &Harness<'_, Window>| {
        ["for the record", "to know about", "it failed"].map(|text| harness.query_all_by_label(text).count())
    };
    assert_eq!(seen(&harness), [1, 1, 1]);
    click(&mut harness, "Warnings");
    assert_eq!(seen(&harness), [0, 1, 1]);
    click(&mut harness, "Warnings");
    assert_eq!(seen(&harness), [1, 1, 1]);
}
