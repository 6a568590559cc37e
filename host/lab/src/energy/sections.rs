//! Pegs of three sections in blind holes of their own shape, at exact fit: Behandish & Ilieş 2015, fig. 4 (its dimensions are not given; these are ours).

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};
use mortise_brep::Shape;
use mortise_energy::BakedEnergy;
use mortise_shapes::step::{Cap, Side, Solid, Tube, pair};
use tempfile::NamedTempFile;

use crate::LabError;
use crate::followed::{Begin, Followed};
use crate::guided;
use crate::step_text::{StepText, prism};

/// Half width of the block, its height, and the depth of the hole, mm; and the length of the peg.
const HALF: f64 = 25.0;
const HEIGHT: f64 = 40.0;
/// Depth of the holes, mm.
pub(crate) const DEPTH: f64 = 30.0;
/// Length of the pegs, mm.
pub(crate) const LENGTH: f64 = 45.0;
/// Radius of the round section, and half the width of the square one, mm.
const RADIUS: f64 = 10.0;
/// Corners of a round section: its chords are 12 µm off the circle.
const CORNERS: usize = 64;

/// A section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    Circular,
    Square,
    /// Round on one side, with a corner on the other.
    Combined,
}

impl Section {
    pub const ALL: [Self; 3] = [Self::Circular, Self::Square, Self::Combined];

    pub fn name(self) -> &'static str {
        match self {
            Self::Circular => "circular",
            Self::Square => "square",
            Self::Combined => "combined",
        }
    }

    /// Corners, counter-clockwise from above.
    fn corners(self) -> Vec<DVec2> {
        let round = |i: usize| {
            // Halfway between, so that no corner is on a diagonal of the block.
            DVec2::from_angle(TAU * (i as f64 + 0.5) / CORNERS as f64) * RADIUS
        };
        match self {
            Self::Circular => (0..CORNERS).map(round).collect(),
            Self::Square => [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
                .map(|(x, y)| DVec2::new(x, y) * RADIUS)
                .into(),
            Self::Combined => {
                // Three quarters of the circle; the tangents at its ends meet in the corner.
                let (first, last) = (CORNERS / 4, CORNERS);
                let mut corners: Vec<DVec2> = (first..last).map(round).collect();
                corners.push(DVec2::new(RADIUS, 0.0));
                corners.push(DVec2::splat(RADIUS));
                corners.push(DVec2::new(0.0, RADIUS));
                corners
            }
        }
    }

    /// A STEP file of the block, its top at z = 0 and the hole about the z axis, and the peg, its foot at `foot_mm` on that axis and its length along it.
    pub fn file(self, foot_mm: f64) -> Result<NamedTempFile, LabError> {
        let mut text = StepText::new();
        let corners = self.corners();
        let (corners_of_peg, loops) = prism(&corners, [0.0, LENGTH]);
        let (block, peg) = (
            block(&mut text, &corners),
            text.polyhedron(&corners_of_peg, &loops),
        );
        text.part("block", block, DAffine3::IDENTITY);
        text.part(
            "peg",
            peg,
            DAffine3::from_translation(DVec3::new(0.0, 0.0, foot_mm)),
        );
        text.file()
    }

    /// The pair with its geometric energy in the scene, and that energy.
    pub fn followed(self) -> Result<(Followed, BakedEnergy), LabError> {
        // The peg is seated in the file: the fit is where it has it.
        let file = self.file(-DEPTH)?;
        Followed::new(file.path(), ["peg", "block"])?.with_energy()
    }

    /// The same pair with cylinders for its chords, as it is felt: parts touch by their surfaces, and 64 chords would all touch apart. The peg is seated, and narrower
    /// than the hole by a clearance.
    pub fn round(self, clearance_mm: f64) -> Result<(Followed, BakedEnergy), LabError> {
        let file = guided::file(&self.round_text(clearance_mm))?;
        Followed::beginning(file.path(), ["moving", "fixed"], Begin::Seated)?.with_energy()
    }

    /// A STEP text of the parts `moving` and `fixed`, as [`Self::file`] has them with the foot in the hole's bottom.
    fn round_text(self, clearance_mm: f64) -> String {
        let peg = Solid {
            tubes: vec![self.tube(RADIUS - 0.5 * clearance_mm, [-DEPTH, LENGTH - DEPTH], true)],
            caps: [(false, 0), (true, 1)]
                .map(|(up, end)| Cap {
                    up,
                    outer: (0, end),
                    holes: Vec::new(),
                })
                .into(),
        };
        let cap = |up, outer, holes: &[(usize, usize)]| Cap {
            up,
            outer,
            holes: holes.to_vec(),
        };
        let block = Solid {
            tubes: vec![
                Self::Square.tube(HALF, [-HEIGHT, 0.0], true),
                self.tube(RADIUS, [-DEPTH, 0.0], false),
            ],
            caps: vec![
                cap(false, (0, 0), &[]),
                cap(true, (0, 1), &[(1, 1)]),
                cap(true, (1, 0), &[]),
            ],
        };
        pair(&peg, &block, [DAffine3::IDENTITY; 2])
    }

    /// A tube of this section with half of its width, counter-clockwise, between two heights.
    fn tube(self, half: f64, heights: [f64; 2], solid: bool) -> Tube {
        let at = |x: f64, y: f64| half * DVec2::new(x, y);
        // Ends of the sides; each begins where the one before it ends.
        let (corners, arcs) = match self {
            Self::Circular => (vec![at(1.0, 0.0), at(-1.0, 0.0)], 2),
            Self::Square => (
                vec![at(1.0, 1.0), at(-1.0, 1.0), at(-1.0, -1.0), at(1.0, -1.0)],
                0,
            ),
            Self::Combined => (vec![at(0.0, 1.0), at(1.0, 0.0), at(1.0, 1.0)], 1),
        };
        let sides = corners.iter().enumerate().map(|(k, &from)| {
            let to = corners[(k + 1) % corners.len()];
            let [low, high] = heights.map(|z| [from.extend(z), to.extend(z)]);
            if k < arcs {
                Side::Round(low, high, DVec3::ZERO)
            } else {
                Side::Flat(low, high)
            }
        });
        Tube {
            sides: sides.collect(),
            solid,
        }
    }

    /// The shapes of the block and the peg, as in [`Self::file`]; the peg's foot is at its origin.
    pub fn shapes(self) -> Result<[Shape; 2], LabError> {
        let model = mortise_brep::load_step(self.file(0.0)?.path())?;
        let shape = |name: &str| {
            let part = model.parts.iter().find(|part| part.name == name);
            part.map(|part| model.shapes[part.shape].clone())
                .ok_or_else(|| LabError::Input {
                    name: self.name().to_owned(),
                    what: format!("the {name} was lost while it was read"),
                })
        };
        Ok([shape("block")?, shape("peg")?])
    }
}

