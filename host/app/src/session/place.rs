//! The place of a part in its assembly, for parts of any shape. Pure.
//!
//! The place is where the file puts the part relative to a neighbour: the part whose bounding box reaches farthest into that of the part. A part
//! beside or above all others has no place, because the file then shows it before assembly.

use glam::{DAffine3, DVec3};
use mortise_brep::CadModel;

/// Least overlap of two bounding boxes that makes their parts neighbours, mm.
const REACH_MM: f64 = 0.1;

/// An axis-aligned bounding box, mm.
#[derive(Clone, Copy, Debug)]
struct BoundingBox {
    min: DVec3,
    max: DVec3,
}

impl BoundingBox {
    fn of(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        let (min, max) = points.fold((first, first), |(min, max), p| (min.min(p), max.max(p)));
        (min.is_finite() && max.is_finite()).then_some(Self { min, max })
    }

    fn corners(self) -> [DVec3; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|i| {
            let pick = |bit: usize, low: f64, high: f64| if i & bit == 0 { low } else { high };
            DVec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }

    /// The box around this box transformed by `pose`.
    fn moved(self, pose: &DAffine3) -> Option<Self> {
        Self::of(self.corners().map(|corner| pose.transform_point3(corner)))
    }

    /// Smallest of the three overlaps of two boxes, mm; negative: the largest gap.
    fn overlap(self, other: Self) -> f64 {
        (self.max.min(other.max) - self.min.max(other.min)).min_element()
    }
}

/// Position of a part relative to its place.
#[derive(Clone, Copy, Debug)]
pub struct Away {
    /// Largest displacement of a corner of the part's bounding box, mm.
    pub mm: f64,
    /// Direction of the displacement of the box's middle, unit vector, world; zero at the place.
    pub out: DVec3,
}

/// Places of the parts of one model.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Bounding box of each part, in its frame.
    boxes: Vec<Option<BoundingBox>>,
    /// For each part its neighbour, and the part's pose in the neighbour's frame.
    homes: Vec<Option<(usize, DAffine3)>>,
}

impl Places {
    /// The places in the file. Cost: one pass over the vertices and one over the pairs of parts.
    pub fn of(model: &CadModel) -> Self {
        let boxes: Vec<Option<BoundingBox>> = (model.parts.iter())
            .map(|part| BoundingBox::of(model.shapes.get(part.shape)?.mesh.vertices.iter().copied()))
            .collect();
        let placed: Vec<Option<BoundingBox>> = (model.parts.iter().zip(&boxes))
            .map(|(part, own)| (*own)?.moved(&part.placement))
            .collect();
        let home = |part: usize| {
            let own = placed[part]?;
            let reach = |other: usize| Some((other, own.overlap(placed[other]?)));
            let (neighbour, _) = (0..placed.len())
                .filter(|&other| other != part)
                .filter_map(reach)
                .filter(|&(_, overlap)| overlap > REACH_MM)
                .max_by(|a, b| a.1.total_cmp(&b.1))?;
            let relative = model.parts[neighbour].placement.inverse() * model.parts[part].placement;
            relative.is_finite().then_some((neighbour, relative))
        };
        let homes = (0..placed.len()).map(home).collect();
        Self { boxes, homes }
    }

    /// How far `part` is from its place; `None` without a place, and when it is more than `near_mm` outside of its neighbour's bounding box.
    pub fn away(&self, part: usize, poses: &[DAffine3], near_mm: f64) -> Option<Away> {
        let (neighbour, relative) = (*self.homes.get(part)?)?;
        let (now, around) = (poses.get(part)?, poses.get(neighbour)?);
        let own = (*self.boxes.get(part)?)?;
        let reach = own
            .moved(now)?
            .overlap((*self.boxes.get(neighbour)?)?.moved(around)?);
        let home = *around * relative;
        let shift = |point: DVec3| now.transform_point3(point) - home.transform_point3(point);
        let mm = (own.corners().into_iter()).map(|corner| shift(corner).length());
        (reach > -near_mm).then_some(Away {
            mm: mm.fold(0.0, f64::max),
            out: shift(0.5 * (own.min + own.max)).normalize_or_zero(),
        })
    }
}

#[cfg(test)]
impl Places {
    /// Cubes with sides of 2 mm.
    pub fn of_cubes(homes: Vec<Option<(usize, DAffine3)>>) -> Self {
        let cube = BoundingBox {
            min: DVec3::splat(-1.0),
            max: DVec3::ONE,
        };
        Self {
            boxes: vec![Some(cube); homes.len()],
            homes,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_place_follows_its_neighbour() {
        let relative = DAffine3::from_translation(DVec3::X);
        let places = Places::of_cubes(vec![None, Some((0, relative))]);
        let turned = DAffine3::from_rotation_z(FRAC_PI_2);
        let home = turned * relative;
        let at = places.away(1, &[turned, home], 0.0).unwrap();
        assert!(at.mm < 1e-12, "{at:?}");
        let shifted = DAffine3::from_translation(0.3 * DVec3::Z) * home;
        let at = places.away(1, &[turned, shifted], 0.0).unwrap();
        assert!((at.mm - 0.3).abs() < 1e-12, "{at:?}");
        assert!((at.out - DVec3::Z).length() < 1e-9, "{at:?}");
    }

    #[test]
    fn a_turn_on_the_spot_is_away() {
        let places = Places::of_cubes(vec![None, Some((0, DAffine3::IDENTITY))]);
        let turned = DAffine3::from_rotation_z(FRAC_PI_2);
        let at = places.away(1, &[DAffine3::IDENTITY, turned], 0.0).unwrap();
        // A corner of the square goes along one side.
        assert!((at.mm - 2.0).abs() < 1e-12, "{at:?}");
    }

    #[test]
    fn outside_of_the_neighbour_there_is_no_answer() {
        let places = Places::of_cubes(vec![None, Some((0, DAffine3::IDENTITY))]);
        let above = |z: f64| [DAffine3::IDENTITY, DAffine3::from_translation(z * DVec3::Z)];
        assert!(places.away(1, &above(2.9), 1.0).is_some());
        assert!(places.away(1, &above(3.1), 1.0).is_none());
        assert!(places.away(0, &above(0.0), 1.0).is_none(), "no place");
        assert!(places.away(7, &above(0.0), 1.0).is_none(), "no such part");
    }
}
