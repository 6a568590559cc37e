//! Joins the texts of several files into one: renumbers entities, and replaces a product that another file describes by that file's product.

use super::exchange::{Entity, Exchange, reference};
use super::structure::{Structure, argument};
use std::ops::Range;

impl Exchange {
    /// Appends all entities of `other`, a file with the name `name`; returns the offset of their indices. `None` when no numbers are left.
    pub fn append(&mut self, other: &Exchange, name: &str) -> Option<usize> {
        let offset = self.entities.len();
        let base = self.largest.checked_add(1)?;
        let last = base.checked_add(other.entities.len() as u64)?;
        let file = u32::try_from(self.files.len()).ok()?.checked_add(1)?;
        self.files.push(name.to_owned());
        let renumbered = |id: u64| other.find(id).map(|index| base + index as u64);
        for index in 0..other.entities.len() {
            let (start, first) = (self.bodies.len(), self.references.len());
            with_references(other.body(index), renumbered, &mut self.bodies);
            let targets = other.references_of(index).iter().copied().filter_map(renumbered);
            self.references.extend(targets);
            let id = base + index as u64;
            self.index.insert(id, self.entities.len() as u32);
            self.entities.push(Entity {
                id,
                written: other.entities[index].written,
                file,
                line: other.entities[index].line,
                body: start..self.bodies.len(),
                references: first..self.references.len(),
            });
        }
        self.largest = last;
        Some(offset)
    }

    /// Replaces the product definition `stub` in all its placements by the product `real`, a product definition and its representation. `structure`
    /// is that of the text that contains `stub`, whose entities are `text`. Placements start from the identity ([`super::from_identity`]), which is
    /// the same in the unit of `real`.
    pub fn substitute(
        &mut self,
        stub: usize,
        [real, shape]: [usize; 2],
        structure: &Structure,
        text: &Range<usize>,
    ) {
        let offset = text.start;
        let stubs: Vec<usize> = structure
            .representations_of(stub - offset)
            .map(|of| of + offset)
            .collect();
        let placed: Vec<usize> = (structure.occurrences.iter())
            .filter(|&&[_, _, child]| child + offset == stub)
            .map(|&[occurrence, ..]| occurrence + offset)
            .collect();
        for &occurrence in &placed {
            self.exchange(occurrence, stub, real);
        }
        let relations: Vec<usize> = text
            .clone()
            .filter(|&entity| self.kind(entity) == "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION")
            .filter(|&entity| {
                let shape = argument(self, entity, 1).and_then(|shape| argument(self, shape, 2));
                shape.is_some_and(|occurrence| placed.contains(&occurrence))
            })
            .filter_map(|entity| argument(self, entity, 0))
            .collect();
        for relation in relations {
            for &of in &stubs {
                self.exchange(relation, of, shape);
            }
        }
        for &[definition, _, entity] in &structure.representations {
            // Without its shape the stub is no longer a separate product.
            if definition + offset == stub {
                self.replace(entity + offset, "DESCRIPTIVE_REPRESENTATION_ITEM('','')".into());
            }
        }
    }

    /// Replaces all references of `entity` to `from` by `to`.
    pub(super) fn exchange(&mut self, entity: usize, from: usize, to: usize) {
        let [from, to] = [from, to].map(|index| self.entities[index].id);
        let mut body = Vec::new();
        with_references(
            self.body(entity),
            |id| Some(if id == from { to } else { id }),
            &mut body,
        );
        self.replace(entity, String::from_utf8_lossy(&body).into_owned());
        let references = self.entities[entity].references.clone();
        for id in &mut self.references[references] {
            if *id == from {
                *id = to;
            }
        }
    }
}

/// Copies a body with each reference replaced by the result of `of`, or by `$` for `None`.
fn with_references(body: &[u8], of: impl Fn(u64) -> Option<u64>, out: &mut Vec<u8>) {
    let (mut at, mut quoted) = (0, false);
    while let Some(&byte) = body.get(at) {
        at += 1;
        match byte {
            b'#' if !quoted => {
                let digits = body[at..].iter().take_while(|b| b.is_ascii_digit()).count();
                match reference(&body[at - 1..at + digits]).and_then(&of) {
                    Some(id) => out.extend_from_slice(format!("#{id}").as_bytes()),
                    None => out.push(b'$'),
                }
                at += digits;
            }
            _ => {
                quoted ^= byte == b'\'';
                out.push(byte);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn appended_entities_keep_their_references_and_texts() {
        let parse = |data: &str| {
            let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
            super::super::parse(text.as_bytes()).unwrap()
        };
        let mut file = parse("#1=A(#2);#2=B();");
        let other = parse("#2=C('#1',#1,#7);#1=D((#2,#1));");
        assert_eq!(file.append(&other, "x.step"), Some(2));
        assert_eq!(file.body(2), b"C('#1',#4,$)");
        assert_eq!(file.body(3), b"D((#3,#4))");
        assert_eq!(file.references_of(3), [3, 4]);
        assert_eq!(file.label(2), "#2 C of x.step");
        let mut full = parse("#18446744073709551615=A();");
        assert_eq!(full.append(&other, "x.step"), None);
    }
}
