//! The graph of connections in the running window: searched when its section is opened, a click on a part selects it, the pointer on a connection marks both
//! parts.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::connections::Graph;
use mortise::session::document::Document;
use mortise::session::find_connections::ConnectionsIntent;
use mortise::session::{Intent, Session, obstacle};
use mortise::ui::Window;
use mortise::viewport::compose::{Look, compose};
use mortise::viewport::picture::Item;
use mortise_brep::CadModel;

use crate::common::{click, harness, open_sample, until};

/// A window with a file of the repository, its connections found by opening their section.
fn connected(file: PathBuf) -> Harness<'static, Window> {
    let mut harness = harness();
    harness.step();
    harness.state_mut().session.act(Intent::Open(file));
    until(&mut harness, "it is baked", |session| {
        (session.document.as_ref()).is_some_and(|document| document.baked.is_some())
    });
    click(&mut harness, "Connections");
    until(&mut harness, "the connections", |session| {
        found(session).is_some()
    });
    harness.run_steps(20);
    harness
}

fn of_repository(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)
}

fn found(session: &Session) -> Option<&Graph> {
    session.connections.found(session.document.as_ref()?)
}

/// Accessible name of a part in the graph.
fn named(session: &Session, part: usize) -> String {
    let name = session.document.as_ref().expect("open").part_name(part);
    match found(session).expect("found").of(part).count() {
        1 => format!("{name}: 1 connection"),
        count => format!("{name}: {count} connections"),
    }
}

/// Parts that are outlined, and those that are glass.
fn pointed(harness: &Harness<'_, Window>) -> (Vec<usize>, Vec<usize>) {
    let window = harness.state();
    let look = Look {
        camera: window.view.camera,
        over: window.view.over.now,
        pair: window.view.pair,
        ..Look::default()
    };
    let document = window.session.document.as_ref().expect("open");
    let items = compose(&window.session, document, &look).items;
    let those = |is: fn(&Item) -> bool| (0..items.len()).filter(|part| is(&items[*part])).collect();
    (those(|item| item.tint[3] > 0.0), those(|item| item.opacity < 1.0))
}

#[test]
fn connections_are_drawn_a_click_selects_and_the_pointer_marks_both_parts() {
    let mut harness = connected(of_repository("lab/data/fixture_row.step"));
    let count = harness
        .state()
        .session
        .document
        .as_ref()
        .expect("open")
        .model
        .parts
        .len();
    assert!((3..=40).contains(&count));
    // Each part is there, and a click selects it.
    for part in 0..count {
        let name = named(&harness.state().session, part);
        harness.get_all_by_label(&name).next().expect("drawn").click();
        harness.run_steps(3);
        let selected = harness.state().session.selected.expect("one");
        let document = harness.state().session.document.as_ref().expect("open");
        assert_eq!(document.part_name(selected), document.part_name(part));
    }
    let session = &harness.state().session;
    let edge = found(session).expect("found").edges[0].clone();
    let [part, other] = edge.parts;
    assert!(!edge.fits.is_empty(), "{edge:?}");
    harness.state_mut().session.act(Intent::Select(Some(part)));
    harness.hover_at(egui::pos2(2.0, 2.0));
    harness.run_steps(4);
    assert_eq!(pointed(&harness), (vec![], vec![]), "the pointer is elsewhere");
    // Its connections are listed with kinds and fits.
    let document = harness.state().session.document.as_ref().expect("open");
    let row = format!("{}: {}", document.part_name(other), edge.words());
    let row = harness.get_all_by_label(&row).next().expect("listed").rect();
    harness.hover_at(row.center());
    harness.run_steps(3);
    let others: Vec<usize> = (0..count).filter(|at| !edge.parts.contains(at)).collect();
    assert_eq!(pointed(&harness), (edge.parts.to_vec(), others.clone()));
    // The line between two parts marks them as well.
    let ends = edge.parts.map(|part| {
        let name = named(&harness.state().session, part);
        let dots: Vec<egui::Rect> = harness.get_all_by_label(&name).map(|dot| dot.rect()).collect();
        (dots.len() == 1).then(|| dots[0].center())
    });
    if let [Some(a), Some(b)] = ends {
        harness.hover_at(a.lerp(b, 0.5));
        harness.run_steps(3);
        assert_eq!(pointed(&harness), (edge.parts.to_vec(), others));
    }
    harness.hover_at(egui::pos2(2.0, 2.0));
    harness.run_steps(3);
    assert_eq!(pointed(&harness), (vec![], vec![]), "the pointer has left");
    // A click on a row goes on to the other part.
    let document = harness.state().session.document.as_ref().expect("open");
    let row = format!("{}: {}", document.part_name(other), edge.words());
    harness.get_all_by_label(&row).next().expect("listed").click();
    harness.run_steps(3);
    assert_eq!(harness.state().session.selected, Some(other));
}

