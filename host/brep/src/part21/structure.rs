//! Products, their occurrences in each other, and the representations that contain their shapes.

use super::check::{SOLIDS, SURFACES};
use super::exchange::{Exchange, reference, references};
use std::collections::{HashMap, HashSet};

/// Placements of products in each other, and the representations of their shapes. All numbers are indices of entities.
#[derive(Clone, Debug, Default)]
pub struct Structure {
    /// Product definitions in file order.
    pub definitions: Vec<usize>,
    /// Occurrence, parent product, placed product.
    pub occurrences: Vec<[usize; 3]>,
    /// Product definition and its representation, by `SHAPE_DEFINITION_REPRESENTATION` (third).
    pub representations: Vec<[usize; 3]>,
    /// Pairs of representations of the same shape.
    same: Vec<[usize; 2]>,
    /// A representation and another one placed in it.
    placed: Vec<[usize; 2]>,
    /// Number of solids and surface models of a representation.
    solids: HashMap<usize, u64>,
}

impl Structure {
    /// Reads the structure of a text. Inconsistent entities are skipped: the checks or the kernel reject them.
    pub fn of(file: &Exchange) -> Self {
        let mut found = Self::default();
        let related: HashSet<usize> = of_kind(file, "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION")
            .filter_map(|entity| argument(file, entity, 0))
            .collect();
        for entity in 0..file.entities.len() {
            let kind = file.kind(entity);
            match kind {
                "NEXT_ASSEMBLY_USAGE_OCCURRENCE" => {
                    if let (Some(parent), Some(child)) =
                        (argument(file, entity, 3), argument(file, entity, 4))
                    {
                        found.occurrences.push([entity, parent, child]);
                    }
                }
                "SHAPE_DEFINITION_REPRESENTATION" => found.represented(file, entity),
                _ if is_definition(kind) => found.definitions.push(entity),
                _ if kind.ends_with("SHAPE_REPRESENTATION") => found.items(file, entity),
                _ if !related.contains(&entity) => found.relationship(file, entity),
                _ => {}
            }
        }
        found
    }

    fn represented(&mut self, file: &Exchange, entity: usize) {
        let shape = argument(file, entity, 0);
        let definition = shape.and_then(|shape| argument(file, shape, 2));
        if let (Some(definition), Some(representation)) = (definition, argument(file, entity, 1)) {
            self.representations.push([definition, representation, entity]);
        }
    }

    fn items(&mut self, file: &Exchange, entity: usize) {
        let arguments = file.arguments(entity);
        let items = arguments.get(1).map(|list| references(list)).unwrap_or_default();
        for item in items.into_iter().filter_map(|id| file.find(id)) {
            let kinds = file.kinds(item);
            if kinds
                .iter()
                .any(|kind| SOLIDS.contains(kind) || SURFACES.contains(kind))
            {
                *self.solids.entry(entity).or_default() += 1;
            } else if kinds.contains(&"MAPPED_ITEM") {
                let map = argument(file, item, 1);
                if let Some(mapped) = map.and_then(|map| argument(file, map, 1)) {
                    self.placed.push([entity, mapped]);
                }
            }
        }
    }

    fn relationship(&mut self, file: &Exchange, entity: usize) {
        let kinds = ["REPRESENTATION_RELATIONSHIP", "SHAPE_REPRESENTATION_RELATIONSHIP"];
        let ends = kinds.iter().find_map(|kind| {
            let arguments = file.arguments_as(entity, kind)?;
            let end = |i: usize| file.find(reference(arguments.get(i)?)?);
            Some([end(2)?, end(3)?])
        });
        let Some([a, b]) = ends else { return };
        let kinds = file.kinds(entity);
        if kinds.contains(&"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION") {
            self.placed.push([b, a]);
        } else {
            self.same.push([a, b]);
        }
    }

    /// Product definitions that are not placed in any other.
    pub fn roots(&self) -> Vec<usize> {
        let placed: HashSet<usize> = self.occurrences.iter().map(|&[_, _, child]| child).collect();
        let mut roots = self.definitions.clone();
        roots.retain(|definition| !placed.contains(definition));
        roots
    }

    /// Representations of a product definition.
    pub fn representations_of(&self, definition: usize) -> impl Iterator<Item = usize> {
        let its = move |&&[owner, ..]: &&[usize; 3]| owner == definition;
        self.representations.iter().filter(its).map(|&[_, of, _]| of)
    }

    /// Whether a product has components, solids or surfaces in this text.
    pub fn has_shape(&self, definition: usize) -> bool {
        if self
            .occurrences
            .iter()
            .any(|&[_, parent, _]| parent == definition)
        {
            return true;
        }
        let mut seen: HashSet<usize> = self.representations_of(definition).collect();
        let mut open: Vec<usize> = seen.iter().copied().collect();
        while let Some(at) = open.pop() {
            if self.solids.contains_key(&at) || self.placed.iter().any(|&[around, _]| around == at) {
                return true;
            }
            for &[a, b] in self.same.iter().filter(|pair| pair.contains(&at)) {
                let other = if a == at { b } else { a };
                if seen.insert(other) {
                    open.push(other);
                }
            }
        }
        false
    }

