//! Kinematics against closed forms in double precision, central differences of the model itself, and virtual work.

use glam::{DVec2, DVec3};
use mortise_protocol::rig::{Joint, Mount, RigCeilings};
use proptest::prelude::*;

use super::*;

const JOINT: Joint = Joint {
    counts_per_turn: 10_000.0,
    encoder_on_motor: false,
    encoder_reversed: false,
    gear: 1.0,
    torque_constant: 0.05,
    motor_reversed: false,
    current_limit: 1.0,
    range: [-3.0, 6.0],
    home: 0.0,
    rate_limit: 10.0,
    coulomb: 0.0,
    viscous: 0.0,
    inertia: 1e-4,
};
const WRIST: Wrist = Wrist {
    axes: [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]],
    counts_per_turn: [4096.0; 3],
    home: [0.0; 3],
};
const ARM: Kinematics = Kinematics::SerialArm {
    base_height: 0.08,
    upper: 0.205,
    lower: 0.245,
};
const LINKAGE: Kinematics = Kinematics::Pantograph {
    base: 0.038,
    proximal: [0.07, 0.075],
    distal: [0.09, 0.085],
};
const PADDLE: Kinematics = Kinematics::Paddle { radius: 0.066 };

fn rig(kinematics: Kinematics, home: [f32; 3], turn: [f32; 3]) -> Rig {
    Rig {
        name: "test".try_into().unwrap(),
        kinematics,
        mount: Mount {
            origin: [0.05, 0.02, 0.1],
            turn,
        },
        joints: (0..kinematics.joints())
            .map(|j| Joint {
                home: home[j],
                ..JOINT
            })
            .collect(),
        wrist: Some(WRIST),
        handle_mass: 0.1,
        ceilings: RigCeilings {
            force: 5.0,
            power: 10.0,
            speed: 1.0,
            workspace: 1.0,
        },
    }
}

