//! Direction, magnitude and steps of the force against closed form: a cylinder slid over a cube's edge (after Yu, Wang et al. 2015), a ball revolved about
//! a cylinder and a block's corner slid across a plate (after Weller, Sagardia et al. 2010).
//!
//! The handle moves so slowly that the part is at rest: the force is the coupling's, F = k_T·(c − h), c the part's centre and h the handle. About an
//! edge, or the axis of a round part, contact pushes along n from there to c, so that E, h and c lie on one line and F = k_T·(r − |h − E|)·n, less
//! the compliance of contacts, k_T/k ≤ 0.5 %.

use glam::{DAffine3, DQuat, DVec3, Vec3};
use mortise_haptics::Settings;

use super::two_solids::{HELD, baked, cuboid};
use crate::LabError;
use crate::convex::Convex;
use crate::driven::{HandlePath, Image, drive};
use crate::figures::{Plan, Row};

/// Radius and half length of the round parts, half edge of the cube, radius of the standing cylinder, mm.
const RADIUS_MM: f64 = 5.0;
const HALF_MM: f64 = 15.0;
const CUBE_MM: f64 = 10.0;
const POST_MM: f64 = 12.0;
/// Distance by which the handle is beyond first contact, mm: 4 N.
const PRESS_MM: f64 = 4.0;
/// Speed of the handle, mm/s.
const SPEED: f64 = 2.0;
/// The same over the edge. The part turns about the edge with the handle, five times as far from it, so the coupling's damper, 20 N s/m, pulls it back by
/// 80 N s/m times the handle's speed. Across the way only k_T·|h − E|/|c − E| = 200 N/m hold it there: at 0.1 mm/s it lags by 40 µm, which turns
/// the force by 0.46° and is no error of contact; at 0.5 mm/s by 2.3°.
const EDGE_SPEED: f64 = 0.1;
/// Height of the start above contact, mm, and the time until the part rests on the other, s.
const START_MM: f64 = 3.0;
const SETTLE_S: f64 = 1.0;
/// Time after the slide begins from which it is judged, s: the coupling's damper answers the jump in speed within some 10 ms.
const BEGUN_S: f64 = 0.2;
/// Half edges of the plate, mm.
const PLATE_MM: [f64; 3] = [30.0, 30.0, 10.0];
/// Smallest force whose direction is judged, N.
const LEAST_N: f64 = 1.0;
/// Rows of each scene: largest errors.
const DIRECTION_DEG: f64 = 1.0;
const MAGNITUDE_PERCENT: f64 = 2.0;
const STEP_N: f64 = 0.05;

/// Largest errors of a scene.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    judged: usize,
    direction_deg: f64,
    /// Place of the handle where the direction is worst, mm.
    worst_mm: DVec3,
    magnitude_percent: f64,
    step_n: f64,
    torque_deg: Option<f64>,
    made_mj: f64,
    last: Option<DVec3>,
}

/// Force by closed form, mm of the coupling's stretch, at a place of the handle, mm, and a pose of the part.
type Expected = Box<dyn Fn(DVec3, &DAffine3) -> DVec3>;
/// Arm of the contact from the part's centre at a pose, mm.
type Arm = Box<dyn Fn(&DAffine3) -> DVec3>;

/// A scene: fixed and held solid, the held one's placement, the path, the expected force, and the arm of the contact where its torque is judged.
struct Slide {
    what: &'static str,
    speed: f64,
    fixed: Convex,
    held: Convex,
    start: DAffine3,
    path: HandlePath,
    expected: Expected,
    arm: Option<Arm>,
}

/// Measures the rows.
pub(super) fn measure(_: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    for slide in [over_an_edge()?, about_a_post(), corner_on_a_plate()?] {
        let errors = played(&slide)?;
        let what = |what: &str| format!("{}, {} mm/s, pressed with 4 N: {what}", slide.what, slide.speed);
        out(Row::at_most(
            what(&format!(
                "direction of the force on the handle (worst at {:.2} mm)",
                errors.worst_mm
            )),
            errors.direction_deg,
            "°",
            DIRECTION_DEG,
        ));
        out(Row::at_most(
            what("its magnitude"),
            errors.magnitude_percent,
            "%",
            MAGNITUDE_PERCENT,
        ));
        out(Row::at_most(
            what("step of the force between ticks"),
            errors.step_n,
            "N",
            STEP_N,
        ));
        if let Some(torque_deg) = errors.torque_deg {
            let torque = what("direction of the torque of contacts");
            out(Row::at_most(torque, torque_deg, "°", DIRECTION_DEG));
        }
        let made = what("energy generated at the handle over any interval");
        out(Row::at_most(made, errors.made_mj, "mJ", 1.0));
        out(Row::within(
            what("ticks judged"),
            errors.judged as f64,
            "ticks",
            500.0,
            f64::INFINITY,
        ));
    }
    Ok(())
}

/// The cylinder's axis is along the edge, which is at the cube's upper right.
fn over_an_edge() -> Result<Slide, LabError> {
    let edge = DVec3::new(CUBE_MM, 0.0, CUBE_MM);
    let lying = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let from = edge + DVec3::new(-6.0, 0.0, RADIUS_MM);
    let pressed = from - DVec3::Z * PRESS_MM;
    let to = pressed + DVec3::X * 12.0;
    Ok(Slide {
        what: "cylinder slid over a cube's edge",
        speed: EDGE_SPEED,
        fixed: cuboid(DVec3::splat(CUBE_MM))?,
        held: Convex::Cylinder {
            radius: RADIUS_MM,
            half: HALF_MM,
        },
        start: DAffine3::from_rotation_translation(lying, from + DVec3::Z * START_MM),
        path: HandlePath::from(from + DVec3::Z * START_MM, DQuat::IDENTITY)
            .ease(SETTLE_S, pressed, DQuat::IDENTITY)
            .then(SETTLE_S, pressed, DQuat::IDENTITY)
            .then(to.distance(pressed) / EDGE_SPEED, to, DQuat::IDENTITY),
        expected: Box::new(move |handle, _| {
            // On the flat the nearest point of the cube is below the handle.
            let nearest = DVec3::new(handle.x.min(edge.x), handle.y, edge.z);
            let from = handle - nearest;
            from.normalize() * (RADIUS_MM - from.length()).max(0.0)
        }),
        arm: None,
    })
}