    /// Number of parts after unfolding the assembly: solids, surface models and empty products, each counted once per placement. [`u64::MAX`] stands
    /// for that many or more. Cost: one pass over the structure, regardless of the number of placements.
    pub fn unfolded(&self) -> u64 {
        let mut below: HashMap<usize, Vec<usize>> = HashMap::new();
        let mut placed = HashSet::new();
        let occurrences = self.occurrences.iter().map(|&[_, parent, child]| [parent, child]);
        let shapes = self.representations.iter().map(|&[owner, of, _]| [owner, of]);
        // Of two representations of the same shape, either may contain the solids: each counts for the other, once.
        let same = self.same.iter().flat_map(|&[a, b]| [[a, b], [b, a]]);
        let edges = occurrences.chain(shapes).chain(self.placed.iter().copied());
        for [from, to] in edges {
            below.entry(from).or_default().push(to);
            placed.insert(to);
        }
        for [from, to] in same {
            below.entry(from).or_default().push(to);
        }
        let mut parts = HashMap::new();
        let mut total = 0u64;
        for &start in self.definitions.iter().filter(|node| !placed.contains(node)) {
            self.count(start, &below, &mut parts);
            total = total.saturating_add(parts[&start]);
        }
        total
    }

    /// Depth-first count with an explicit stack; an edge back to a node in progress adds nothing.
    fn count(&self, start: usize, below: &HashMap<usize, Vec<usize>>, parts: &mut HashMap<usize, u64>) {
        let mut stack = vec![(start, 0, 0u64)];
        let mut open = HashSet::from([start]);
        while let Some((node, next, sum)) = stack.last_mut() {
            let child = below.get(node).and_then(|children| children.get(*next)).copied();
            if let Some(child) = child {
                match parts.get(&child) {
                    Some(known) => {
                        *sum = sum.saturating_add(*known);
                        *next += 1;
                    }
                    None if open.insert(child) => stack.push((child, 0, 0)),
                    None => *next += 1,
                }
                continue;
            }
            let own = self.solids.get(node).copied().unwrap_or(0);
            let mut found = sum.saturating_add(own);
            if found == 0 && self.definitions.binary_search(node).is_ok() {
                found = 1;
            }
            parts.insert(*node, found);
            open.remove(node);
            stack.pop();
        }
    }
}

/// Types of product definitions.
pub fn is_definition(kind: &str) -> bool {
    matches!(
        kind,
        "PRODUCT_DEFINITION" | "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS"
    )
}

/// Entities of one type.
pub fn of_kind<'a>(file: &'a Exchange, kind: &'a str) -> impl Iterator<Item = usize> + 'a {
    (0..file.entities.len()).filter(move |&entity| file.kind(entity) == kind)
}

/// Entity to which argument number `index` of a simple entity refers.
pub fn argument(file: &Exchange, entity: usize, index: usize) -> Option<usize> {
    file.find(reference(file.arguments(entity).get(index)?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn structure(data: &str) -> Structure {
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        Structure::of(&super::super::parse(text.as_bytes()).unwrap())
    }

    /// Each level contains the next one twice: 2ⁿ parts.
    fn nested(levels: usize) -> String {
        let mut data = String::from(
            "#1=PRODUCT_DEFINITION('','',$,$);#2=PRODUCT_DEFINITION_SHAPE('','',#1);#3=SHAPE_DEFINITION_REPRESENTATION(#2,#4);\
             #4=SHAPE_REPRESENTATION('',(),$);#5=SHAPE_REPRESENTATION_RELATIONSHIP('','',#6,#4);\
             #6=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#7),$);#7=MANIFOLD_SOLID_BREP('',$);#100=PRODUCT_DEFINITION('','',$,$);\
             #1000=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#100,#1,$);",
        );
        for level in 0..levels {
            data += &format!("#{}=PRODUCT_DEFINITION('','',$,$);", 101 + level);
            for twice in 0..2 {
                let id = 2000 + 2 * level + twice;
                data += &format!(
                    "#{id}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#{},#{},$);",
                    101 + level,
                    100 + level
                );
            }
        }
        data
    }

    #[test]
    fn instances_are_counted_without_unfolding() {
        for levels in [0, 1, 5, 24, 63] {
            assert_eq!(structure(&nested(levels)).unfolded(), 1 << levels, "{levels}");
        }
        assert_eq!(structure(&nested(200)).unfolded(), u64::MAX);
    }

    #[test]
    fn mapped_items_count_as_often_as_they_are_mapped() {
        let data = "#1=PRODUCT_DEFINITION('','',$,$);#2=PRODUCT_DEFINITION_SHAPE('','',#1);#3=SHAPE_DEFINITION_REPRESENTATION(#2,#4);\
            #4=SHAPE_REPRESENTATION('',(#10,#11,#12),$);#9=REPRESENTATION_MAP(#8,#6);#8=AXIS();#10=MAPPED_ITEM('',#9,#8);\
            #11=MAPPED_ITEM('',#9,#8);#12=MAPPED_ITEM('',#9,#8);#6=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#7),$);#7=MANIFOLD_SOLID_BREP('',$);";
        let found = structure(data);
        assert_eq!(found.unfolded(), 3);
        assert!(found.has_shape(found.definitions[0]));
    }

    #[test]
    fn a_product_without_shape_is_known_and_counts_as_one() {
        let data = "#1=PRODUCT_DEFINITION('','',$,$);#2=PRODUCT_DEFINITION_SHAPE('','',#1);#3=SHAPE_DEFINITION_REPRESENTATION(#2,#4);\
            #4=SHAPE_REPRESENTATION('',(#8),$);#8=AXIS();";
        let found = structure(data);
        assert!(!found.has_shape(found.definitions[0]));
        assert_eq!((found.unfolded(), found.roots()), (1, vec![0]));
    }
}
