//! Parts put together by the simulated hand: those that fit go in from wherever the hand is off, and what is in the way is felt and named.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use mortise_bake::{Grabbable, Planned, Request, plan};
use mortise_brep::{CadModel, Part, load_step};
use mortise_rig::{Client, RigSpec};
use mortise_scenario::insertions::{AssemblyScene, IN_PLACE_MM, Inserted, Manner, play_insertions};
use mortise_task::insertion::{Insertion, insertions};
use mortise_task::{Assembly, sequence};

/// Pairs of other tests: a bolt beside a stop, two pins at once, a cone, a ball, each with an exact fit.
const PAIRS: &[&str] = &[
    "lab/data/bolt_with_stop.step",
    "mating/tests/data/two_pin_exact.step",
    "mating/tests/data/cone_in_cone.step",
    "mating/tests/data/ball_in_cylinder.step",
];

fn read(path: &str) -> CadModel {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    load_step(folder.join(path)).unwrap()
}

/// The steps of an assembly that comes apart.
fn steps(model: &CadModel) -> Vec<Insertion> {
    let assembly = Assembly::new(model.clone()).unwrap();
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(&assembly, &all, Duration::from_secs(60));
    assert!(found.complete(), "{found:?}");
    insertions(&assembly, &found)
}

fn image(model: &CadModel) -> Planned {
    let request = Request {
        grabbable: Grabbable::All,
        ..Request::default()
    };
    plan(model, &request, &|_| ControlFlow::Continue(())).unwrap()
}

fn played(
    client: &Client,
    model: &CadModel,
    planned: &Planned,
    steps: &[Insertion],
    manner: &Manner,
) -> Vec<Inserted> {
    let scene = AssemblyScene {
        model,
        image: &planned.image,
        report: &planned.plan.report,
    };
    let mut all = Vec::new();
    play_insertions(client, &scene, steps, manner, &mut |inserted| all.push(inserted)).unwrap();
    all
}

fn rig() -> Client {
    Client::connect(&RigSpec::Simulated { realtime: false }.lockstep()).unwrap()
}

#[test]
fn parts_that_fit_go_in_wherever_the_hand_is_off() {
    let mut random = fastrand::Rng::with_seed(19);
    let client = rig();
    for path in PAIRS {
        let model = read(path);
        let (steps, planned) = (steps(&model), image(&model));
        for _ in 0..4 {
            let mut component = || random.f64() * 2.0 - 1.0;
            let manner = Manner {
                off_to: DVec3::new(component(), component(), component()),
                ..Manner::default()
            };
            for inserted in played(&client, &model, &planned, &steps, &manner) {
                println!("{path}: {}", inserted.words());
                assert!(
                    inserted.in_place,
                    "{path}, off to {:?}: {inserted:?}",
                    manner.off_to
                );
                assert!(inserted.off_um <= 1e3 * IN_PLACE_MM);
                assert!(inserted.peak.force_n < 5.0, "{path}: {inserted:?}");
                assert_eq!(inserted.missed_ticks, 0);
            }
        }
    }
}

/// The same bits again: nothing depends on when messages arrive, or on what the rig did before.
#[test]
fn a_play_repeats_to_the_bit() {
    let client = rig();
    let model = read(PAIRS[1]);
    let (steps, planned) = (steps(&model), image(&model));
    let played = |client: &Client| {
        let mut all = played(client, &model, &planned, &steps, &Manner::default());
        // On this rig the cost is a time.
        all.iter_mut().for_each(|inserted| inserted.cost_max = 0);
        all
    };
    let first = played(&client);
    for _ in 0..3 {
        assert_eq!(played(&client), first);
        assert_eq!(played(&rig()), first);
    }
}

/// A second block over the hole: the bolt stops at it, with a force that a hand feels, in every attempt.
#[test]
fn what_is_in_the_way_is_felt_and_named() {
    let model = read(PAIRS[0]);
    let mut steps = steps(&model);
    let step = &mut steps[0];
    let onto = step.onto[0];
    let out = step.way[0].translation - step.way[step.way.len() - 1].translation;
    let mut blocked = model.clone();
    // Half-way out, where the bolt's end has not yet met the block.
    let way = 0.5 * out;
    blocked.parts.push(Part {
        name: "obstacle".into(),
        placement: DAffine3::from_translation(way) * model.parts[onto].placement,
        ..model.parts[onto].clone()
    });
    // Aside, so that its hole is elsewhere.
    let aside = out.normalize().any_orthonormal_vector() * 8.0;
    let last = blocked.parts.len() - 1;
    blocked.parts[last].placement.translation += aside;
    step.onto.push(last);
    let planned = image(&blocked);
    let inserted = &played(&rig(), &blocked, &planned, &steps, &Manner::default())[0];
    println!("{}", inserted.words());
    assert!(!inserted.in_place, "{inserted:?}");
    assert_eq!(inserted.caught.len(), 3);
    for moment in &inserted.caught {
        assert_eq!(moment.against.as_deref(), Some("obstacle"), "{inserted:?}");
        assert!(moment.left_mm > 0.3 * way.length(), "{inserted:?}");
        assert!(moment.force_n > 2.0, "{inserted:?}");
    }
}

/// A bolt with another one end to end on it, of which the hand holds either: both move as one, and go in as the bolt alone does. Steps before and after, in the
/// scene of all parts, are played on the same rig.
#[test]
fn a_group_moves_as_one() {
    let mut model = read(PAIRS[0]);
    let bolt = steps(&model)[0].clone();
    let out = bolt.way[0].translation - bolt.way[bolt.way.len() - 1].translation;
    let shape = &model.shapes[model.parts[bolt.part].shape];
    let along = |p: &DVec3| {
        model.parts[bolt.part]
            .placement
            .transform_point3(*p)
            .dot(out.normalize())
    };
    let ends = shape.mesh.vertices.iter().map(along);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| {
        (low.min(t), high.max(t))
    });
    let on_top = DAffine3::from_translation(out.normalize() * (high - low));
    model.parts.push(Part {
        name: "second".into(),
        placement: on_top * model.parts[bolt.part].placement,
        ..model.parts[bolt.part].clone()
    });
    let second = model.parts.len() - 1;
    let planned = image(&model);
    let held = Insertion {
        with: vec![second],
        ..bolt.clone()
    };
    let by_the_other = Insertion {
        part: second,
        with: vec![bolt.part],
        onto: bolt.onto.clone(),
        way: bolt.way.iter().map(|pose| on_top * *pose).collect(),
    };
    let steps = [bolt.clone(), held, by_the_other, bolt];
    let all = played(&rig(), &model, &planned, &steps, &Manner::default());
    let names: Vec<&str> = all.iter().map(|inserted| inserted.part.as_str()).collect();
    assert_eq!(names, ["bolt", "bolt, second", "second, bolt", "bolt"]);
    for inserted in &all {
        println!("{}", inserted.words());
        assert!(inserted.in_place && inserted.caught.is_empty(), "{inserted:?}");
        assert!(inserted.peak.force_n < 5.0, "{inserted:?}");
    }
}
