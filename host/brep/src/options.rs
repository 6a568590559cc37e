//! How finely and within which limits a file is read.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use crate::machine;

static TIME_LIMIT_S: AtomicU64 = AtomicU64::new(60);

/// Sets the default of [`LoadOptions::time_limit_s`] for this program.
pub fn set_time_limit_s(seconds: u64) {
    TIME_LIMIT_S.store(seconds, Ordering::Relaxed);
}

/// How finely and within which limits a file is read.
///
/// The tessellation is for display and as a starting point for exact distances: faces keep their exact surface,
/// so a coarse mesh costs no accuracy where the surface is analytic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoadOptions {
    /// Largest distance between a triangle and its surface, mm; `None`: [`Self::relative_deflection`] decides.
    pub linear_deflection_mm: Option<f64>,
    /// Largest distance between a triangle and its surface as a share of the shape's box diagonal. 5·10⁻⁴: half a
    /// pixel when the shape fills a screen of 1000 pixels.
    pub relative_deflection: f64,
    /// Largest angle between neighbouring segments, radians: 0.2 gives a circle at least 32 segments.
    pub angular_deflection_rad: f64,
    /// A spline face within this distance of a plane, cylinder, cone, sphere or torus becomes that surface, and a spline
    /// edge within it of a line or circle that curve, mm; 0: never.
    /// The default, a tenth of a micrometre, is what modellers call the same place: nothing downstream can tell.
    pub recognise_mm: f64,
    /// Most processor time for reading and tessellation, seconds (child process only). Default: 60, or what [`set_time_limit_s`] says.
    pub time_limit_s: u64,
    /// Largest address space of the reading process, bytes (child process on Linux only; 0 for none). Default: half of the memory
    /// that is available, at least 1 GiB.
    pub memory_limit_bytes: u64,
    /// Longest answer of the reading process, bytes: the parts and their triangles (child process only).
    pub answer_limit_bytes: u64,
    /// Most bytes of STEP text, of a file and of those it refers to.
    pub text_limit_bytes: u64,
    /// Most placed parts: an assembly of assemblies can unfold without bound.
    pub max_parts: usize,
    /// Give the model although the kernel lost solids; each loss is then a warning instead of an error.
    pub allow_lost_solids: bool,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            linear_deflection_mm: None,
            relative_deflection: 5e-4,
            angular_deflection_rad: 0.2,
            recognise_mm: 1e-4,
            time_limit_s: TIME_LIMIT_S.load(Ordering::Relaxed),
            memory_limit_bytes: machine::memory_limit_bytes(),
            answer_limit_bytes: 1 << 30,
            text_limit_bytes: 1 << 30,
            max_parts: 100_000,
            allow_lost_solids: false,
        }
    }
}
