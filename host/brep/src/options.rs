//! How finely and within which limits a file is read.

use serde::{Deserialize, Serialize};

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
    /// Longest time for reading and tessellation, seconds (child process only).
    pub time_limit_s: u64,
    /// Largest address space of the reading process, bytes (child process on Linux only; 0 for none).
    pub memory_limit_bytes: u64,
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
            time_limit_s: 300,
            memory_limit_bytes: 8 << 30,
            max_parts: 100_000,
            allow_lost_solids: false,
        }
    }
}
