//! A generated assembly: brackets with cover plates on a base plate, bolts, washers, nuts and pins, as many parts as are asked for.
//!
//! Each bracket stands near the middle of its cell of a square pattern, off it by a seeded random distance and turned by a seeded number of quarter turns.
//! Two bolts with washers hold it on the base, in tapped holes of the bolts' own diameter; two bolts with washers and nuts hold a cover on its upright leg.
//! Parts that no further bracket can be made of are pins in the base, in the corners between cells. All of a kind share one shape.

mod solids;

use std::f64::consts::FRAC_PI_2;

use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};
use mortise_brep::{LoadOptions, Part, load_step, write};
use tempfile::NamedTempFile;

pub(crate) use self::solids::Bore;
use crate::LabError;
use crate::guided;
use crate::step_text::StepText;

/// Side of a cell, and how far a bracket is off its middle at most, mm.
const CELL: f64 = 64.0;
const ASIDE: f64 = 3.0;
/// Thickness of the base, depth of its holes for bolts and for pins.
const BASE: f64 = 20.0;
const TAPPED: f64 = 16.0;
const PINNED: f64 = 12.0;
/// Thickness of brackets, covers, washers and nuts.
const LEG: f64 = 5.0;
const WASHER: f64 = 1.6;
const NUT: f64 = 5.0;
/// Length of the legs, and half the width of brackets and covers.
const LENGTH: f64 = 40.0;
const HALF: f64 = 15.0;
/// Place of the holes along a leg, and to each side of its middle.
const ALONG: f64 = 25.0;
const BESIDE: f64 = 8.0;
/// Radii of shanks, through holes, heads, washers and pins.
const SHANK: f64 = 3.0;
const HOLE: f64 = 3.3;
const HEAD: f64 = 5.0;
const RIM: f64 = 6.0;
const PIN: f64 = 4.0;
/// Lengths of shanks under the head: into the base, and through cover, bracket and nut.
const INTO_BASE: f64 = WASHER + LEG + 12.0;
const THROUGH: f64 = WASHER + 2.0 * LEG + NUT;
/// Parts of a bracket with everything on it.
const PER_BRACKET: usize = 12;
/// Pairs that touch or fit on each bracket: base and cover with it; of each of the two bolts to the base those with washer, bracket and base, and the washer
/// with the bracket; of each of the two on the cover those with washer, cover, bracket and nut, the washer with the cover, and the nut with the bracket.
const PAIRS: usize = 2 + 2 * 4 + 2 * 6;

/// Number of parts in the full and in the shorter form of tables.
const PARTS: usize = 500;
const PARTS_QUICK: usize = 40;
const SEED: u64 = 19;

/// Kinds of parts, in the order of their shapes in the file.
#[derive(Clone, Copy)]
enum Kind {
    Base,
    Bracket,
    Cover,
    BaseBolt,
    CoverBolt,
    Washer,
    Nut,
    Pin,
}

