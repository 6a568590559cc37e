//! Blows on thin plates: a ball and a block's corner or face, driven onto a plate and on beyond it.

use glam::{DAffine3, DQuat, DVec3};
use mortise_haptics::Settings;

use super::two_solids::{HELD, baked, cuboid};
use crate::LabError;
use crate::convex::Convex;
use crate::driven::{HandlePath, Image, drive};
use crate::figures::{Plan, Row};
use crate::parallel::trials;

/// Plate: half edges, mm, and thicknesses, mm.
const PLATE_MM: [f64; 2] = [31.0, 17.0];
const THICK_MM: [f64; 3] = [0.2, 0.5, 1.0];
/// Radius of the ball and half edges of the block, mm.
const BALL_MM: f64 = 5.0;
const BLOCK_MM: [f64; 3] = [6.0, 5.0, 4.0];
/// Blows in all, in the full and in the shorter form.
const BLOWS: usize = 10_000;
const BLOWS_QUICK: usize = 600;
/// Speeds, m/s, drawn evenly in their logarithm.
const SPEEDS: [f64; 2] = [0.02, 1.5];
/// Height of the start above the plate's middle, mm, and the handle's end below it, mm: 5 N on the part at rest.
const START_MM: f64 = 25.0;
const BEYOND_MM: f64 = 5.0;
/// Time in which the part reaches its start, and in which the handle stays at its end, s.
const READY_S: f64 = 0.15;
const STAY_S: f64 = 0.1;

/// A plate and a striker.
struct Target {
    thick_mm: f64,
    ball: bool,
    striker: Convex,
    image: Image,
}

/// A blow's result.
struct Blow {
    thick_mm: f64,
    /// How far the striker's lowest point above the plate was below its upper face, largest, mm.
    deepest_mm: f64,
    /// Largest contact force, N.
    force_n: f64,
}

impl Blow {
    fn through(&self) -> bool {
        self.deepest_mm > self.thick_mm
    }
}

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let blows = if plan.quick { BLOWS_QUICK } else { BLOWS };
    let targets = trials(2 * THICK_MM.len(), |index| {
        Target::baked(THICK_MM[index / 2], index % 2 == 0)
    })?;
    let all = trials(blows, |index| blow(&targets[index % targets.len()], index as u64))?;
    for thick in THICK_MM {
        let of_plate = || all.iter().filter(|blow| blow.thick_mm == thick);
        eprintln!(
            "plate of {thick} mm: {} of {} through, deepest of the others {:.1} µm",
            of_plate().filter(|blow| blow.through()).count(),
            of_plate().count(),
            1e3 * of_plate()
                .filter(|blow| !blow.through())
                .map(|blow| blow.deepest_mm)
                .fold(0.0, f64::max)
        );
    }
    let what = |what: &str| {
        format!(
            "{blows} blows of a ball and a block on plates of {THICK_MM:?} mm, to 1.5 m/s, flat and tilted: {what}"
        )
    };
    let through = all.iter().filter(|blow| blow.through()).count();
    out(Row::exactly(what("through"), through as f64, "blows", 0.0));
    let felt = all.iter().filter(|blow| blow.force_n > 1.0).count();
    out(Row::within(
        what("felt with 1 N or more"),
        100.0 * felt as f64 / blows as f64,
        "%",
        95.0,
        100.0,
    ));
    Ok(())
}

impl Target {
    fn baked(thick_mm: f64, ball: bool) -> Result<Self, LabError> {
        let plate = cuboid(DVec3::new(PLATE_MM[0], PLATE_MM[1], 0.5 * thick_mm))?;
        let striker = if ball {
            Convex::Ball { radius: BALL_MM }
        } else {
            cuboid(DVec3::from_array(BLOCK_MM))?
        };
        let above = DAffine3::from_translation(DVec3::Z * START_MM);
        Ok(Self {
            thick_mm,
            ball,
            image: baked(&plate, &striker, above)?,
            striker,
        })
    }
}

/// One blow, at random: flat, or tilted with a corner or an edge first, straight down or up to 30° off.
fn blow(target: &Target, seed: u64) -> Result<Blow, LabError> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut within = |most: f64| most * (2.0 * random.f64() - 1.0);
    let flat = within(1.0) > 0.5;
    let turn = if flat {
        DQuat::from_rotation_z(within(3.0))
    } else {
        DQuat::from_scaled_axis(DVec3::new(within(2.0), within(2.0), within(2.0)))
    };
    let lowest = -(turn * target.striker.support(turn.inverse() * -DVec3::Z)).z;
    let [low, high] = SPEEDS;
    let speed_mm = 1e3 * low * (high / low).powf(0.5 * (1.0 + within(1.0)));
    let slant = if flat {
        DVec3::ZERO
    } else {
        DVec3::new(within(0.4), within(0.4), 0.0)
    };
    // Well within the plate, so that no blow goes past it.
    let place = DVec3::new(within(PLATE_MM[0] - 15.0), within(PLATE_MM[1] - 12.0), 0.0);
    let touching = place + DVec3::Z * (0.5 * target.thick_mm + lowest);
    let along = |height: f64| touching + (DVec3::Z + slant) * height;
    let (above, below) = (along(START_MM - 10.0), along(-BEYOND_MM));
    let path = HandlePath::from(DVec3::Z * START_MM, DQuat::IDENTITY)
        .ease(READY_S, above, turn)
        .then(above.distance(below) / speed_mm, below, turn)
        .then(STAY_S, below, turn);
    let scene = target.image.scene()?;
    let (mut deepest_mm, mut force_n, mut last_mm) = (f64::NEG_INFINITY, 0.0f64, f64::NAN);
    drive(&scene, HELD, &Settings::default(), &path, &mut |seen| {
        let down = seen.object.matrix3.transpose() * -DVec3::Z;
        let lowest = seen.object.transform_point3(target.striker.support(down));
        last_mm = 0.5 * target.thick_mm - lowest.z;
        deepest_mm = deepest_mm.max(last_mm);
        force_n = force_n.max(f64::from(seen.out.contact.force.length()));
    })?;
    if deepest_mm > target.thick_mm {
        let what = if target.ball { "ball" } else { "block" };
        eprintln!(
            "{what} through {} mm at {speed_mm:.0} mm/s, flat {flat}, seed {seed}: {deepest_mm:.3} mm, {last_mm:.3} mm at the end",
            target.thick_mm
        );
    }
    Ok(Blow {
        thick_mm: target.thick_mm,
        deepest_mm,
        force_n,
    })
}
