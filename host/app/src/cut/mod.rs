//! The section view's state without its drawing: where the plane lies, and the areas in which it cuts the parts, computed beside the window's thread.

pub mod areas;
pub mod gaps;
pub mod setting;
pub mod slicer;

pub use self::areas::{Area, Cut};
pub use self::gaps::{Band, Following, Gaps};
pub use self::setting::{Across, Setting};
pub use self::slicer::{Slicer, Wanted};

use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use mortise_inspect::CutPlane;

use crate::display::extent::Extent;
use crate::session::document::Document;

/// The plane shown, and what fills the cut.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// The plane: what lies above it is cut away.
    pub plane: CutPlane,
    /// The areas in it; `None` until they are computed for the first time.
    pub cut: Option<&'a Arc<Cut>>,
}

/// The section view of a window.
pub struct SectionView {
    /// Whether it is on.
    pub on: bool,
    /// Where the plane lies.
    pub setting: Setting,
    /// Whether the gaps between parts are shown along the borders of the cut.
    pub shows_gaps: bool,
    /// Largest gap shown, µm.
    pub gaps_up_to_um: f64,
    slicer: Slicer,
    /// Document for which the setting was made.
    generation: Option<u64>,
}

impl Default for SectionView {
    fn default() -> Self {
        Self {
            on: false,
            setting: Setting::default(),
            shows_gaps: false,
            gaps_up_to_um: 500.0,
            slicer: Slicer::default(),
            generation: None,
        }
    }
}

impl SectionView {
    /// Switches it on or off. The first time for a document the plane goes through the middle of it, and the half towards `viewer` is cut away.
    pub fn toggle(&mut self, document: &Document, viewer: DVec3) {
        self.on = !self.on;
        if self.on && self.generation != Some(document.generation) {
            self.generation = Some(document.generation);
            self.lay(Across::Y, document.extent, viewer);
        }
    }

    /// Switches it on with a plane for a document, or off.
    pub fn restore(&mut self, document: &Document, setting: Option<Setting>) {
        self.on = setting.is_some();
        if let Some(setting) = setting {
            self.generation = Some(document.generation);
            self.setting = setting;
        }
    }

    /// Lays the plane anew: across an axis through the middle, along a face in it.
    pub fn lay(&mut self, across: Across, extent: Extent, viewer: DVec3) {
        self.setting = Setting::of(across, extent, viewer);
    }

    /// Follows the setting and the parts' poses, `document` at present. Returns the time after which it wants to be called again, if any.
    pub fn follow(
        &mut self,
        document: &Document,
        wake: impl FnOnce() -> Arc<dyn Fn() + Send + Sync>,
    ) -> Option<Duration> {
        // Another document was opened.
        self.on &= self.generation == Some(document.generation);
        let plane = self.on.then(|| self.setting.plane(document.extent)).flatten();
        let wanted = plane.map(|plane| Wanted {
            generation: document.generation,
            model: Arc::clone(&document.model),
            poses: document.poses.clone(),
            plane,
            sag_mm: (SAG_RADII * document.extent.radius).max(LEAST_SAG_MM),
            gaps: self.shows_gaps.then_some(Following {
                range_mm: 1e-3 * self.gaps_up_to_um,
                longest_mm: LONGEST_RADII * document.extent.radius,
            }),
        });
        self.slicer.follow(wanted, wake)
    }

    /// What is shown of `document`. The plane is that of the areas at hand, so that plane and areas always belong together.
    pub fn shown(&self, document: &Document) -> Option<Shown<'_>> {
        if !self.on || self.generation != Some(document.generation) {
            return None;
        }
        let cut = self.slicer.cut();
        let plane = match cut {
            Some(cut) => cut.plane,
            None => self.setting.plane(document.extent)?,
        };
        Some(Shown { plane, cut })
    }

    /// Whether areas are being computed.
    pub fn is_busy(&self) -> bool {
        self.slicer.is_busy()
    }

    /// Whether areas cannot be computed: no thread is available.
    pub fn has_failed(&self) -> bool {
        self.slicer.has_failed()
    }
}

/// Largest distance of an area's border from the exact curve, in radii of the scene: a tenth of a pixel where the scene fills the picture.
const SAG_RADII: f64 = 1e-4;
/// Longest piece of a border with gaps at its ends, in radii of the scene.
const LONGEST_RADII: f64 = 0.01;
/// Smallest such distance asked for, mm.
const LEAST_SAG_MM: f64 = 1e-3;
