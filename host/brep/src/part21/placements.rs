//! Placements of one axis onto another, in a form that the kernel handles correctly.
//!
//! A placed representation is moved so that its own axis coincides with the given axis: by given · own⁻¹ (ISO 10303-43, item_defined_transformation
//! and mapped_item). The kernel computes own⁻¹ · given, which is the same only if one of the two is the identity, and it completes an axis without a
//! reference direction in its own way. So such placements are rewritten here: from the identity, onto the axis given · own⁻¹. The identity is the
//! same in every unit, so the placed representation can then be substituted by another, in any unit.

use super::exchange::{Exchange, reference, references};
use super::structure::{Structure, argument, of_kind};
use super::units;
use glam::{DAffine3, DMat3, DVec3};
use std::collections::{HashMap, HashSet};

/// Rewrites every placement whose own axis is not the identity, or whose given axis has no reference direction. Placements that cannot be determined
/// are left unchanged. Cost: one pass, plus the items of each representation once.
pub fn from_identity(file: &mut Exchange) {
    let structure = Structure::of(file);
    let relations: Vec<usize> = (0..file.entities.len())
        .filter(|&entity| {
            file.kinds(entity)
                .contains(&"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION")
        })
        .collect();
    let placed_last: HashSet<usize> = of_kind(file, "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION")
        .filter_map(|entity| {
            let relation = argument(file, entity, 0)?;
            let occurrence = argument(file, argument(file, entity, 1)?, 2)?;
            let child = argument(file, occurrence, 4)?;
            let last = file.related_representations(relation)?[1];
            structure
                .representations_of(child)
                .any(|of| of == last)
                .then_some(relation)
        })
        .collect();
    let mut items = Items::default();
    for relation in relations {
        let _ = file.relation_from_identity(relation, placed_last.contains(&relation), &mut items);
    }
    let mapped: Vec<[usize; 2]> = (0..file.entities.len())
        .filter(|&entity| file.kind(entity).ends_with("SHAPE_REPRESENTATION"))
        .flat_map(|around| {
            let items = file
                .arguments(around)
                .get(1)
                .map(|list| references(list))
                .unwrap_or_default();
            let items = items.into_iter().filter_map(|id| file.find(id));
            items.map(move |item| [around, item]).collect::<Vec<_>>()
        })
        .filter(|&[_, item]| file.kind(item) == "MAPPED_ITEM")
        .collect();
    for [around, item] in mapped {
        let _ = file.item_from_identity(around, item);
    }
}

/// Items of representations, each representation read once.
#[derive(Default)]
struct Items(HashMap<usize, HashSet<u64>>);

impl Items {
    fn has(&mut self, file: &Exchange, representation: usize, item: usize) -> bool {
        let items = self.0.entry(representation).or_insert_with(|| {
            let arguments = file.arguments(representation);
            let items = arguments.get(1).map(|list| references(list));
            items.unwrap_or_default().into_iter().collect()
        });
        items.contains(&file.entities[item].id)
    }
}

impl Exchange {
    /// The two representations of a relationship: the first is placed in the second.
    fn related_representations(&self, relation: usize) -> Option<[usize; 2]> {
        let ends = ["REPRESENTATION_RELATIONSHIP", "SHAPE_REPRESENTATION_RELATIONSHIP"]
            .iter()
            .find_map(|kind| self.arguments_as(relation, kind).filter(|all| all.len() >= 4))?;
        let end = |index: usize| self.find(reference(ends[index])?);
        Some([end(2)?, end(3)?])
    }

    /// The transformation of a relationship.
    pub(super) fn transformation(&self, relation: usize) -> Option<usize> {
        let with = self.arguments_as(relation, "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION")?;
        self.find(reference(with.last()?)?)
    }