impl Kind {
    const ALL: [(Self, &'static str); 8] = [
        (Self::Base, "base"),
        (Self::Bracket, "bracket"),
        (Self::Cover, "cover"),
        (Self::BaseBolt, "base bolt"),
        (Self::CoverBolt, "cover bolt"),
        (Self::Washer, "washer"),
        (Self::Nut, "nut"),
        (Self::Pin, "pin"),
    ];
}

/// Where everything is.
struct Layout {
    /// Cells along a side.
    side: usize,
    brackets: Vec<DAffine3>,
    pins: Vec<DVec2>,
}

/// Number of parts of which tables measure an assembly.
pub(crate) fn parts(quick: bool) -> usize {
    if quick { PARTS_QUICK } else { PARTS }
}

/// A STEP file of a generated assembly of `count` parts, removed when dropped.
///
/// Cost: the kernel reads one of each shape and writes the text, some seconds for hundreds of parts.
///
/// # Errors
/// A file that cannot be written or read.
pub(crate) fn file(count: usize) -> Result<NamedTempFile, LabError> {
    let layout = Layout::new(count, SEED);
    let mut text = StepText::new();
    for (kind, name) in Kind::ALL {
        let solid = layout.solid(kind, &mut text);
        text.part(name, solid, DAffine3::IDENTITY);
    }
    let shapes = text.file()?;
    let model = load_step(shapes.path())?;
    let shape = |kind: Kind| model.parts.get(kind as usize).map_or(0, |part| part.shape);
    let mut numbers = [0; Kind::ALL.len()];
    let parts: Vec<Part> = (layout.parts().into_iter())
        .map(|(kind, placement)| {
            let number = &mut numbers[kind as usize];
            *number += 1;
            Part {
                name: format!("{} {number}", Kind::ALL[kind as usize].1),
                path: Vec::new(),
                shape: shape(kind),
                placement,
                color: None,
            }
        })
        .collect();
    let whole = write::step_text(shapes.path(), &LoadOptions::default(), &parts)?;
    guided::file(&String::from_utf8_lossy(&whole))
}

/// Number of pairs of parts that touch or fit in an assembly of `count` parts.
pub(crate) fn connections(count: usize) -> usize {
    let others = count.saturating_sub(1);
    let (brackets, pins) = (others / PER_BRACKET, others % PER_BRACKET);
    PAIRS * brackets + pins
}

impl Layout {
    fn new(count: usize, seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let others = count.saturating_sub(1);
        let (brackets, pins) = (others / PER_BRACKET, others % PER_BRACKET);
        let side = (1..).find(|n| n * n >= brackets.max(pins)).unwrap_or(1);
        let corner = |i: usize| dvec2((i % side) as f64, (i / side) as f64) * CELL;
        let mut aside = || ASIDE * (2.0 * random.f64() - 1.0);
        let asides: Vec<DVec2> = (0..brackets).map(|_| dvec2(aside(), aside())).collect();
        let brackets = (asides.into_iter().enumerate())
            .map(|(i, aside)| {
                let middle = corner(i) + CELL / 2.0 + aside;
                let turn = DAffine3::from_rotation_z(f64::from(random.u8(0..4)) * FRAC_PI_2);
                // The bracket with its cover is in the middle of its cell.
                DAffine3::from_translation(middle.extend(0.0))
                    * turn
                    * DAffine3::from_translation(dvec3(-LENGTH / 3.0, 0.0, 0.0))
            })
            .collect();
        Self {
            side,
            brackets,
            pins: (0..pins).map(|i| corner(i) + PIN + 1.0).collect(),
        }
    }

    /// Kinds and places of all parts.
    fn parts(&self) -> Vec<(Kind, DAffine3)> {
        let mut parts = vec![(Kind::Base, DAffine3::IDENTITY)];
        // From z up to outward at the upright leg, −x.
        let lying = DAffine3::from_rotation_y(-FRAC_PI_2);
        for bracket in &self.brackets {
            let mut add = |kind, at: DAffine3| parts.push((kind, *bracket * at));
            add(Kind::Bracket, DAffine3::IDENTITY);
            add(Kind::Cover, DAffine3::IDENTITY);
            for y in [-BESIDE, BESIDE] {
                let foot = |z: f64| DAffine3::from_translation(dvec3(ALONG, y, z));
                add(Kind::Washer, foot(LEG));
                add(Kind::BaseBolt, foot(LEG + WASHER));
                let wall = |x: f64| DAffine3::from_translation(dvec3(x, y, ALONG)) * lying;
                add(Kind::Washer, wall(-LEG));
                add(Kind::CoverBolt, wall(-LEG - WASHER));
                add(Kind::Nut, wall(LEG + NUT));
            }
        }
        let pin = |at: &DVec2| DAffine3::from_translation(at.extend(-PINNED));
        parts.extend(self.pins.iter().map(|at| (Kind::Pin, pin(at))));
        parts
    }