/// The ball goes round the post at half of its height.
fn about_a_post() -> Slide {
    let near = POST_MM + RADIUS_MM;
    let path = HandlePath::from(DVec3::X * (near + START_MM), DQuat::IDENTITY)
        .ease(SETTLE_S, DVec3::X * (near - PRESS_MM), DQuat::IDENTITY)
        .then(SETTLE_S, DVec3::X * (near - PRESS_MM), DQuat::IDENTITY);
    // Chords of 1° are nearer to the axis than the circle by 2 µm.
    let path = (1..=90).fold(path, |path, degrees| {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let at = (near - PRESS_MM) * DVec3::new(cos, sin, 0.0);
        path.then((near - PRESS_MM) * 1f64.to_radians() / SPEED, at, DQuat::IDENTITY)
    });
    Slide {
        what: "ball revolved about a cylinder",
        speed: SPEED,
        fixed: Convex::Cylinder {
            radius: POST_MM,
            half: HALF_MM,
        },
        held: Convex::Ball { radius: RADIUS_MM },
        start: DAffine3::from_translation(DVec3::X * (near + START_MM)),
        path,
        expected: Box::new(move |handle, _| {
            let out = DVec3::new(handle.x, handle.y, 0.0);
            out.normalize() * (near - out.length())
        }),
        arm: None,
    }
}

/// A block turned so that one of its corners is lowest; the coupling's angular spring lets it turn on, so the contact's arm is that of its pose.
fn corner_on_a_plate() -> Result<Slide, LabError> {
    let block = cuboid(DVec3::new(9.0, 6.0, 4.0))?;
    let turn = DQuat::from_scaled_axis(DVec3::new(0.5, 0.4, 0.0));
    let lowest = {
        let block = block.clone();
        move |turn: DQuat| turn * block.support(turn.inverse() * -DVec3::Z)
    };
    let height = PLATE_MM[2] - lowest(turn).z;
    let at = |x: f64, z: f64| DVec3::new(x, 0.5 * x, z);
    let pressed = at(-4.0, height - PRESS_MM);
    let path = HandlePath::from(at(-4.0, height + START_MM), DQuat::IDENTITY)
        .ease(SETTLE_S, pressed, DQuat::IDENTITY)
        .then(SETTLE_S, pressed, DQuat::IDENTITY)
        .then(8.0 / SPEED, at(4.0, height - PRESS_MM), DQuat::IDENTITY);
    let down = lowest.clone();
    Ok(Slide {
        what: "corner of a block slid across a plate",
        speed: SPEED,
        fixed: cuboid(DVec3::from_array(PLATE_MM))?,
        start: DAffine3::from_rotation_translation(turn, at(-4.0, height + START_MM)),
        path,
        held: block,
        expected: Box::new(move |handle, pose| {
            let corner = down(DQuat::from_mat3(&pose.matrix3));
            DVec3::Z * (PLATE_MM[2] - corner.z - handle.z)
        }),
        arm: Some(Box::new(move |pose| lowest(DQuat::from_mat3(&pose.matrix3)))),
    })
}

fn played(slide: &Slide) -> Result<Errors, LabError> {
    let image: Image = baked(&slide.fixed, &slide.held, slide.start)?;
    let settings = Settings::default();
    // N/mm is kN/m.
    let stiffness = 1e-3 * f64::from(settings.coupling.k_t_n_per_m);
    let mut errors = Errors {
        torque_deg: slide.arm.as_ref().map(|_| 0.0),
        ..Errors::default()
    };
    let made = drive(&image.scene()?, HELD, &settings, &slide.path, &mut |seen| {
        if seen.t_s < 2.0 * SETTLE_S + BEGUN_S {
            return;
        }
        let force = double(seen.out.handle.force);
        if let Some(last) = errors.last.replace(force) {
            errors.step_n = errors.step_n.max(force.distance(last));
        }
        let expected = stiffness * (slide.expected)(seen.handle_mm, &seen.object);
        if expected.length() < LEAST_N {
            return;
        }
        errors.judged += 1;
        let off = degrees(force, expected);
        if off > errors.direction_deg {
            (errors.direction_deg, errors.worst_mm) = (off, seen.handle_mm);
        }
        let share = (force.length() / expected.length() - 1.0).abs();
        errors.magnitude_percent = errors.magnitude_percent.max(100.0 * share);
        if let (Some(arm), Some(worst)) = (&slide.arm, &mut errors.torque_deg) {
            let torque = arm(&seen.object).cross(expected);
            *worst = worst.max(degrees(double(seen.out.contact.torque), torque));
        }
    })?;
    errors.made_mj = 1e3 * made.handle_j;
    Ok(errors)
}

fn double(v: Vec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(f64::from))
}

/// Angle between two vectors; that of no force is the largest.
fn degrees(a: DVec3, b: DVec3) -> f64 {
    if a.length() > 0.0 && b.length() > 0.0 {
        a.angle_between(b).to_degrees()
    } else {
        180.0
    }
}