/// Any mechanism in a usable posture: model and angles.
fn worked() -> impl Strategy<Value = (Model, [f32; 3], [f32; 3])> {
    let part = |from: f32, to: f32| from..to;
    let arm = (part(-1.2, 1.2), part(-0.3, 0.5), part(0.9, 1.9)).prop_map(|(a, b, c)| (ARM, [a, b, c]));
    let linkage = (part(1.8, 2.9), part(0.2, 1.3)).prop_map(|(a, b)| (LINKAGE, [a, b, 0.0]));
    let paddle = part(-3.0, 3.0).prop_map(|a| (PADDLE, [a, 0.0, 0.0]));
    let small = || part(-1.5, 1.5);
    (
        prop_oneof![arm, linkage, paddle],
        [small(), small(), small()],
        [small(), small(), small()],
    )
        .prop_filter_map("singular", |((kinematics, angles), turn, wrist)| {
            let model = Model::new(&rig(kinematics, angles, turn)).ok()?;
            Some((model, angles, wrist))
        })
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

/// The arm's formula in double precision.
fn exact_arm(q: [f64; 3]) -> DVec3 {
    let (a, b, c) = (0.08, f64::from(0.205f32), f64::from(0.245f32));
    let r = b * libm::sin(q[1]) + c * libm::sin(q[2]);
    DVec3::new(
        r * libm::cos(q[0]),
        r * libm::sin(q[0]),
        a + b * libm::cos(q[1]) - c * libm::cos(q[2]),
    )
}

/// Campion, Wang & Hayward 2005 in double precision: the handle from the law of cosines at the left elbow.
fn exact_linkage(q: [f64; 2]) -> DVec2 {
    let elbow =
        |x: f64, l: f32, t: f64| DVec2::new(x + f64::from(l) * libm::cos(t), f64::from(l) * libm::sin(t));
    let half = 0.5 * f64::from(0.038f32);
    let (e1, e2) = (elbow(-half, 0.07, q[0]), elbow(half, 0.075, q[1]));
    let (d1, d2, d) = (f64::from(0.09f32), f64::from(0.085f32), (e2 - e1).length());
    let at = libm::acos((d1 * d1 + d * d - d2 * d2) / (2.0 * d1 * d));
    let line = libm::atan2(e2.y - e1.y, e2.x - e1.x);
    e1 + d1 * DVec2::new(libm::cos(line + at), libm::sin(line + at))
}

/// World of a rig whose mount only moves: x = p − origin.
fn shifted(p: DVec3) -> DVec3 {
    p - DVec3::new(f64::from(0.05f32), f64::from(0.02f32), f64::from(0.1f32))
}

proptest! {
    /// Values stay under 0.6 m, half an ulp of which is 0.03 µm; the linkage adds a quotient and a root of numbers a few times its result.
    #[test]
    fn positions_are_the_closed_forms(a in -1.2f32..1.2, b in -0.3f32..0.5, c in 0.9f32..1.9, l in 1.8f32..2.9, r in 0.2f32..1.3) {
        let arm = Model::new(&rig(ARM, [0.0, 0.0, 1.5], [0.0; 3])).unwrap();
        let found = arm.posture([a, b, c], [0.0; 3]).unwrap().position;
        let exact = shifted(exact_arm([a, b, c].map(f64::from)));
        prop_assert!((found.as_dvec3() - exact).length() < 0.6e-6, "{found} {exact}");
        let linkage = Model::new(&rig(LINKAGE, [2.3, 0.8, 0.0], [0.0; 3])).unwrap();
        if let Some(found) = linkage.posture([l, r, 0.0], [0.0; 3]) && found.isotropy > NONE {
            let exact = shifted(exact_linkage([f64::from(l), f64::from(r)]).extend(0.0));
            prop_assert!((found.position.as_dvec3() - exact).length() < 2e-6, "{} {exact}", found.position);
        }
    }

    /// J and both sets of axes against central differences. With a step of 2⁻⁸ rad the difference errs by h²/6·p''' and by rounding: 0.06 µm·√2/h =
    /// 2·10⁻⁵ m/rad; p''' is at most 0.5 m for the arm and, above isotropy 0.3, 40 m for the linkage: 10⁻⁴ m/rad. Orientations likewise: 2·10⁻⁷/h +
    /// h²/6·|ω|³.
    #[test]
    fn jacobians_are_derivatives((model, q, w) in worked()) {
        const H: f32 = 1.0 / 256.0;
        let posture = model.posture(q, w).unwrap();
        for joint in 0..6 {
            let at = |delta: f32| {
                let (mut q, mut w) = (q, w);
                if joint < 3 { q[joint] += delta } else { w[joint - 3] += delta }
                model.posture(q, w)
            };
            let (Some(ahead), Some(behind)) = (at(H), at(-H)) else { continue };
            let slope = (ahead.position - behind.position) / (2.0 * H);
            let expected = if joint < 3 { posture.jacobian.col(joint) } else { Vec3::ZERO };
            prop_assert!((slope - expected).length() < 4e-4, "joint {joint}: {slope} {expected}");
            let turn = rotation::log_continuous(ahead.orientation * behind.orientation.conjugate(), Vec3::ZERO) / (2.0 * H);
            let expected = if joint < 3 { posture.joint_axes.col(joint) } else { posture.wrist_axes.col(joint - 3) };
            prop_assert!((turn - expected).length() < 1e-3 * (1.0 + expected.length_squared()), "axis {joint}: {turn} {expected}");
        }
    }

    /// Virtual work: τ·θ̇ = F·v. Nine products on each side with a relative rounding of 2⁻²².
    #[test]
    fn torques_do_the_work_of_the_force((model, q, w) in worked(), rates in vector(10.0), force in vector(20.0)) {
        let posture = model.posture(q, w).unwrap();
        let joints = Vec3::from_array(posture.torques(force)).dot(rates);
        let handle = force.dot(posture.velocity(rates.to_array()));
        prop_assert!((joints - handle).abs() < 1e-6 * (1.0 + force.length() * rates.length() * 3.0), "{joints} W against {handle} W");
    }

    /// Isotropy agrees with the eigenvalues of JᵀJ, from its characteristic polynomial in double precision.
    #[test]
    fn orientation_is_a_rotation_and_isotropy_a_share((model, q, w) in worked()) {
        let posture = model.posture(q, w).unwrap();
        prop_assert!((posture.orientation.length_squared() - 1.0).abs() < 1e-6);
        prop_assert!((WHOLE..=1.0).contains(&posture.isotropy));
        prop_assert_eq!(posture.share(), 1.0);
    }

    /// At any angles a force within the limit requires torques within a bound, because the applied share fades before J grows.
    #[test]
    fn no_posture_requires_unbounded_torque(kind in 0..3usize, a in -6.3f32..6.3, b in -6.3f32..6.3, c in -6.3f32..6.3, force in vector(20.0)) {
        let (kinematics, home) = [(ARM, [0.0, 0.0, 1.5]), (LINKAGE, [2.3, 0.8, 0.0]), (PADDLE, [0.0; 3])][kind];
        let model = Model::new(&rig(kinematics, home, [0.0; 3])).unwrap();
        if let Some(posture) = model.posture([a, b, c], [0.0; 3]) {
            let torques = Vec3::from_array(posture.torques(force * posture.share()));
            // Isotropy m bounds the largest singular value by the smallest of n: for two joints σ₁ ≤ (2/m)·σ₂, and σ₂ ≤ √(σ₁σ₂) with the linkage's
            // σ₁σ₂ ≤ l₁l₂ over the sine of the distal links' angle. For the arm J has no column longer than its reach.
            prop_assert!(torques.is_finite() && torques.length() <= 20.0 * 1.733 * 2.0, "{torques}");
        }
    }
}

#[test]
fn a_linkage_that_cannot_close_and_a_stretched_arm_are_refused_in_words_of_their_own() {
    let far = Kinematics::Pantograph {
        base: 0.3,
        proximal: [0.05; 2],
        distal: [0.05; 2],
    };
    let model = |kinematics, home| Model::new(&rig(kinematics, home, [0.0; 3])).map(|_| ());
    assert_eq!(model(far, [1.5, 1.5, 0.0]), Err(RigFault::Linkage));
    // θ₃ = π − θ₂ in one line.
    assert_eq!(
        model(ARM, [0.0, 0.7, core::f32::consts::PI - 0.7]),
        Err(RigFault::Singular)
    );
    assert_eq!(model(ARM, [0.0, 0.0, 1.5]), Ok(()));
    let mut outside = rig(PADDLE, [0.0; 3], [0.0; 3]);
    outside.ceilings.workspace = 0.01;
    assert_eq!(Model::new(&outside).map(|_| ()), Err(RigFault::Workspace));
}

#[test]
fn force_fades_towards_singular_postures_and_is_gone_there() {
    let model = Model::new(&rig(ARM, [0.0, 0.0, 1.5], [0.0; 3])).unwrap();
    let share = |fold: f32| {
        model
            .posture([0.0, 0.5, fold], [0.0; 3])
            .map(|posture| posture.share())
    };
    let straight = core::f32::consts::PI - 0.5;
    assert_eq!(share(1.5), Some(1.0));
    assert_eq!(share(straight), Some(0.0));
    let mut last = 1.0;
    for step in 0..200 {
        let now = share(1.5 + (straight - 1.5) * step as f32 / 200.0).unwrap();
        assert!(now <= last + 1e-6, "{step}");
        last = now;
    }
}