    fn solid(&self, kind: Kind, text: &mut StepText) -> u64 {
        let ring = |inner: f64, outer: f64, height: f64| {
            [
                dvec2(inner, 0.0),
                dvec2(outer, 0.0),
                dvec2(outer, height),
                dvec2(inner, height),
            ]
        };
        let bolt = |length: f64| {
            [
                dvec2(0.0, -length),
                dvec2(SHANK, -length),
                dvec2(SHANK, 0.0),
                dvec2(HEAD, 0.0),
                dvec2(HEAD, 6.0),
                dvec2(0.0, 6.0),
            ]
        };
        match kind {
            Kind::Base => self.base(text),
            Kind::Bracket => bracket(text),
            Kind::Cover => {
                let outline = [
                    dvec2(-LEG, -HALF),
                    dvec2(0.0, -HALF),
                    dvec2(0.0, HALF),
                    dvec2(-LEG, HALF),
                ];
                // The side toward −x is between the last corner and the first.
                let bores = [-BESIDE, BESIDE].map(|y| Bore {
                    faces: (5, Some(3)),
                    mouth: dvec3(-LEG, y, ALONG),
                    depth: DVec3::X * LEG,
                    radius: HOLE,
                });
                text.prism(&outline, [LEG + 5.0, LENGTH], &bores)
            }
            Kind::BaseBolt => text.turned(&bolt(INTO_BASE)),
            Kind::CoverBolt => text.turned(&bolt(THROUGH)),
            Kind::Washer => text.turned(&ring(HOLE, RIM, WASHER)),
            Kind::Nut => {
                let outline: Vec<DVec2> = (0..6)
                    .map(|i| DVec2::from_angle(f64::from(i) * FRAC_PI_2 / 1.5) * RIM)
                    .collect();
                let bore = Bore {
                    faces: (1, Some(0)),
                    mouth: DVec3::Z * NUT,
                    depth: DVec3::NEG_Z * NUT,
                    radius: SHANK,
                };
                text.prism(&outline, [0.0, NUT], &[bore])
            }
            Kind::Pin => text.turned(&[
                dvec2(0.0, 0.0),
                dvec2(PIN, 0.0),
                dvec2(PIN, 2.0 * PINNED),
                dvec2(0.0, 2.0 * PINNED),
            ]),
        }
    }

    fn base(&self, text: &mut StepText) -> u64 {
        let side = self.side as f64 * CELL;
        let outline = [
            dvec2(0.0, 0.0),
            dvec2(side, 0.0),
            dvec2(side, side),
            dvec2(0.0, side),
        ];
        let blind = |mouth: DVec3, depth: f64, radius: f64| Bore {
            faces: (1, None),
            mouth,
            depth: DVec3::NEG_Z * depth,
            radius,
        };
        let taps = self.brackets.iter().flat_map(|bracket| {
            let hole = |y: f64| bracket.transform_point3(dvec3(ALONG, y, 0.0));
            [-BESIDE, BESIDE].map(|y| blind(hole(y), TAPPED, SHANK))
        });
        let pins = (self.pins.iter()).map(|at| blind(at.extend(0.0), PINNED, PIN));
        let bores: Vec<Bore> = taps.chain(pins).collect();
        text.prism(&outline, [-BASE, 0.0], &bores)
    }
}

/// A bracket: the foot along x, the upright along z.
fn bracket(text: &mut StepText) -> u64 {
    // Seen from −y, x to the right and z up.
    let outline = [
        dvec2(0.0, 0.0),
        dvec2(LENGTH, 0.0),
        dvec2(LENGTH, LEG),
        dvec2(LEG, LEG),
        dvec2(LEG, LENGTH),
        dvec2(0.0, LENGTH),
    ];
    let corners: Vec<DVec3> = [-HALF, HALF]
        .iter()
        .flat_map(|&y| outline.iter().map(move |p| dvec3(p.x, y, p.y)))
        .collect();
    let count = outline.len();
    let mut loops: Vec<Vec<usize>> = vec![(0..count).collect(), (count..2 * count).rev().collect()];
    loops.extend((0..count).map(|i| {
        let next = (i + 1) % count;
        vec![i, count + i, count + next, next]
    }));
    // Sides by their first corner: 0 the bottom, 2 the top of the foot, 3 the inside of the upright, 5 its outside.
    let bores: Vec<Bore> = [-BESIDE, BESIDE]
        .into_iter()
        .flat_map(|y| {
            [
                Bore {
                    faces: (2 + 2, Some(2)),
                    mouth: dvec3(ALONG, y, LEG),
                    depth: DVec3::NEG_Z * LEG,
                    radius: HOLE,
                },
                Bore {
                    faces: (2 + 3, Some(2 + 5)),
                    mouth: dvec3(LEG, y, ALONG),
                    depth: DVec3::NEG_X * LEG,
                    radius: HOLE,
                },
            ]
        })
        .collect();
    text.drilled(&corners, &loops, &bores)
}
