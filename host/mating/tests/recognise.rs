//! The recogniser on this project's test parts: constraints, freedoms, contradictions, and the list's stability.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, load_step};
use mortise_mating::recognise::{Observation, Recogniser, State, Thresholds, TouchingFaces};
use mortise_mating::{Tolerances, identify};
use mortise_protocol::message::ConstraintKind;
use proptest::prelude::*;

const FILES: [&str; 4] = [
    "two_pin_exact.step",
    "cone_in_cone.step",
    "ball_in_socket.step",
    "ball_in_cylinder.step",
];

fn model(name: &str) -> &'static CadModel {
    static MODELS: OnceLock<Vec<CadModel>> = OnceLock::new();
    let models = MODELS.get_or_init(|| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
        FILES.iter().map(|f| load_step(folder.join(f)).unwrap()).collect()
    });
    &models[FILES.iter().position(|f| *f == name).unwrap()]
}

/// Face pairs that touch in the assembly as delivered, seen from part 1.
fn touches(model: &'static CadModel) -> Vec<TouchingFaces> {
    static FOUND: Mutex<BTreeMap<String, Vec<TouchingFaces>>> = Mutex::new(BTreeMap::new());
    let mut found = FOUND.lock().unwrap_or_else(PoisonError::into_inner);
    let key = format!("{:?}", model.parts);
    found.entry(key).or_insert_with(|| find_touches(model)).clone()
}

fn find_touches(model: &CadModel) -> Vec<TouchingFaces> {
    let faces = identify(model, &Tolerances::default())
        .into_iter()
        .flat_map(|c| c.faces);
    let touch = |[fixed_face, moving_face]: [u32; 2]| TouchingFaces {
        moving_face,
        fixed_part: 0,
        fixed_face,
        depth_mm: 0.01,
    };
    faces.map(touch).collect()
}

fn poses(model: &CadModel) -> Vec<DAffine3> {
    model.parts.iter().map(|p| p.placement).collect()
}

fn new(model: &CadModel) -> Recogniser<'_> {
    Recogniser::new(model, &Tolerances::default(), Thresholds::default())
}

fn see(recogniser: &mut Recogniser<'_>, poses: &[DAffine3], touching: &[TouchingFaces]) {
    recogniser.update(&Observation {
        fits: &[],
        moving_part: 1,
        poses,
        touching,
    });
}

fn kinds(recogniser: &Recogniser<'_>) -> Vec<ConstraintKind> {
    let mut kinds: Vec<_> = recogniser.active().map(|t| t.kind).collect();
    kinds.sort_by_key(|&kind| kind as u8);
    kinds
}

#[test]
fn each_joint_is_recognised_and_its_freedom_named() {
    use ConstraintKind::*;
    let cases = [
        (
            "two_pin_exact.step",
            vec![Concentric, Concentric, Coplanar],
            "fixed",
            (0, 0),
        ),
        ("cone_in_cone.step", vec![Conical], "revolute", (0, 1)),
        ("ball_in_socket.step", vec![Spherical], "spherical", (0, 3)),
        ("ball_in_cylinder.step", vec![Annular], "ball in cylinder", (1, 3)),
    ];
    for (file, want, name, (slides, turns)) in cases {
        let mut recogniser = new(model(file));
        see(&mut recogniser, &poses(model(file)), &touches(model(file)));
        assert_eq!(kinds(&recogniser), want, "{file}");
        let freedom = recogniser.freedom();
        assert_eq!(
            (freedom.slides.len(), freedom.turns.len()),
            (slides, turns),
            "{file}"
        );
        assert_eq!(freedom.name(), name);
    }
}

#[test]
fn freedoms_of_part_of_the_targets() {
    let model = model("two_pin_exact.step");
    let (all, poses) = (touches(model), poses(model));
    let is_plane = |t: &TouchingFaces| {
        let face = &model.shapes[model.parts[1].shape].faces[t.moving_face as usize];
        matches!(face.surface, mortise_brep::Surface::Plane { .. })
    };
    let (planes, pins): (Vec<_>, Vec<_>) = all.iter().copied().partition(is_plane);
    for (touching, name) in [
        (pins[..1].to_vec(), "cylindrical"),
        (pins.clone(), "prismatic"),
        (planes.clone(), "planar"),
        ([&pins[..1], &planes].concat(), "revolute"),
        (vec![], "free"),
    ] {
        let mut recogniser = new(model);
        see(&mut recogniser, &poses, &touching);
        assert_eq!(recogniser.freedom().name(), name);
        // One pin: rotation and slide along its own axis, z through (±10, 0).
        for turn in recogniser
            .freedom()
            .turns
            .iter()
            .filter(|_| touching.len() == 1 && !pins.is_empty())
        {
            assert!(turn.direction.cross(DVec3::Z).length() < 1e-9);
            if name == "cylindrical" {
                assert!(
                    (turn.origin.x.abs() - 10.0).abs() < 1e-6 && turn.origin.y.abs() < 1e-6,
                    "{turn:?}"
                );
            }
        }
    }
}

