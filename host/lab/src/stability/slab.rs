//! A peg that stands on a slab: the wall of the closed-loop experiments, baked from STEP like any scene.

use mortise_bake::Grabbable;
use mortise_protocol::image::SceneImage;
use mortise_scenario::{PreparedScene, Scenario};

use crate::error::LabError;
use crate::exact_fit::ExactFit;
use crate::fit::Fit;
use crate::variant::Variant;

/// A baked slab and peg.
pub struct Slab {
    words: Vec<u32>,
    /// Index of the peg.
    pub part: u16,
    /// Peg and slab in closed form.
    pub(crate) exact: ExactFit,
}

impl Slab {
    /// The peg, 20 mm across and long, stands `gap_mm` above a slab `thick_mm` thick. The slab has a pinhole of 1 mm below the peg's middle.
    ///
    /// # Errors
    /// Anything that prevents it from being baked.
    pub fn bake(variant: &Variant, thick_mm: f64, gap_mm: f64) -> Result<Self, LabError> {
        let fit = Fit {
            width_mm: 50.0,
            height_mm: thick_mm,
            hole_mm: 1.0,
            peg_mm: 20.0,
            length_mm: 20.0,
            engaged_mm: -gap_mm,
        };
        let file = fit.file()?;
        let mut scenario = Scenario::insertion(file.path())?;
        scenario.scene.part = "peg".into();
        let scene = PreparedScene::with(&scenario, &variant.options(Grabbable::Named(vec!["peg".into()])))?;
        let mut words = vec![0u32; scene.image.len().div_ceil(4)];
        bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..scene.image.len()].copy_from_slice(&scene.image);
        Ok(Self {
            words,
            part: scene.part,
            exact: ExactFit::of(&scene, fit),
        })
    }

    /// Its scene.
    ///
    /// # Errors
    /// `Input`, never for images that the baker wrote.
    pub fn scene(&self) -> Result<SceneImage<'_>, LabError> {
        SceneImage::open(bytemuck::cast_slice(&self.words)).map_err(|error| LabError::Input {
            name: "slab".into(),
            what: error.to_string(),
        })
    }
}
