//! Time and error of a distance query: ours beside other libraries, on the same parts, at the same poses, in the same run.
//!
//! Scenes: the thesis pair ([`crate::scene_p`]), crossing bars, and the pairs of free-form and planar fits of the shared test parts where this
//! machine has them. Ours is [`mortise_scenario::probe`], which answers with the contacts as well; parry runs in this process, the others through
//! their Python packages (`python.rs`). Meshes are the kernel's tessellation at a stated deflection. Each query is repeated and its shortest time
//! counts, since other load on the computer only lengthens it; median and worst are over the poses. One thread.

mod charts;
mod entry;
mod method;
mod own;
mod python;
mod scene;

use mortise_brep::{LoadOptions, load_step_with};

use crate::error::LabError;
use crate::experiment::{Experiment, Findings, Form, Report};
use entry::Entry;
use method::{Asked, Method};
use own::{Bake, DEFAULT};
use scene::Scene;

/// Largest deviation of scene P's meshes from the surfaces, mm; the quick form uses the first.
const THESIS_DEFLECTIONS_MM: [f64; 2] = [0.01, 0.001];
/// The same of all other scenes, mm: half of the smallest clearance among them. Finer meshes of splines have so many triangles that queries of
/// triangles take seconds.
const DEFLECTION_MM: f64 = 0.01;
/// Cells of a second bake of scene P, mm.
const FINE_CELLS_MM: f64 = 0.5;

/// The experiment `peers`.
pub struct Peers;

impl Experiment for Peers {
    fn name(&self) -> &'static str {
        "peers"
    }

    fn about(&self) -> &'static str {
        "Compare time and error of a query with other libraries; `cargo xtask peers` installs them and starts this"
    }

    fn quick(&self) -> &'static str {
        "scene P and crossing bars on one mesh each"
    }

    fn rows(&self) -> Vec<String> {
        vec!["peers".into()]
    }

    fn charts(&self) -> Vec<String> {
        ["peers", "peers-depths", "peers-free-form"]
            .map(String::from)
            .into()
    }

    fn run(&self, form: Form<'_>, report: &mut Report<'_>) -> Result<Findings, LabError> {
        let mut entries = Vec::new();
        let mut tell = |entry: Entry| {
            report(&entry);
            entries.push(entry);
        };
        let thesis = scene::thesis_pair()?;
        measure(
            &thesis,
            &[Bake::Default, Bake::Cells(FINE_CELLS_MM)],
            if form.quick {
                &THESIS_DEFLECTIONS_MM[..1]
            } else {
                &THESIS_DEFLECTIONS_MM
            },
            &mut tell,
        )?;
        let mut others = vec![scene::crossing_bars()?];
        if !form.quick {
            match scene::shared_pairs()? {
                Some(pairs) => others.extend(pairs),
                None => tell(Entry::skipped(
                    "free-form and planar fits",
                    "the shared test parts are not on this machine",
                )),
            }
        }
        for pair in &others {
            measure(pair, &[Bake::Default, Bake::Planned], &[DEFLECTION_MM], &mut tell)?;
        }
        let findings = Findings::default()
            .rows("peers", &entries)?
            .chart("peers", charts::gaps(&entries))
            .chart("peers-depths", charts::depths(&entries));
        Ok(match charts::free_form(&entries) {
            Some(chart) => findings.chart("peers-free-form", chart),
            None => findings,
        })
    }
}

/// Asks every method on a scene; the default bake comes first, since others are compared with it.
fn measure(
    scene: &Scene,
    bakes: &[Bake],
    deflections_mm: &[f64],
    tell: &mut dyn FnMut(Entry),
) -> Result<(), LabError> {
    let mut ours = None;
    let mut judge = |asked: Asked| {
        let mut entry = Entry::of(&scene.name, &scene.cases, &asked);
        if entry.method == DEFAULT {
            ours = entry.median_us;
        }
        entry.over_ours = (entry.median_us.zip(ours)).map(|(median, ours)| median / ours);
        tell(entry);
    };
    for bake in bakes {
        judge(or_skip("mortise", &bake.name(), own::probe(scene, *bake)));
    }
    for &deflection in deflections_mm {
        let options = LoadOptions {
            linear_deflection_mm: Some(deflection),
            // The angle has no effect: the deflection alone determines the mesh.
            angular_deflection_rad: 1.0,
            ..LoadOptions::default()
        };
        let model = load_step_with(scene.step(), &options)?;
        judge(or_skip(
            "parry",
            "parry, triangles",
            own::parry(scene, &model, deflection),
        ));
        python::ask(scene, &model, deflection)?
            .into_iter()
            .for_each(&mut judge);
    }
    Ok(())
}

/// An error of one method is a skip with its reason: the others are still compared.
fn or_skip(peer: &str, name: &str, found: Result<Method, LabError>) -> Asked {
    match found {
        Ok(method) => Asked::Answered(method),
        Err(error) => Asked::Skipped {
            peer: peer.into(),
            name: name.into(),
            reason: error.to_string(),
        },
    }
}
