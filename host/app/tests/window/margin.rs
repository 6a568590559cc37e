//! The stability margin in the running window: of the simulated rig, of a description, and of the rig that is connected.

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use mortise::session::Intent;
use mortise::session::rig_page::RigIntent;
use mortise::ui::Window;
use mortise_protocol::parameter::ParameterId;
use mortise_rig::EXAMPLES;

use crate::common::{click, harness, texts, until};
use crate::rig_page::described;

const SIMULATED: &str = "Stiffness may rise by 3.14 times, from 1000 to 3142 N/m; limited by trembling: dry friction no longer holds the handle between two counts";

fn set(harness: &mut Harness<'_, Window>, id: ParameterId, value: f32) {
    harness.state_mut().session.act(Intent::SetParameter(id, value));
    harness.run_steps(2);
}

#[test]
fn the_setting_has_its_margin_on_the_simulated_rig() {
    let mut harness = harness();
    until(&mut harness, "rigs are listed", |s| !s.rigs.is_empty());
    click(&mut harness, "Connect");
    until(&mut harness, "connected", |s| s.connection().is_some());
    harness.run_steps(2);
    let _ = harness.get_by_label(SIMULATED);
    let _ = harness.get_by_label(&format!("Plane of stability, Translation. {SIMULATED}"));
    assert_eq!(texts(&harness, "Plane of stability, Rotation. ").len(), 1);
    assert_eq!(texts(&harness, "Of the simulated handle. By theory").len(), 1);
    set(&mut harness, ParameterId::CouplingStiffness, 2000.0);
    assert!(
        texts(
            &harness,
            "Stiffness may rise by 1.57 times, from 2000 to 3142 N/m"
        )
        .len()
            == 1
    );
    set(&mut harness, ParameterId::CouplingStiffness, 4000.0);
    assert!(
        texts(
            &harness,
            "Stiffness is 1.27 times too high: 4000 N/m, at most 3142"
        )
        .len()
            == 1
    );
    // Beyond the range the board takes the range's end, and the margin is that of what it takes.
    set(&mut harness, ParameterId::CouplingStiffness, 1e6);
    assert!(texts(&harness, "Stiffness is 1.59 times too high: 5000 N/m").len() == 1);
    harness.get_by_label("Stability margin").click_accesskit();
    harness.run_steps(8);
    assert!(texts(&harness, "Plane of stability").is_empty(), "folded");
}

#[test]
fn the_margin_is_that_of_the_description_and_of_the_board_that_uses_one() {
    let mut harness = harness();
    harness.step();
    let _ = harness.get_by_label(SIMULATED);
    let (_, text) = EXAMPLES[0];
    harness
        .state_mut()
        .session
        .act(Intent::Rig(RigIntent::Edit(text.to_owned())));
    harness.run_steps(2);
    assert_eq!(texts(&harness, "Of hapkit. ").len(), 1);
    let real = texts(&harness, "Stiffness may rise by 1.");
    assert!(
        real.iter()
            .any(|label| label.ends_with("limited by oscillation of the sampled loop")),
        "{real:?}"
    );
    assert_eq!(texts(&harness, "No motor turns this handle").len(), 1);
    assert!(
        texts(&harness, "0.0664 kg, 0.116 N·s/m")
            .iter()
            .all(|basis| basis.ends_with("force 1 tick late"))
    );
    // A simulation of the same mechanism renders in time, and bears more.
    let harness = described("hapkit");
    assert_eq!(texts(&harness, "Of hapkit. ").len(), 1);
    let basis = texts(&harness, "0.0664 kg, 0.116 N·s/m");
    assert!(
        basis.len() == 1 && basis[0].ends_with("force in time"),
        "{basis:?}"
    );
    assert!(texts(&harness, "Stiffness may rise by 1.").is_empty());
}
