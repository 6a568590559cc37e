//! Placements by CARTESIAN_TRANSFORMATION_OPERATOR_3D, which may mirror and scale.
//!
//! The kernel silently uses only the rigid part of an operator, and crashes on its short form. So an operator that places a product is split here: x
//! ↦ o + s·M·x with M orthogonal becomes a rigid motion (R, o), which the kernel gets as an axis placement, and a signed scale k (R = M, k = s; or R
//! = −M, k = −s when M mirrors), which is part of the occurrence's token ([`Exchange::scales`]). Other mapped items of a representation with such an
//! operator become occurrences, because only those have names.

use super::exchange::{Exchange, Part21Error, reference, references};
use super::units;
use glam::{DAffine3, DMat3, DVec3};

/// Largest deviation from 1 of a scale that counts as rigid.
const RIGID: f64 = 1e-9;

/// x ↦ o + k·R·x.
struct Operator {
    /// R and o.
    motion: DAffine3,
    /// k.
    scale: f64,
}

/// Splits all operators that place products, and rewrites the others in the form that the kernel expects.
///
/// # Errors
/// [`Part21Error::Invalid`] for an operator with missing parts, or one that places something other than a product.
pub fn split(file: &mut Exchange) -> Result<(), Part21Error> {
    let operators: Vec<usize> = (0..file.entities.len())
        .filter(|&e| file.kinds(e).contains(&"CARTESIAN_TRANSFORMATION_OPERATOR_3D"))
        .collect();
    if operators.is_empty() {
        return Ok(());
    }
    relationships(file)?;
    mapped_items(file)?;
    for entity in operators {
        spell_out(file, entity);
    }
    Ok(())
}

/// Occurrences placed by an operator.
fn relationships(file: &mut Exchange) -> Result<(), Part21Error> {
    for placed in of_kind(file, "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION") {
        let found = (|| {
            let arguments = file.arguments(placed);
            let relation = file.find(reference(arguments.first()?)?)?;
            let with = file.arguments_as(relation, "REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION")?;
            // A simple instance begins with the relationship's own four arguments.
            let operator = file.find(reference(with.last()?)?)?;
            let shape = file.find(reference(arguments.get(1)?)?)?;
            let occurrence = file.find(reference(file.arguments(shape).get(2)?)?)?;
            is_operator(file, operator).then_some((relation, operator, occurrence))
        })();
        let Some((relation, operator, occurrence)) = found else {
            continue;
        };
        let placement = parsed(file, operator)?;
        let from = file.write_axis(DAffine3::IDENTITY);
        let to = file.write_axis(placement.motion);
        let motion = file.push(format!("ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to})"));
        let old = format!("#{}", file.entities[operator].id);
        let body =
            String::from_utf8_lossy(file.body(relation)).replace(&format!("{old})"), &format!("#{motion})"));
        file.replace(relation, body);
        file.scale(occurrence, placement.scale);
    }
    Ok(())
}

/// Mapped items of representations in which an operator mirrors or scales.
fn mapped_items(file: &mut Exchange) -> Result<(), Part21Error> {
    let representations: Vec<usize> = (0..file.entities.len())
        .filter(|&e| file.kind(e).ends_with("SHAPE_REPRESENTATION") && file.arguments(e).len() == 3)
        .collect();
    for representation in representations {
        let items: Vec<usize> = file
            .arguments(representation)
            .get(1)
            .map(|list| references(list))
            .unwrap_or_default()
            .into_iter()
            .filter_map(|id| file.find(id))
            .filter(|&item| file.kind(item) == "MAPPED_ITEM")
            .collect();
        let targets: Vec<Option<usize>> = items.iter().map(|&item| argument(file, item, 2)).collect();
        if !targets.iter().flatten().any(|&target| is_operator(file, target)) {
            continue;
        }
        for (item, target) in items.into_iter().zip(targets) {
            occurrence(file, representation, item, target).unwrap_or_else(|| {
                let what = format!(
                    "{} places something other than a product by an operator",
                    file.label(item)
                );
                Err(Part21Error::Invalid {
                    line: file.entities[item].line,
                    what,
                })
            })?;
        }
    }
    Ok(())
}

/// Turns a mapped item into an occurrence; `None` when one of the sides has no product.
fn occurrence(
    file: &mut Exchange,
    parent: usize,
    item: usize,
    target: Option<usize>,
) -> Option<Result<(), Part21Error>> {
    let map = argument(file, item, 1)?;
    let (from, child) = (argument(file, map, 0)?, argument(file, map, 1)?);
    let (parent_product, child_product) = (product(file, parent)?, product(file, child)?);
    let target = target?;
    let (from, to, scale) = if is_operator(file, target) {
        let Operator { motion, scale } = match parsed(file, target) {
            Ok(placement) => placement,
            Err(error) => return Some(Err(error)),
        };
        // The mapped item is given relative to its own axis A: o + k·R·A⁻¹x, and with A⁻¹ = (Q, t) this is (R, o)·(Q, k·t) applied to k·x.
        let mut own = file.read_axis(from)?.inverse();
        let mm = [child, parent].map(|of| units::millimetres(file, of).unwrap_or(1.0));
        own.translation *= scale * mm[0] / mm[1];
        (
            file.write_axis(DAffine3::IDENTITY),
            file.write_axis(motion * own),
            scale,
        )
    } else {
        (file.entities[from].id, file.entities[target].id, 1.0)
    };
    let (parent, child) = (file.entities[parent].id, file.entities[child].id);
    let use_of = file.push(format!(
        "NEXT_ASSEMBLY_USAGE_OCCURRENCE('mapped','','',#{parent_product},#{child_product},$)"
    ));
    let shape = file.push(format!("PRODUCT_DEFINITION_SHAPE('','',#{use_of})"));
    let motion = file.push(format!("ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to})"));
    let relation = file.push(format!(
        "(REPRESENTATION_RELATIONSHIP('','',#{child},#{parent})\
         REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{motion})SHAPE_REPRESENTATION_RELATIONSHIP())"
    ));
    file.push(format!(
        "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})"
    ));
    if let Some(use_of) = file.find(use_of) {
        file.scale(use_of, scale);
    }
    // The item itself must not be drawn a second time; a point draws nothing.
    file.replace(item, "CARTESIAN_POINT('',(0.,0.,0.))".into());
    Some(Ok(()))
}

