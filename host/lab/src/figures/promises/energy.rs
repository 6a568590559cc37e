//! Energy that targets give to the operator, by the observer outside the law: see `mortise_haptics::observer` for the account.

use std::thread;

use mortise_bake::Grabbable;
use mortise_haptics::Settings;
use mortise_protocol::image::SceneImage;
use mortise_scenario::{PreparedScene, Scenario};

use super::{Plan, Row};
use crate::LabError;
use crate::fit::Fit;
use crate::variant::Variant;

#[path = "../../../../../firmware/haptics/tests/support/trial.rs"]
mod trial;

use trial::{Bench, Seen, play};

/// Largest energy beyond what the hand supplied, µJ.
const MOST_UJ: f64 = 10.0;
/// Number of sequences in the full form and in the shorter one, and ticks of each.
const SEQUENCES: u64 = 10_000;
const SEQUENCES_QUICK: u64 = 400;
const TICKS: u32 = 2000;
/// Clearance of the peg in its hole, mm; its depth at the start, or height above; and the range of the hand, m.
const CLEARANCE_MM: f64 = 1.0;
const PLACES: [(f64, f64); 2] = [(10.0, 3e-3), (-40.0, 30e-3)];

pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let scenes = PLACES.map(|(engaged_mm, _)| Scene::bake(engaged_mm));
    let [hole, above] = scenes;
    let scenes = [hole?, above?];
    let count = if plan.quick { SEQUENCES_QUICK } else { SEQUENCES };
    let seen = sequences(&scenes, count)?;
    for (moving, hand) in [(false, "resting"), (true, "moving")] {
        let of: Vec<&Seen> = seen.iter().filter(|seen| seen.moving == moving).collect();
        let worst = of.iter().map(|seen| 1e6 * seen.given_j).fold(f64::NAN, f64::max);
        out(Row::at_most(
            format!(
                "energy given to a {hand} hand beyond what it brought, every accepted target, both methods, worst of {count} random sequences to hands of both kinds, outside observer ({} of them)",
                of.len()
            ),
            worst,
            "µJ",
            MOST_UJ,
        ));
    }
    Ok(())
}

/// Plays the sequences on as many threads as there are cores: a sequence depends only on its seed.
fn sequences(scenes: &[Scene; 2], count: u64) -> Result<Vec<Seen>, LabError> {
    let threads = thread::available_parallelism().map_or(1, usize::from) as u64;
    thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|worker| {
                scope.spawn(move || -> Result<Vec<Seen>, LabError> {
                    let open = [scenes[0].open()?, scenes[1].open()?];
                    let seeds = (worker..count).step_by(threads as usize);
                    Ok(seeds.map(|seed| one(scenes, &open, seed)).collect())
                })
            })
            .collect();
        let mut all = Vec::new();
        for worker in workers {
            match worker.join() {
                Ok(seen) => all.extend(seen?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok(all)
    })
}

fn one(scenes: &[Scene; 2], open: &[SceneImage<'_>; 2], seed: u64) -> Seen {
    let place = (seed % 2) as usize;
    let part = scenes[place].part;
    let bench = Bench {
        scene: &open[place],
        part,
        fixed: u16::from(part == 0),
        range: PLACES[place].1,
        ticks: TICKS,
        guided: true,
    };
    play(&bench, &Settings::default(), seed)
}

/// A baked block and peg.
struct Scene {
    words: Vec<u32>,
    part: u16,
}

impl Scene {
    fn bake(engaged_mm: f64) -> Result<Self, LabError> {
        let file = Fit::thesis(CLEARANCE_MM).engaged(engaged_mm).file()?;
        let scenario = Scenario::insertion(file.path())?;
        let options = Variant::field(0.5).options(Grabbable::Named(vec![scenario.scene.part.clone()]));
        let scene = PreparedScene::with(&scenario, &options)?;
        let mut words = vec![0u32; scene.image.len().div_ceil(4)];
        bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..scene.image.len()].copy_from_slice(&scene.image);
        Ok(Self {
            words,
            part: scene.part,
        })
    }

    fn open(&self) -> Result<SceneImage<'_>, LabError> {
        SceneImage::open(bytemuck::cast_slice(&self.words)).map_err(|error| LabError::Input {
            name: "pair".into(),
            what: error.to_string(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_are_given_no_more_than_they_brought() {
        let scenes = PLACES.map(|(engaged_mm, _)| Scene::bake(engaged_mm).expect("baked"));
        let seen = sequences(&scenes, 40).expect("played");
        assert_eq!(seen.len(), 40);
        let engaged = seen.iter().filter(|seen| seen.engaged > 0.5).count();
        assert!(engaged > 20, "{engaged}");
        for seen in &seen {
            assert!(1e6 * seen.given_j <= MOST_UJ, "{seen:?}");
        }
    }
}