/// The top is divided from each corner of the hole to the place on the block's border in the same direction.
fn block(text: &mut StepText, corners: &[DVec2]) -> u64 {
    let count = corners.len();
    let border = corners.iter().map(|p| *p * (HALF / p.abs().max_element()));
    // Each place with the corner of the hole it is joined to; then the block's own corners, where no corner of the hole points at them.
    let mut ring: Vec<(DVec2, usize)> = border.zip(0..).collect();
    for corner in [
        DVec2::new(1.0, 1.0),
        DVec2::new(-1.0, 1.0),
        DVec2::splat(-1.0),
        DVec2::new(1.0, -1.0),
    ] {
        let corner = corner * HALF;
        if ring.iter().all(|(p, _)| p.distance(corner) > 1e-6) {
            let angle = |p: DVec2| p.to_angle().rem_euclid(TAU);
            let before = (ring.iter())
                .filter(|(p, _)| angle(*p) < angle(corner))
                .max_by(|a, b| angle(a.0).total_cmp(&angle(b.0)))
                .or_else(|| ring.iter().max_by(|a, b| angle(a.0).total_cmp(&angle(b.0))));
            let Some(&(place, hole)) = before else { continue };
            let index = ring.iter().position(|(p, _)| *p == place).unwrap_or_default();
            ring.insert(index + 1, (corner, hole));
        }
    }
    let around = ring.len();
    let mut all: Vec<DVec3> = corners.iter().map(|p| p.extend(0.0)).collect();
    all.extend(corners.iter().map(|p| p.extend(-DEPTH)));
    all.extend(ring.iter().map(|(p, _)| p.extend(0.0)));
    all.extend(ring.iter().map(|(p, _)| p.extend(-HEIGHT)));
    let (foot, rim, base) = (count, 2 * count, 2 * count + around);
    let mut loops: Vec<Vec<usize>> = vec![
        (foot..foot + count).collect(),
        (base..base + around).rev().collect(),
    ];
    for i in 0..count {
        let next = (i + 1) % count;
        // The hole's wall faces the axis.
        loops.push(vec![i, next, foot + next, foot + i]);
    }
    for k in 0..around {
        let next = (k + 1) % around;
        let (here, there) = (ring[k].1, ring[next].1);
        let mut top = vec![rim + k, rim + next, there];
        if here != there {
            top.push(here);
        }
        loops.push(top);
        loops.push(vec![base + k, base + next, rim + next, rim + k]);
    }
    text.polyhedron(&all, &loops)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Parts with cylinders have the volume of their section: a circle, a square, and three quarters of a circle with a quarter of the square.
    #[test]
    fn round_parts_have_the_volume_of_their_section() {
        for (section, area) in Section::ALL.into_iter().zip([PI, 4.0, 0.75 * PI + 1.0]) {
            let clearance = 0.1;
            let file = guided::file(&section.round_text(clearance)).expect("written");
            let model = mortise_brep::load_step(file.path()).expect("read");
            let hole = area * RADIUS * RADIUS * DEPTH;
            let narrow = RADIUS - 0.5 * clearance;
            for (name, volume) in [
                ("moving", area * narrow * narrow * LENGTH),
                ("fixed", 4.0 * HALF * HALF * HEIGHT - hole),
            ] {
                let part = model.parts.iter().find(|part| part.name == name).expect(name);
                let shape = &model.shapes[part.shape];
                assert!(shape.closed, "{section:?} {name}");
                assert!(
                    (shape.volume_mm3 / volume - 1.0).abs() < 1e-9,
                    "{section:?} {name}"
                );
            }
        }
    }

    /// The block's volume and the peg's agree with the section's area, by the CAD kernel.
    #[test]
    fn holes_have_the_area_of_their_pegs() {
        for section in Section::ALL {
            let corners = section.corners();
            let twice: f64 = (0..corners.len())
                .map(|i| corners[i].perp_dot(corners[(i + 1) % corners.len()]))
                .sum();
            let area = twice / 2.0;
            let [block, peg] = section.shapes().expect("read");
            assert!(block.closed && peg.closed, "{section:?}");
            let whole = 4.0 * HALF * HALF * HEIGHT;
            assert!(
                (peg.volume_mm3 - area * LENGTH).abs() < 1e-6 * whole,
                "{section:?}"
            );
            assert!(
                (block.volume_mm3 - (whole - area * DEPTH)).abs() < 1e-6 * whole,
                "{section:?}"
            );
        }
    }
}