/// Expands the short form with six arguments: the kernel also expects the two of FUNCTIONALLY_DEFINED_TRANSFORMATION.
fn spell_out(file: &mut Exchange, entity: usize) {
    let arguments = file.arguments(entity);
    if file.kind(entity) == "CARTESIAN_TRANSFORMATION_OPERATOR_3D" && arguments.len() == 6 {
        let own = arguments[1..]
            .iter()
            .map(|a| String::from_utf8_lossy(a))
            .collect::<Vec<_>>()
            .join(",");
        let name = String::from_utf8_lossy(arguments[0]).into_owned();
        file.replace(
            entity,
            format!("CARTESIAN_TRANSFORMATION_OPERATOR_3D({name},'','',{own})"),
        );
    }
}

/// The product definition whose shape is this representation.
fn product(file: &Exchange, representation: usize) -> Option<u64> {
    of_kind(file, "SHAPE_DEFINITION_REPRESENTATION")
        .into_iter()
        .find_map(|entity| {
            (argument(file, entity, 1)? == representation).then_some(())?;
            let definition = argument(file, argument(file, entity, 0)?, 2)?;
            Some(file.entities[definition].id)
        })
}

fn is_operator(file: &Exchange, entity: usize) -> bool {
    file.kinds(entity)
        .contains(&"CARTESIAN_TRANSFORMATION_OPERATOR_3D")
}

/// Reads an operator as ISO 10303-42 does (function base_axis): the third axis is primary, the first is made orthogonal to it, the second only
/// determines the handedness.
fn parsed(file: &Exchange, entity: usize) -> Result<Operator, Part21Error> {
    let read = || {
        let own = |kind| file.arguments_as(entity, kind).unwrap_or_default();
        let (common, third) = match file.kind(entity) {
            "" => (
                own("CARTESIAN_TRANSFORMATION_OPERATOR"),
                own("CARTESIAN_TRANSFORMATION_OPERATOR_3D"),
            ),
            _ => {
                let mut all = file.arguments(entity);
                let third = all.pop()?;
                // The operator's own four arguments are preceded by one inherited argument, or by three.
                (all.split_off(all.len().checked_sub(4)?), vec![third])
            }
        };
        let vector = |argument: &[u8]| file.vector(file.find(reference(argument)?)?);
        let given = |argument: Option<&&[u8]>| argument.filter(|a| **a != b"$").map(|a| vector(a));
        let z = given(third.last()).unwrap_or(Some(DVec3::Z))?.try_normalize()?;
        let x = given(common.first()).unwrap_or(Some(if z.x.abs() < 0.9 { DVec3::X } else { DVec3::Y }))?;
        let x = x.reject_from_normalized(z).try_normalize()?;
        let y = given(common.get(1)).unwrap_or(Some(z.cross(x)))?;
        let scale = match common.get(3).map(|a| std::str::from_utf8(a)) {
            None | Some(Ok("$")) => 1.0,
            Some(text) => text.ok()?.parse::<f64>().ok().filter(|s| *s > 0.0)?,
        };
        let origin = vector(common.get(2)?)?;
        // −M has the axes −x and −z, and its y is their cross product.
        let sign = if y.dot(z.cross(x)) < 0.0 { -1.0 } else { 1.0 };
        let [x, z] = [x * sign, z * sign];
        Some(Operator {
            motion: DAffine3 {
                matrix3: DMat3::from_cols(x, z.cross(x), z),
                translation: origin,
            },
            scale: scale * sign,
        })
    };
    read().ok_or_else(|| Part21Error::Invalid {
        line: file.entities[entity].line,
        what: format!("{} is not a valid transformation", file.label(entity)),
    })
}

fn of_kind(file: &Exchange, kind: &str) -> Vec<usize> {
    (0..file.entities.len())
        .filter(|&e| file.kind(e) == kind)
        .collect()
}

fn argument(file: &Exchange, entity: usize, number: usize) -> Option<usize> {
    file.find(reference(file.arguments(entity).get(number)?)?)
}

impl Exchange {
    /// Adds an entity and returns its number, which is greater than all others.
    pub fn push(&mut self, body: String) -> u64 {
        // If the file contains the number 2⁶⁴ − 1, it would repeat here; the pushed entity then hides the file's last.
        let id = self.largest.saturating_add(1);
        self.largest = id;
        let line = self.entities.last().map_or(0, |e| e.line);
        self.index.insert(id, self.entities.len() as u32);
        self.entities.push(super::exchange::Entity {
            id,
            written: id,
            file: 0,
            line,
            body: 0..0,
            references: 0..0,
        });
        self.replace(self.entities.len() - 1, body);
        id
    }

    /// Replaces the body of an entity. Its references stay unchanged: only the checks need them, and these are finished.
    pub fn replace(&mut self, entity: usize, body: String) {
        let start = self.bodies.len();
        self.bodies.extend_from_slice(body.as_bytes());
        self.entities[entity].body = start..self.bodies.len();
    }

    fn scale(&mut self, occurrence: usize, scale: f64) {
        if (scale - 1.0).abs() > RIGID {
            self.scales.insert(occurrence, scale);
        }
    }
}
