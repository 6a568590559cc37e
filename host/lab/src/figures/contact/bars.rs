//! Crossing bars: one laid across another, pressed with 10 N, then slid and rolled.

use glam::{DAffine3, DQuat, DVec3};
use mortise_haptics::Settings;

use super::two_solids::{HELD, baked, cuboid};
use crate::LabError;
use crate::convex::Convex;
use crate::driven::{HandlePath, Image, Made, drive};
use crate::figures::{Plan, Row};
use crate::parallel::trials;
use crate::separation::signed_distance_mm;

/// Length of the bars, mm, and their widths: square sections.
const LENGTH_MM: f64 = 200.0;
const WIDTHS_MM: [f64; 8] = [1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0];
const WIDTHS_QUICK_MM: [f64; 3] = [1.0, 4.0, 10.0];
/// Runs of each width.
const RUNS: usize = 60;
const RUNS_QUICK: usize = 20;
/// Deepest overlap, mm: what 10 N on one point of 200 kN/m make.
const DEEPEST_MM: f64 = 0.05;
/// Height of the start above the fixed bar, mm.
const START_MM: f64 = 20.0;
/// How far the handle is pressed below first contact, mm: 10 N at the coupling's 1 N/mm, which is also the most that it transmits.
const PRESS_MM: f64 = 10.0;
/// Part of that which is pressed slowly, mm, and the time, s: the coupling's damper adds 20 N s/m.
const SLOW_MM: f64 = 3.0;
const SLOW_S: f64 = 0.5;

/// A run's result.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    width_mm: f64,
    /// Least translation that would separate the bars, largest over all ticks, mm.
    deepest_mm: f64,
    /// Largest force of contacts, N: that the bar was pressed.
    force_n: f64,
    made: Made,
}

/// Measures the rows.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (widths, runs): (&[f64], usize) = if plan.quick {
        (&WIDTHS_QUICK_MM, RUNS_QUICK)
    } else {
        (&WIDTHS_MM, RUNS)
    };
    let images: Vec<(f64, Image)> = trials(widths.len(), |index| Ok((widths[index], laid(widths[index])?)))?;
    let all = trials(widths.len() * runs, |index| {
        let (width, image) = &images[index / runs];
        crossing(*width, image, index as u64)
    })?;
    for of_width in all.chunks(runs) {
        let deepest = of_width.iter().map(|run| run.deepest_mm).fold(0.0, f64::max);
        let deep = of_width.iter().filter(|run| run.deepest_mm > DEEPEST_MM).count();
        eprintln!(
            "bars of {} mm: deepest {:.1} µm, over 50 µm in {deep}, through in {} of {runs}, most force {:.1} N, made {:.2} mJ",
            of_width[0].width_mm,
            1e3 * deepest,
            of_width.iter().filter(|run| run.through()).count(),
            of_width.iter().map(|run| run.force_n).fold(0.0, f64::max),
            1e3 * of_width.iter().map(|run| run.made.handle_j).fold(0.0, f64::max)
        );
    }
    let what = |what: &str| {
        format!(
            "bars of 200 mm, {widths:?} mm wide, laid crosswise, {runs} runs each, pressed with 10 N, slid and rolled: {what}"
        )
    };
    let most = |of: fn(&Crossing) -> f64| all.iter().map(of).fold(0.0, f64::max);
    let deepest = 1e3 * most(|run| run.deepest_mm);
    out(Row::at_most(
        what("deepest overlap"),
        deepest,
        "µm",
        1e3 * DEEPEST_MM,
    ));
    let through = all.iter().filter(|run| run.through()).count();
    out(Row::exactly(
        what("through, past the middle"),
        through as f64,
        "runs",
        0.0,
    ));
    let made = 1e3 * most(|run| run.made.handle_j);
    out(Row::at_most(
        what("energy generated at the handle over any interval"),
        made,
        "mJ",
        1.0,
    ));
    let least = all.iter().map(|run| run.force_n).fold(f64::INFINITY, f64::min);
    out(Row::within(
        what("smallest of the runs' largest contact forces"),
        least,
        "N",
        5.0,
        f64::INFINITY,
    ));
    Ok(())
}

impl Crossing {
    fn through(&self) -> bool {
        self.deepest_mm > 0.5 * self.width_mm
    }
}

/// A bar along x.
fn bar(width: f64) -> Result<Convex, LabError> {
    cuboid(DVec3::new(0.5 * LENGTH_MM, 0.5 * width, 0.5 * width))
}

/// Turn of the moving bar in the file.
fn across() -> DQuat {
    DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2)
}

/// Height of the moving bar in the file, mm.
fn start_mm(width: f64) -> f64 {
    width + START_MM
}

fn laid(width: f64) -> Result<Image, LabError> {
    let bar = bar(width)?;
    let above = DAffine3::from_rotation_translation(across(), DVec3::Z * start_mm(width));
    baked(&bar, &bar, above)
}

/// One run: to a random place and angle above the fixed bar, down, slid and rolled.
fn crossing(width: f64, image: &Image, seed: u64) -> Result<Crossing, LabError> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut within = |most: f64| most * (2.0 * random.f64() - 1.0);
    let along = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    // The grip is up to 10 mm beside the fixed bar, off the middle of which it is by up to 60 mm.
    let (x, y) = (within(60.0), within(10.0));
    let yaw = DQuat::from_rotation_z(within(0.5));
    let tilt = DQuat::from_rotation_x(within(0.05)) * DQuat::from_rotation_y(within(0.3));
    let roll = DQuat::from_rotation_y(within(0.8));
    let low = width - PRESS_MM;
    let slide = along(within(30.0), within(8.0), 0.0);
    let start = along(0.0, 0.0, start_mm(width));
    // 20 to 60 mm/s.
    let speed = 20.0 * 3f64.powf(0.5 * (1.0 + within(1.0)));
    let [above, near, down] = [start.z, low + SLOW_MM, low].map(|z| along(x, y, z));
    let turned = yaw * tilt;
    let path = HandlePath::from(start, DQuat::IDENTITY)
        .ease(0.2, above, turned)
        .then((above.z - near.z) / speed, near, turned)
        .ease(SLOW_S, down, turned)
        .ease(0.4, down + slide, turned)
        .ease(0.4, down + slide, yaw * roll * tilt)
        .ease(0.4, down - slide, yaw * roll.inverse() * tilt)
        .ease(0.2, down, turned);
    let scene = image.scene()?;
    let solid = bar(width)?;
    let (mut deepest_mm, mut force_n) = (0.0f64, 0.0f64);
    let made = drive(&scene, HELD, &Settings::default(), &path, &mut |seen| {
        // Beyond the corners' reach the bars are apart.
        if seen.object.translation.z < 2.0 * start_mm(width) {
            deepest_mm = deepest_mm.max(-signed_distance_mm(&solid, &solid, &seen.object));
        }
        force_n = force_n.max(f64::from(seen.out.contact.force.length()));
    })?;
    Ok(Crossing {
        width_mm: width,
        deepest_mm,
        force_n,
        made,
    })
}
