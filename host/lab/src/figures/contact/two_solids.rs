//! Two convex solids as a scene: one fixed at the origin, one held.

use std::ops::ControlFlow;

use glam::{DAffine3, DVec3};
use mortise_bake::{BakeOptions, Grabbable, bake};
use mortise_brep::load_step;
use mortise_scenario::ScenarioError;

use crate::LabError;
use crate::convex::{Convex, Polytope};
use crate::driven::Image;
use crate::step_text::StepText;

/// Index of the held solid in the scene.
pub(super) const HELD: u16 = 1;

/// A box of these half edges, mm.
pub(super) fn cuboid(half: DVec3) -> Result<Convex, LabError> {
    (Polytope::cuboid(half).map(Convex::Polytope)).ok_or_else(|| LabError::Input {
        name: format!("box of half edges {half}"),
        what: "is no solid".into(),
    })
}

/// The solids with the default bake; the held one begins at `placement`, mm.
pub(super) fn baked(fixed: &Convex, held: &Convex, placement: DAffine3) -> Result<Image, LabError> {
    let mut text = StepText::new();
    for (name, solid, placement) in [("fixed", fixed, DAffine3::IDENTITY), ("held", held, placement)] {
        let written = solid.write(&mut text);
        text.part(name, written, placement);
    }
    let file = text.file()?;
    let model = load_step(file.path())?;
    let options = BakeOptions {
        grabbable: Grabbable::Named(vec!["held".into()]),
        ..BakeOptions::default()
    };
    let baked =
        bake(&model, &options, &|_| ControlFlow::Continue(())).map_err(|source| ScenarioError::Bake {
            step: "two solids".into(),
            source,
        })?;
    Ok(Image::new(&baked.image))
}
