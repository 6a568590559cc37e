//! The plots in the window without a display: held still and moved, kept over a lost link, signals chosen, exported.

use std::time::Duration;

use crate::common::{click, harness, until};
use egui::{Modifiers, MouseWheelSource, MouseWheelUnit, TouchPhase, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::Intent;
use mortise::session::history::Sample;
use mortise::session::intent::Traces;
use mortise::session::notes::Severity;
use mortise::ui::Window;
use mortise_rig::RigSpec;

/// A window with half a minute of samples, and none that arrive.
fn recorded() -> Harness<'static, Window> {
    let mut harness = harness();
    for i in 0..3_000u16 {
        let time_s = 0.01 * f64::from(i);
        harness.state_mut().session.history.add(Sample {
            time_s,
            handle_n: 2.0 + time_s.sin() as f32,
            points: i,
            ..Sample::default()
        });
    }
    harness.run_steps(3);
    harness
}

/// Times at both ends of the plots, to the millisecond.
fn range(harness: &Harness<'_, Window>) -> [f64; 2] {
    harness.state().plots.range_s().map(|s| (1e3 * s).round() / 1e3)
}

#[test]
fn plots_are_held_moved_zoomed_and_live_again() {
    let mut harness = recorded();
    assert_eq!(range(&harness), [19.99, 29.99]);
    click(&mut harness, "Pause");
    (harness.state_mut().session.history).add(Sample {
        time_s: 30.1,
        ..Sample::default()
    });
    harness.run_steps(2);
    assert_eq!(range(&harness), [19.99, 29.99], "held");
    click(&mut harness, "Show less time");
    assert_eq!(range(&harness), [22.49, 27.49], "about the middle");

    // The title of the plot of forces; the plot is below.
    let at = harness.get_by_label("Force").rect().center() + Vec2::new(120.0, 60.0);
    harness.hover_at(at);
    harness.run_steps(2);
    // The time and the value under the pointer are shown.
    harness.get_by_label_contains("at −");
    harness.drag_at(at);
    harness.step();
    harness.hover_at(at + Vec2::new(40.0, 0.0));
    harness.run_steps(2);
    harness.drop_at(at + Vec2::new(40.0, 0.0));
    harness.run_steps(2);
    let moved = range(&harness);
    assert!(
        moved[0] < 22.4 && (moved[1] - moved[0] - 5.0).abs() < 2e-3,
        "{moved:?}"
    );

    harness.hover_at(at);
    harness.step();
    harness.input_mut().events.push(egui::Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta: Vec2::new(0.0, 200.0),
        phase: TouchPhase::Move,
        source: MouseWheelSource::Unknown,
        modifiers: Modifiers::NONE,
    });
    harness.run_steps(20);
    let zoomed = range(&harness);
    assert!(zoomed[1] - zoomed[0] < 4.0, "{zoomed:?}");
    assert!(moved[0] < zoomed[0] && zoomed[1] < moved[1], "about the pointer");

    click(&mut harness, "Live");
    assert_eq!(range(&harness)[1], 30.1);
}

#[test]
fn a_signal_is_chosen_and_gets_its_plot() {
    let mut harness = recorded();
    assert!(harness.query_by_label("Count").is_none());
    click(&mut harness, "Signals");
    harness.run_steps(3);
    harness.get_by_label("Count: points").scroll_to_me();
    harness.run_steps(20);
    click(&mut harness, "Count: points");
    assert!(harness.state().plots.keys().contains(&"points"));
    harness.key_press(egui::Key::Escape);
    harness.run_steps(3);
    harness.get_by_label("Count");
}

/// What the plots show just before a link is lost is what explains it.
#[test]
fn traces_outlive_the_link_and_go_on_after_a_gap() {
    let mut harness = harness();
    let connect = |harness: &mut Harness<'_, Window>| {
        let session = &mut harness.state_mut().session;
        session.act(Intent::ChooseRig(RigSpec::Simulated { realtime: true }));
        session.act(Intent::Connect);
        let before = session.history.len();
        until(harness, "samples arrive", move |s| {
            s.connection().is_some() && s.history.len() > before + 20
        });
    };
    connect(&mut harness);
    let before = harness.state().session.history.len();
    harness.state_mut().session.act(Intent::Disconnect);
    harness.run_steps(3);
    assert!(harness.state().session.history.len() >= before, "kept");
    std::thread::sleep(Duration::from_millis(300));
    connect(&mut harness);
    let history = &harness.state().session.history;
    let all: Vec<(bool, f64)> = (history.between(f64::MIN, f64::MAX))
        .map(|(breaks, sample)| (breaks, sample.time_s))
        .collect();
    assert!(all.len() > before);
    assert!(
        all.is_sorted_by(|a, b| a.1 <= b.1),
        "one time, although the board starts at zero again"
    );
    assert_eq!(
        all.iter().filter(|(breaks, _)| *breaks).count(),
        2,
        "the start and the gap"
    );
}

#[test]
fn what_is_shown_is_exported_and_no_file_is_lost() {
    let mut harness = recorded();
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("traces.csv");
    let export = |harness: &mut Harness<'_, Window>| {
        let traces = Traces {
            range_s: [1.0, 1.02],
            keys: vec!["points", "loop_cost"],
        };
        harness.state_mut().session.act(Intent::ExportTraces(traces));
    };
    let save = |replace| Intent::SaveTraces {
        path: path.clone(),
        replace,
    };
    export(&mut harness);
    harness.state_mut().session.act(save(false));
    until(&mut harness, "written", |s| {
        s.notes.iter().any(|n| n.text.starts_with("Written: "))
    });
    let text = std::fs::read_to_string(&path).expect("there");
    assert_eq!(
        text,
        "time_s,points,loop_cost\n1.0000,100,0\n1.0100,101,0\n1.0200,102,0\n"
    );
    // A second table does not replace the first without a request.
    export(&mut harness);
    harness.state_mut().session.act(save(false));
    until(&mut harness, "refused", |s| {
        s.notes.newest().is_some_and(|n| n.severity == Severity::Error)
    });
    let said = harness.state().session.notes.newest().expect("one").text.clone();
    assert!(
        said.contains("traces.csv: exists already") && !said.contains("--force"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(&path).expect("there"), text);
    // Nothing waits any more.
    let nothing = mortise::session::obstacle(&harness.state().session, &save(true));
    assert!(nothing.is_some());
}

/// Where the desktop has no file dialog, a field takes the path.
#[test]
fn the_path_of_an_export_is_typed_where_there_is_no_dialog() {
    let mut harness = recorded();
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("typed.csv");
    click(&mut harness, "Export…");
    until(&mut harness, "a path is asked for", |s| s.wants_path.is_some());
    harness.run_steps(2);
    harness.get_by_label("Export traces as CSV or SVG");
    let field = harness.get_by_role(egui::accesskit::Role::TextInput);
    field.type_text(path.to_str().expect("text"));
    harness.run_steps(2);
    click(&mut harness, "Save");
    until(&mut harness, "written", |s| {
        s.notes.iter().any(|n| n.text.starts_with("Written: "))
    });
    let text = std::fs::read_to_string(&path).expect("there");
    // Ten seconds at a hundred samples a second, and the head.
    assert_eq!(text.lines().count(), 1_001 + 1);
    assert!(
        text.starts_with("time_s,contact_force_n,handle_force_n,"),
        "{text}"
    );
}
