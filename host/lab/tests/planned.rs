//! Planned images of scene P are as small as asked, and the probe's gaps and depths in them err by no more than the plan states.

use std::ops::ControlFlow;

use mortise_bake::{Grabbable, Request, plan};
use mortise_brep::LoadOptions;
use mortise_lab::scene_p;
use mortise_scenario::probe::ProbeScene;

#[test]
fn scene_p_errs_by_no_more_than_its_plan_states() {
    let model = scene_p::model(&LoadOptions::default()).expect("the sources contain it");
    for (accuracy_um, kib) in [(5.0, 32), (20.0, 20)] {
        let request = Request {
            accuracy_mm: accuracy_um / 1000.0,
            flash_bytes: 512 << 10,
            tick_instructions: None,
            grabbable: Grabbable::All,
        };
        let planned = plan(&model, &request, &|_| ControlFlow::Continue(())).expect("it bakes");
        assert!(
            planned.met && planned.image.len() <= kib << 10,
            "{}",
            planned.image.len()
        );
        let parts = planned.plan.report.parts.iter().map(|part| part.name.clone());
        let scene = ProbeScene::of_image("scene P".into(), &planned.image, parts.collect());
        let pair = scene.pair("peg", Some("block")).expect("both are there");
        let (fits, elsewhere) = (planned.plan.error_in_fits_mm(), planned.plan.error_elsewhere_mm());
        let mut worst = [0.0f64; 2];
        for case in scene_p::cases() {
            let row = scene.probe(pair, &case.pose).expect("a pose");
            let error = (row.distance_mm - case.exact_mm).abs();
            // Parallel in the hole, with the gap still open.
            let fitted = case.pose.name.contains("aside at") && case.exact_mm >= 0.0;
            let (at, stated) = if fitted {
                (&mut worst[0], fits)
            } else {
                (&mut worst[1], elsewhere)
            };
            *at = at.max(error);
            assert!(
                error <= stated,
                "{}: errs by {error} mm, stated {stated}",
                case.pose.name
            );
        }
        println!(
            "{accuracy_um} µm: {} bytes; in the hole and elsewhere errors up to {worst:?} mm, stated {fits} and {elsewhere}",
            planned.image.len()
        );
    }
}
