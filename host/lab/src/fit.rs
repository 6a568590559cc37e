//! Pegs in holes as STEP files: the same two parts with any dimensions, so that a sweep needs no file for each step.
//!
//! World frame: block's top at z = 0, hole along z through the origin, the peg above or in it. Parts are named `block` and `peg`.

use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::error::LabError;

/// The two parts with placeholders instead of numbers; faces are planes and cylinders only.
const TEMPLATE: &str = include_str!("../data/peg_in_hole.step.in");

/// A peg and a block with a through hole, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Side of the block, square.
    pub width_mm: f64,
    /// Height of the block: depth of the hole.
    pub height_mm: f64,
    /// Diameter of the hole.
    pub hole_mm: f64,
    /// Diameter of the peg.
    pub peg_mm: f64,
    /// Length of the peg.
    pub length_mm: f64,
    /// Depth of the peg in the hole at its placement in the file, mm; negative above it.
    pub engaged_mm: f64,
}

impl Fit {
    /// The thesis pair (Faas 2010, chapter 7): a hole of 18.75 mm through 40 mm, a peg thinner by the diametral clearance, 1 mm engaged.
    pub const fn thesis(clearance_mm: f64) -> Self {
        Self {
            width_mm: 50.0,
            height_mm: 40.0,
            hole_mm: 18.75,
            peg_mm: 18.75 - clearance_mm,
            length_mm: 60.0,
            engaged_mm: 1.0,
        }
    }

    /// The thesis' large pair (Faas 2010, table 6): a hole of 0.7 m through a block of 1 × 1 × 0.4 m, a peg 0.6 m long.
    pub const fn large(peg_mm: f64) -> Self {
        Self {
            width_mm: 1000.0,
            height_mm: 400.0,
            hole_mm: 700.0,
            peg_mm,
            length_mm: 600.0,
            engaged_mm: 1.0,
        }
    }

    /// The same fit with the peg placed elsewhere along the hole.
    pub const fn engaged(self, engaged_mm: f64) -> Self {
        Self { engaged_mm, ..self }
    }

    /// Hole's diameter minus the peg's, mm.
    pub fn clearance_mm(&self) -> f64 {
        // Rounded to the nanometres of the file.
        ((self.hole_mm - self.peg_mm) * 1e6).round() / 1e6
    }

    /// Its STEP text.
    pub fn step_text(&self) -> String {
        // To nanometres: finer than the kernel's own tolerance.
        let number = |value: f64| format!("{value:.6}");
        [
            ("@half@", 0.5 * self.width_mm),
            ("@width@", self.width_mm),
            ("@height@", self.height_mm),
            ("@hole@", 0.5 * self.hole_mm),
            ("@peg@", 0.5 * self.peg_mm),
            ("@length@", self.length_mm),
            ("@top@", self.length_mm - self.engaged_mm),
        ]
        .iter()
        .fold(TEMPLATE.to_owned(), |text, (name, value)| {
            text.replace(name, &number(*value))
        })
    }

    /// A temporary STEP file, removed when dropped: the CAD kernel reads files only.
    ///
    /// # Errors
    /// `Unwritable`.
    pub fn file(&self) -> Result<NamedTempFile, LabError> {
        let write = |folder: &Path| {
            let file = Builder::new()
                .prefix("mortise-")
                .suffix(".step")
                .tempfile_in(folder)?;
            std::fs::write(file.path(), self.step_text())?;
            Ok(file)
        };
        let folder = std::env::temp_dir();
        write(&folder).map_err(|source| LabError::Unwritable { path: folder, source })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DVec3;
    use mortise_brep::load_step;

    use super::*;

    /// Compares the kernel's own volume and extent with those of the template's dimensions.
    #[test]
    fn the_parts_have_the_dimensions_asked_for() {
        for fit in [
            Fit::thesis(0.02),
            Fit::thesis(2.5).engaged(-20.0),
            Fit::large(699.8),
        ] {
            let file = fit.file().expect("a temporary file");
            let model = load_step(file.path()).expect("sound");
            let names: Vec<&str> = model.parts.iter().map(|part| part.name.as_str()).collect();
            assert_eq!(names, ["block", "peg"]);
            let hole = 0.25 * PI * fit.hole_mm.powi(2) * fit.height_mm;
            let block = fit.width_mm.powi(2) * fit.height_mm - hole;
            let peg = 0.25 * PI * fit.peg_mm.powi(2) * fit.length_mm;
            for (part, volume) in model.parts.iter().zip([block, peg]) {
                let found = model.shapes[part.shape].volume_mm3;
                assert!(
                    (found / volume - 1.0).abs() < 1e-9,
                    "{fit:?} {}: {found}",
                    part.name
                );
            }
            let peg = &model.parts[1];
            let tip = (model.shapes[peg.shape].mesh.vertices.iter())
                .map(|&vertex| peg.placement.transform_point3(vertex))
                .fold(DVec3::INFINITY, DVec3::min);
            assert!((tip.z + fit.engaged_mm).abs() < 1e-9, "{fit:?}: {tip}");
        }
    }
}