#[test]
fn connections_are_those_of_where_the_parts_are() {
    let mut harness = connected(of_repository("mating/tests/data/two_pin_exact.step"));
    assert_eq!(found(&harness.state().session).expect("found").edges.len(), 1);
    assert!(harness.query_by_label_contains("Parts have moved").is_none());
    let document = harness.state_mut().session.document.as_mut().expect("open");
    document.poses[1].translation.x += 500.0;
    harness.run_steps(3);
    let _ = harness.get_by_label_contains("Parts have moved");
    click(&mut harness, "Search connections again");
    until(&mut harness, "the connections", |session| {
        found(session).is_some()
    });
    harness.run_steps(5);
    assert!(found(&harness.state().session).expect("found").edges.is_empty());
    let _ = harness.get_by_label("No two parts touch or fit where they are");
    // Another file has others, which are searched when they are looked at.
    harness.state_mut().session.act(Intent::OpenSample);
    until(&mut harness, "the sample's connections", |session| {
        let document = session.document.as_ref();
        document
            .is_some_and(|document| document.path.is_none() && session.connections.found(document).is_some())
    });
}

#[test]
fn a_search_for_connections_can_be_cancelled_and_begins_again_on_request() {
    let mut harness = harness();
    let find = Intent::Connections(ConnectionsIntent::Find);
    let cancel = Intent::Connections(ConnectionsIntent::Cancel);
    let why = |harness: &Harness<'_, Window>, intent: &Intent| obstacle(&harness.state().session, intent);
    assert_eq!(why(&harness, &find).as_deref(), Some("No file is open"));
    open_sample(&mut harness);
    assert_eq!(why(&harness, &cancel).as_deref(), Some("No search is under way"));
    harness.state_mut().session.act(find.clone());
    assert_eq!(why(&harness, &find).as_deref(), Some("The search is under way"));
    harness.state_mut().session.act(cancel);
    click(&mut harness, "Connections");
    harness.run_steps(20);
    std::thread::sleep(std::time::Duration::from_millis(300));
    harness.run_steps(5);
    let session = &harness.state().session;
    assert!(found(session).is_none() && session.connections.since().is_none());
    click(&mut harness, "Search connections again");
    until(&mut harness, "the connections", |session| {
        found(session).is_some()
    });
}

/// Of a large assembly the selected part and its neighbours are drawn, and a line says so.
#[test]
fn of_many_parts_the_neighbours_of_the_selected_one_are_drawn() {
    let mut harness = connected(of_repository("mating/tests/data/two_pin_exact.step"));
    multiply(harness.state_mut().session.document.as_mut().expect("open"), 21);
    click(&mut harness, "Search connections again");
    until(&mut harness, "the connections", |session| {
        found(session).is_some()
    });
    harness.run_steps(5);
    assert_eq!(found(&harness.state().session).expect("found").edges.len(), 21);
    let says = |words: &str| format!("Of 42 parts the selected one is shown with {words}");
    let _ = harness.get_by_label(&says("those it is connected with: select one"));
    let drawn = |harness: &Harness<'_, Window>| harness.query_all_by_label_contains(": 1 connection").count();
    assert_eq!(drawn(&harness), 0);
    harness.state_mut().session.act(Intent::Select(Some(20)));
    harness.run_steps(5);
    let _ = harness.get_by_label(&says("the one it is connected with"));
    assert_eq!(drawn(&harness), 2);
}

/// Copies of all parts, each beside the one before.
fn multiply(document: &mut Document, times: usize) {
    let mut model = CadModel::clone(&document.model);
    let each = model.parts.len();
    for copy in 1..times {
        for part in 0..each {
            let mut pose = document.poses[part];
            pose.translation.x += 500.0 * copy as f64;
            document.poses.push(pose);
            document.placed.push(pose);
            document.colors.push(document.colors[part]);
            document.names.push(document.names[part].clone());
            document.hidden.push(false);
            model.parts.push(model.parts[part].clone());
        }
    }
    document.model = Arc::new(model);
}
