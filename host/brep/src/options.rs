//! Accuracy and limits of reading a file.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use crate::machine;

static TIME_LIMIT_S: AtomicU64 = AtomicU64::new(60);

/// Sets the default of [`LoadOptions::time_limit_s`] for this program.
pub fn set_time_limit_s(seconds: u64) {
    TIME_LIMIT_S.store(seconds, Ordering::Relaxed);
}

/// Accuracy and limits of reading a file.
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
    /// A spline face within this distance of a plane, cylinder, cone, sphere or torus is replaced by that surface, and a spline edge within it of a
    /// line or circle by that curve, mm; 0: never.
    /// The default, a tenth of a micrometre, is the distance at which modellers treat points as identical: no later step can distinguish them.
    pub recognise_mm: f64,
    /// Largest processor time for reading and tessellation, seconds (child process only). Default: 60, or the value of [`set_time_limit_s`].
    pub time_limit_s: u64,
    /// Largest address space of the reading process, bytes (child process on Linux only; 0 for no limit). Default: half of the available memory, at
    /// least 1 GiB.
    pub memory_limit_bytes: u64,
    /// Largest answer of the reading process, bytes: the parts and their triangles (child process only).
    pub answer_limit_bytes: u64,
    /// Most bytes of STEP text, for a file and the files it refers to together.
    pub text_limit_bytes: u64,
    /// Most placed parts: an assembly of assemblies can unfold without limit.
    pub max_parts: usize,
    /// Return the model even if the kernel lost solids; each loss is then a warning instead of an error.
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