    /// Gives `relation` its own transformation, in which the axis of the placed representation is the identity. With `placed_last` the second
    /// representation is the placed one.
    fn relation_from_identity(
        &mut self,
        relation: usize,
        placed_last: bool,
        items: &mut Items,
    ) -> Option<()> {
        let transformation = self.transformation(relation)?;
        if self.kind(transformation) != "ITEM_DEFINED_TRANSFORMATION" {
            return None;
        }
        let [one, two] = self.related_representations(relation)?;
        let mut axes = [
            argument(self, transformation, 2)?,
            argument(self, transformation, 3)?,
        ];
        // Some writers list the axes in the wrong order; the items of the representations decide.
        let mut within = |of: usize, axis: usize| items.has(self, of, axis);
        let in_place = within(one, axes[0]) || within(two, axes[1]);
        if !in_place && within(two, axes[0]) && within(one, axes[1]) {
            axes.swap(0, 1);
        }
        let (own, given) = match placed_last {
            false => ((one, axes[0]), (two, axes[1])),
            true => ((two, axes[1]), (one, axes[0])),
        };
        let motion = self.motion(own, given)?;
        let mut axes = [self.write_axis(DAffine3::IDENTITY), self.write_axis(motion)];
        if placed_last {
            axes.swap(0, 1);
        }
        let [first, second] = axes;
        let own = self.push(format!("ITEM_DEFINED_TRANSFORMATION('','',#{first},#{second})"));
        let own = self.find(own)?;
        self.exchange(relation, transformation, own);
        Some(())
    }

    /// Gives the mapped item `item` of the surrounding representation `around` its own map, whose axis is the identity.
    fn item_from_identity(&mut self, around: usize, item: usize) -> Option<()> {
        let map = argument(self, item, 1)?;
        let (own, mapped) = (argument(self, map, 0)?, argument(self, map, 1)?);
        let target = argument(self, item, 2)?;
        let motion = self.motion((mapped, own), (around, target))?;
        let (origin, target_id) = (self.write_axis(DAffine3::IDENTITY), self.write_axis(motion));
        let mapped = self.entities[mapped].id;
        let own = self.push(format!("REPRESENTATION_MAP(#{origin},#{mapped})"));
        let (own, new) = (self.find(own)?, self.find(target_id)?);
        self.exchange(item, map, own);
        self.exchange(item, target, new);
        Some(())
    }

    /// The motion, in the unit of the surrounding representation, that takes the axis `own` onto the axis `given`; both with their representations.
    /// `None` when the kernel computes the same motion, or an axis cannot be read.
    fn motion(&self, own: (usize, usize), given: (usize, usize)) -> Option<DAffine3> {
        let (placed, own) = (own.0, self.read_axis(own.1)?);
        let directed = self.arguments(given.1).get(3) != Some(&&b"$"[..]);
        if own == DAffine3::IDENTITY && directed {
            return None;
        }
        let (around, given) = (given.0, self.read_axis(given.1)?);
        let [placed_mm, around_mm] = [placed, around].map(|of| units::millimetres(self, of).unwrap_or(1.0));
        let own = DAffine3 {
            translation: own.translation * (placed_mm / around_mm),
            ..own
        };
        Some(given * own.inverse())
    }

    /// An axis placement as ISO 10303-42 reads it (function build_axes).
    pub(super) fn read_axis(&self, axis: usize) -> Option<DAffine3> {
        let arguments = self.arguments(axis);
        if self.kind(axis) != "AXIS2_PLACEMENT_3D" || arguments.len() != 4 {
            return None;
        }
        let vector = |index: usize| self.vector(argument(self, axis, index)?);
        let given = |index: usize, default: DVec3| match arguments[index] {
            b"$" => Some(default),
            _ => vector(index)?.try_normalize(),
        };
        let z = given(2, DVec3::Z)?;
        let x = given(3, if z.x.abs() < 1.0 { DVec3::X } else { DVec3::Y })?;
        let x = x.reject_from_normalized(z).try_normalize()?;
        Some(DAffine3 {
            matrix3: DMat3::from_cols(x, z.cross(x), z),
            translation: vector(1)?,
        })
    }

    /// Coordinates of a point, ratios of a direction.
    pub(super) fn vector(&self, entity: usize) -> Option<DVec3> {
        let arguments = self.arguments(entity);
        let list = std::str::from_utf8(arguments.get(1)?)
            .ok()?
            .strip_prefix('(')?
            .strip_suffix(')')?;
        let mut numbers = list.split(',').map(|n| n.parse::<f64>().ok());
        Some(DVec3::new(numbers.next()??, numbers.next()??, numbers.next()??))
    }

    /// Adds the axis placement to which `motion` takes the identity; returns its number.
    pub(super) fn write_axis(&mut self, motion: DAffine3) -> u64 {
        let triple = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z).to_uppercase();
        let origin = self.push(format!("CARTESIAN_POINT('',{})", triple(motion.translation)));
        let [z, x] = [motion.matrix3.z_axis, motion.matrix3.x_axis]
            .map(|axis| self.push(format!("DIRECTION('',{})", triple(axis))));
        self.push(format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }
}