#[test]
fn one_pin_in_two_holes_is_a_conflict_that_names_the_first() {
    let model = model("two_pin_exact.step");
    let pins: Vec<_> = touches(model).into_iter().collect();
    let wide = Thresholds {
        distance_mm: 30.0,
        ..Thresholds::default()
    };
    let mut recogniser = Recogniser::new(model, &Tolerances::default(), wide);
    let cylinder = |t: &&TouchingFaces| {
        let face = &model.shapes[model.parts[1].shape].faces[t.moving_face as usize];
        matches!(face.surface, mortise_brep::Surface::Cylinder { .. })
    };
    let walls: Vec<_> = pins.iter().filter(cylinder).collect();
    let crossed = TouchingFaces {
        fixed_face: walls[1].fixed_face,
        ..*walls[0]
    };
    see(&mut recogniser, &poses(model), &[*walls[0], crossed]);
    let active: Vec<_> = recogniser.active().map(|t| t.id).collect();
    assert_eq!(active.len(), 1);
    let conflict = recogniser.entries().find(|e| e.target.id != active[0]).unwrap();
    assert_eq!(conflict.state, State::Conflict(active.clone()));
    // Once pinned, the other target comes first and this one waits for it.
    let other = conflict.target.id;
    assert!(recogniser.pin(other, true));
    see(&mut recogniser, &poses(model), &[*walls[0], crossed]);
    assert_eq!(recogniser.active().map(|t| t.id).collect::<Vec<_>>(), [other]);
    // Switched off, it yields to the first.
    assert!(recogniser.switch_off(other, true));
    see(&mut recogniser, &poses(model), &[*walls[0], crossed]);
    assert_eq!(recogniser.active().map(|t| t.id).collect::<Vec<_>>(), active);
}

#[test]
fn the_list_does_not_flicker_and_forgets_in_the_end() {
    let model = model("cone_in_cone.step");
    let (touching, home) = (touches(model), poses(model));
    let limits = Thresholds::default();
    let mut recogniser = new(model);
    let lifted = |by: f64| vec![home[0], DAffine3::from_translation(DVec3::Z * by) * home[1]];
    // Too far to engage; near; slightly too far, but retained; too far to be retained; and back within the band, not
    // engaged.
    for (by, active) in [(1.2, 0), (0.9, 1), (1.2, 1), (1.45, 1), (1.6, 0), (1.2, 0)] {
        see(&mut recogniser, &lifted(by * limits.distance_mm), &touching);
        assert_eq!(recogniser.active().count(), active, "{by}");
    }
    see(&mut recogniser, &home, &touching);
    for _ in 0..limits.patience {
        see(&mut recogniser, &home, &[]);
        assert_eq!(recogniser.active().count(), 1);
    }
    see(&mut recogniser, &home, &[]);
    assert_eq!(recogniser.entries().count(), 0);
}

#[test]
fn what_does_not_exist_is_passed_over() {
    let model = model("cone_in_cone.step");
    let mut recogniser = new(model);
    let odd = |moving_face, fixed_part, fixed_face| TouchingFaces {
        moving_face,
        fixed_part,
        fixed_face,
        depth_mm: 0.0,
    };
    let touching = [odd(999, 0, 0), odd(0, 7, 0), odd(0, 0, 999), odd(0, 1, 0)];
    see(&mut recogniser, &poses(model), &touching);
    assert_eq!(recogniser.entries().count(), 0);
    see(&mut recogniser, &[], &touches(model));
    assert_eq!(recogniser.entries().count(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// The same targets are found from every pose of the held part within the thresholds and every pose of the assembly;
    /// and along each reported freedom all of them stay satisfied.
    #[test]
    fn targets_are_found_from_near_and_freedoms_are_free(
        axis in prop::array::uniform3(-1.0f64..1.0),
        angle in -0.05f64..0.05,
        by in prop::array::uniform3(-0.8f64..0.8),
        world in prop::array::uniform3(-200.0f64..200.0),
        turn in -3.0f64..3.0,
    ) {
        let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::Z);
        let world = DAffine3::from_rotation_translation(DQuat::from_axis_angle(axis.any_orthonormal_vector(), turn), world.into());
        for file in FILES {
            let model = model(file);
            let home: Vec<DAffine3> = poses(model).iter().map(|p| world * *p).collect();
            let middle = home[1].transform_point3(model.shapes[model.parts[1].shape].center_of_mass);
            let off = DAffine3::from_translation(middle + DVec3::from(by))
                * DAffine3::from_quat(DQuat::from_axis_angle(axis, angle))
                * DAffine3::from_translation(-middle);
            let mut seated = new(model);
            see(&mut seated, &home, &touches(model));
            let mut held = new(model);
            see(&mut held, &[home[0], off * home[1]], &touches(model));
            prop_assert_eq!(kinds(&held), kinds(&seated), "{}", file);
            prop_assert_eq!(held.freedom().name(), seated.freedom().name());
            let free = seated.freedom();
            let step = 1e-4;
            let slides = free.slides.iter().map(|d| DAffine3::from_translation(*d * step));
            let turns = free.turns.iter().map(|t| {
                DAffine3::from_translation(t.origin)
                    * DAffine3::from_quat(DQuat::from_axis_angle(t.direction, step))
                    * DAffine3::from_translation(-t.origin)
            });
            for motion in slides.chain(turns) {
                for target in seated.active() {
                    let alignment_error = target.alignment_error(&(motion * home[1]), &home[0]);
                    // Of second order in the step: at most 60 mm · step².
                    prop_assert!(alignment_error.distance_mm < 1e-6 && alignment_error.angle_rad < 1e-7, "{file} {alignment_error:?} {motion:?}");
                }
            }
        }
    }
}
