//! Noun phrases to parts of the assembly: names, numbers, places by geometry, sizes, pronouns.
//!
//! Axes of places: left −x, right +x, front −y, rear +y, lower −z, upper +z of the file. A place that a part's name states ("bearing-front",
//! `housing_upper`) comes before geometry. What fits several parts is a question with the candidates; nothing is guessed.

use glam::DVec3;

use crate::lexicon::{self, Place, Size};
use crate::phrase::{Phrase, Pronoun, Quantity};
use crate::token::Names;
use crate::turn::{Code, Trouble};

/// Largest spread across a row, as a share of its length.
const ROW: f64 = 0.1;

/// What references need to know of a part.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Name.
    pub name: String,
    /// Subassemblies that contain it.
    pub path: Vec<String>,
    /// Middle of its box, mm, assembly frame.
    pub center: DVec3,
    /// Size of its box, mm.
    pub size: DVec3,
    /// Volume, mm³.
    pub volume_mm3: f64,
    /// Number of its shape: equal parts have the same.
    pub shape: usize,
    /// Parts it is connected to now.
    pub connected: Vec<usize>,
}

/// The parts as they are now.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// Names as tokens.
    pub names: &'a Names,
    /// Parts in file order.
    pub parts: Vec<Seen>,
}

/// What was spoken of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// Parts of the last noun phrase that moved or was chosen.
    pub last: Vec<usize>,
    /// All parts that the same words could mean, for "the other one".
    pub class: Vec<usize>,
}

/// What a phrase is resolved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To be taken away: parts connected to nothing are not meant by a plural.
    Remove,
    /// To be put somewhere.
    Connect,
    /// A destination or owner.
    Owner,
    /// To be moved in place.
    Move,
}

/// Parts meant, with all that the words could mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Meant {
    /// The parts, in the order named.
    pub parts: Vec<usize>,
    /// The class of the words.
    pub class: Vec<usize>,
}

impl Scene<'_> {
    fn name(&self, part: usize) -> &str {
        &self.parts[part].name
    }

    /// Parts that `phrase` means; `near`: parts it is taken off or out of, which limits the candidates to those connected to them.
    ///
    /// # Errors
    /// [`Trouble`]: several candidates, or none.
    pub fn resolve(
        &self,
        phrase: &Phrase,
        memory: &Memory,
        purpose: Purpose,
        near: &[usize],
    ) -> Result<Meant, Trouble> {
        let mut meant = self.single(phrase, memory, purpose, near)?;
        for more in &phrase.and {
            let next = self.single(more, memory, purpose, near)?;
            for part in next.parts {
                if !meant.parts.contains(&part) {
                    meant.parts.push(part);
                }
            }
            meant.class.extend(next.class);
        }
        Ok(meant)
    }

    fn single(
        &self,
        phrase: &Phrase,
        memory: &Memory,
        purpose: Purpose,
        near: &[usize],
    ) -> Result<Meant, Trouble> {
        if phrase.pronoun.is_some() {
            return self.pronoun(phrase, memory);
        }
        if !phrase.names.is_empty() {
            return Ok(Meant {
                parts: phrase.names.clone(),
                class: self.class_of(phrase.names[0]),
            });
        }
        let mut candidates = if phrase.nouns.is_empty() {
            self.again(phrase, memory)?
        } else {
            self.named(phrase)?
        };
        let class = candidates.clone();
        self.sort(&mut candidates);
        candidates = self.located(phrase, candidates)?;
        if let Some(owner) = &phrase.of {
            let owners = self.single(owner, memory, Purpose::Owner, &[])?.parts;
            candidates = self.prefer(candidates, |p| {
                owners
                    .iter()
                    .any(|o| self.parts[p].connected.contains(o) || p == *o)
            });
        }
        if phrase.free {
            let said = |p: usize| self.names.words(p).iter().any(|w| w == "free" || w == "loose");
            let by_name = candidates.iter().any(|&p| said(p));
            candidates.retain(|&p| {
                if by_name {
                    said(p)
                } else {
                    self.parts[p].connected.is_empty()
                }
            });
            if candidates.is_empty() {
                return Err(self.none(phrase, "is loose"));
            }
        }
        if !near.is_empty() {
            candidates = self.prefer(candidates, |p| {
                near.iter().any(|o| self.parts[p].connected.contains(o))
            });
        }
        if purpose == Purpose::Remove && phrase.quantity != Quantity::One {
            candidates = self.prefer(candidates, |p| !self.parts[p].connected.is_empty());
        }
        if purpose != Purpose::Owner && phrase.nouns.is_empty() && candidates.is_empty() {
            return Err(Trouble::Refuse(
                Code::NoReferent,
                format!("nothing was named that \"{}\" could mean", phrase.text),
                vec![],
            ));
        }
        let parts = self.counted(phrase, candidates)?;
        Ok(Meant { parts, class })
    }

    /// Those for which `keep` holds, if there are any; else all.
    fn prefer(&self, candidates: Vec<usize>, keep: impl Fn(usize) -> bool) -> Vec<usize> {
        let kept: Vec<usize> = candidates.iter().copied().filter(|&p| keep(p)).collect();
        if kept.is_empty() { candidates } else { kept }
    }

    fn pronoun(&self, phrase: &Phrase, memory: &Memory) -> Result<Meant, Trouble> {
        let none = || {
            Trouble::Refuse(
                Code::NoReferent,
                format!("no part was named before that \"{}\" could mean", phrase.text),
                vec![],
            )
        };
        if memory.last.is_empty() {
            return Err(none());
        }
        let mut others: Vec<usize> = memory
            .class
            .iter()
            .copied()
            .filter(|p| !memory.last.contains(p))
            .collect();
        if !phrase.nouns.is_empty() {
            let named = self.named(phrase)?;
            others = named.into_iter().filter(|p| !memory.last.contains(p)).collect();
            others = self.located(phrase, others)?;
        }
        let parts = match phrase.pronoun {
            Some(Pronoun::It) if memory.last.len() > 1 => {
                return Err(self.ask(phrase, memory.last.clone()));
            }
            Some(Pronoun::Other) if others.len() > 1 => return Err(self.ask(phrase, others)),
            Some(Pronoun::Other | Pronoun::Others) => others,
            _ => memory.last.clone(),
        };
        if parts.is_empty() {
            return Err(none());
        }
        if phrase.quantity == Quantity::Both && parts.len() != 2 {
            return Err(self.ask(phrase, parts));
        }
        Ok(Meant {
            parts,
            class: memory.class.clone(),
        })
    }

    /// "the second one": of the parts spoken of.
    fn again(&self, phrase: &Phrase, memory: &Memory) -> Result<Vec<usize>, Trouble> {
        let found = if memory.last.len() > 1 {
            &memory.last
        } else {
            &memory.class
        };
        if found.is_empty() {
            return Err(Trouble::Refuse(
                Code::NoReferent,
                format!("no part was named before that \"{}\" could mean", phrase.text),
                vec![],
            ));
        }
        Ok(found.clone())
    }

    /// Parts of the same kind of name: equal words.
    fn class_of(&self, part: usize) -> Vec<usize> {
        let words = self.names.words(part);
        (0..self.parts.len())
            .filter(|&p| self.names.words(p) == words || self.parts[p].shape == self.parts[part].shape)
            .collect()
    }

    /// Parts whose name has the nouns: the head first by the word itself, else by a synonym; other nouns must be in the name unless they name a
    /// kind.
    fn named(&self, phrase: &Phrase) -> Result<Vec<usize>, Trouble> {
        let mut words: Vec<&str> = phrase.nouns.iter().map(String::as_str).collect();
        let Some(head) = words.pop() else {
            return Ok(Vec::new());
        };
        let all = 0..self.parts.len();
        let has = |part: usize, word: &str| self.names.words(part).iter().any(|w| w == word);
        let similar =
            |part: usize, word: &str| self.names.words(part).iter().any(|w| lexicon::same_kind(w, word));
        let numbered = |part: usize, word: &str| {
            word.parse::<f64>()
                .is_ok_and(|n| self.names.numbers(part).iter().any(|&m| f64::from(m) == n))
        };
        let mut found: Vec<usize> = all.clone().filter(|&p| has(p, head)).collect();
        if found.is_empty() && ["part", "component", "everything"].contains(&head) {
            found = all.clone().collect();
        }
        if found.is_empty() {
            found = all.clone().filter(|&p| similar(p, head)).collect();
        }
        if found.is_empty() {
            return Err(self.none(phrase, "is in the assembly"));
        }
        for word in words {
            let direct: Vec<usize> = found
                .iter()
                .copied()
                .filter(|&p| has(p, word) || numbered(p, word))
                .collect();
            let alike: Vec<usize> = found.iter().copied().filter(|&p| similar(p, word)).collect();
            let place = lexicon::find(lexicon::PLACES, word).is_some();
            if !direct.is_empty() {
                found = direct;
            } else if !alike.is_empty() {
                found = alike;
            } else if !lexicon::KINDS.contains(&word) && !place {
                return Err(self.none(phrase, "is in the assembly"));
            }
        }
        Ok(found)
    }

    fn none(&self, phrase: &Phrase, what: &str) -> Trouble {
        Trouble::Refuse(
            Code::NoSuchPart,
            format!("no \"{}\" {what}; its parts are {}", phrase.text, self.listed()),
            vec![],
        )
    }

    fn listed(&self) -> String {
        const SHOWN: usize = 12;
        let names: Vec<&str> = self.parts.iter().take(SHOWN).map(|p| p.name.as_str()).collect();
        let more = self.parts.len().saturating_sub(SHOWN);
        let names = names.join(", ");
        if more > 0 {
            format!("{names} and {more} more")
        } else {
            names
        }
    }

    fn ask(&self, phrase: &Phrase, candidates: Vec<usize>) -> Trouble {
        let names: Vec<&str> = candidates.iter().map(|&p| self.name(p)).collect();
        Trouble::Ask(
            format!("which is meant by \"{}\": {}?", phrase.text, names.join(", ")),
            candidates,
        )
    }

    /// Orders parts by name without numbers, then by their numbers, then as in the file.
    fn sort(&self, parts: &mut [usize]) {
        parts.sort_by_key(|&p| (self.names.words(p), self.names.numbers(p), p));
    }

    /// Applies places, sizes, numbers and ordinals, in this order.
    fn located(&self, phrase: &Phrase, mut candidates: Vec<usize>) -> Result<Vec<usize>, Trouble> {
        for &place in &phrase.places {
            let found = self.at_place(candidates.clone(), place);
            self.distinguished(phrase, &candidates, &found)?;
            candidates = found;
        }
        for &size in &phrase.sizes {
            let found = self.of_size(candidates.clone(), size);
            self.distinguished(phrase, &candidates, &found)?;
            candidates = found;
        }
        if !phrase.numbers.is_empty() {
            candidates = self.numbered(phrase, &candidates)?;
        }
        if let Some(&ordinal) = phrase.ordinals.first() {
            let count = match phrase.quantity {
                Quantity::Count(n) | Quantity::AllOf(n) => n as usize,
                _ => 1,
            };
            let from = if ordinal == 0 {
                candidates.len().saturating_sub(count)
            } else {
                ordinal - 1
            };
            let taken: Vec<usize> = candidates.iter().copied().skip(from).take(count).collect();
            if taken.len() < count {
                let code = if count == 1 {
                    Code::NoSuchPart
                } else {
                    Code::NotEnough
                };
                let words = format!("\"{}\": there are only {}", phrase.text, candidates.len());
                return Err(Trouble::Refuse(code, words, candidates));
            }
            candidates = taken;
        }
        Ok(candidates)
    }

    /// A place or size that all candidates share distinguishes none of them: a question.
    fn distinguished(&self, phrase: &Phrase, before: &[usize], after: &[usize]) -> Result<(), Trouble> {
        let by_name = |p: &usize| {
            self.names.words(*p).iter().any(|w| {
                phrase
                    .text
                    .split_whitespace()
                    .any(|t| lexicon::singular(t) == *w && lexicon::find(lexicon::PLACES, t).is_some())
            })
        };
        let all = before.len() > 1 && before.len() == after.len();
        if all && !before.iter().all(by_name) {
            Err(self.ask(phrase, before.to_vec()))
        } else {
            Ok(())
        }
    }

    fn numbered(&self, phrase: &Phrase, candidates: &[usize]) -> Result<Vec<usize>, Trouble> {
        let mut out = Vec::new();
        let numbered = candidates.iter().any(|&p| !self.names.numbers(p).is_empty());
        for &n in &phrase.numbers {
            let mut found: Vec<usize> = candidates
                .iter()
                .copied()
                .filter(|&p| self.names.numbers(p).last() == Some(&n))
                .collect();
            if found.is_empty() && !numbered && n > 0 {
                found.extend(candidates.get(n as usize - 1));
            }
            match found.len() {
                0 => {
                    let names: Vec<&str> = candidates.iter().map(|&p| self.name(p)).collect();
                    let words = format!(
                        "no \"{}\" with the number {n}; there are {}",
                        phrase.text,
                        names.join(", ")
                    );
                    return Err(Trouble::Refuse(Code::NoSuchPart, words, candidates.to_vec()));
                }
                1 => out.extend(found),
                _ => return Err(self.ask(phrase, found)),
            }
        }
        Ok(out)
    }

    /// Those at a place: by their names, else by the middles of their boxes; within a hundredth of the spread they are equal.
    fn at_place(&self, candidates: Vec<usize>, place: Place) -> Vec<usize> {
        let words = lexicon::PLACES
            .iter()
            .find(|(p, _)| *p == place)
            .map_or(&[][..], |(_, words)| words);
        let by_name: Vec<usize> = candidates
            .iter()
            .copied()
            .filter(|&p| self.names.words(p).iter().any(|w| words.contains(&w.as_str())))
            .collect();
        if !by_name.is_empty() {
            return by_name;
        }
        let center = |p: usize| self.parts[p].center;
        if place == Place::Middle {
            return self.middle(candidates);
        }
        let along = direction(place);
        let heights: Vec<f64> = candidates.iter().map(|&p| center(p).dot(along)).collect();
        extreme(&candidates, &heights)
    }

    /// Median of parts in a row; both of an even number; all when they stand in no row.
    fn middle(&self, mut candidates: Vec<usize>) -> Vec<usize> {
        let centers: Vec<DVec3> = candidates.iter().map(|&p| self.parts[p].center).collect();
        let axis = longest_axis(&centers);
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &c in &centers {
            (low, high) = (low.min(c), high.max(c));
        }
        let spread = high - low;
        if spread.reject_from_normalized(axis).length() > ROW * spread.dot(axis) {
            return candidates;
        }
        candidates.sort_by(|&p, &q| {
            self.parts[p]
                .center
                .dot(axis)
                .total_cmp(&self.parts[q].center.dot(axis))
        });
        let n = candidates.len();
        match n {
            0..=2 => candidates,
            _ if n % 2 == 1 => vec![candidates[n / 2]],
            _ => vec![candidates[n / 2 - 1], candidates[n / 2]],
        }
    }

    fn of_size(&self, candidates: Vec<usize>, size: Size) -> Vec<usize> {
        let word = match size {
            Size::Large => ["large", "big"],
            Size::Small => ["small", "little"],
            Size::Long => ["long", "long"],
            Size::Short => ["short", "short"],
        };
        let by_name: Vec<usize> = candidates
            .iter()
            .copied()
            .filter(|&p| self.names.words(p).iter().any(|w| word.contains(&w.as_str())))
            .collect();
        if !by_name.is_empty() {
            return by_name;
        }
        let measure = |p: usize| {
            let part = &self.parts[p];
            match size {
                Size::Large => part.volume_mm3,
                Size::Small => -part.volume_mm3,
                Size::Long => part.size.max_element(),
                Size::Short => -part.size.max_element(),
            }
        };
        let values: Vec<f64> = candidates.iter().map(|&p| measure(p)).collect();
        extreme(&candidates, &values)
    }

    /// Applies the quantity.
    fn counted(&self, phrase: &Phrase, candidates: Vec<usize>) -> Result<Vec<usize>, Trouble> {
        let n = candidates.len();
        let few = |wanted: u32| {
            let words = format!("\"{}\": there are only {n}, not {wanted}", phrase.text);
            Err(Trouble::Refuse(Code::NotEnough, words, candidates.clone()))
        };
        let listed = !phrase.numbers.is_empty() || !phrase.ordinals.is_empty();
        match phrase.quantity {
            Quantity::All => Ok(candidates),
            Quantity::Any => Ok(candidates.into_iter().take(1).collect()),
            Quantity::One if n == 1 => Ok(candidates),
            Quantity::One => Err(self.ask(phrase, candidates)),
            Quantity::Both if n < 2 => few(2),
            Quantity::Both if n == 2 => Ok(candidates),
            Quantity::Count(m) | Quantity::AllOf(m) if n < m as usize => {
                // "the two-pin link": the number belongs to the name.
                let word = lexicon::NUMBERS
                    .iter()
                    .find(|(v, _)| *v == f64::from(m))
                    .map_or("", |(_, w)| w);
                let named = n == 1 && self.names.words(candidates[0]).iter().any(|w| w == word);
                if named { Ok(candidates) } else { few(m) }
            }
            Quantity::Count(m) | Quantity::AllOf(m) if n == m as usize || listed => Ok(candidates),
            _ => Err(self.ask(phrase, candidates)),
        }
    }
}

/// Unit vector of a place, assembly frame.
pub fn direction(place: Place) -> DVec3 {
    match place {
        Place::Left => DVec3::NEG_X,
        Place::Right => DVec3::X,
        Place::Front => DVec3::NEG_Y,
        Place::Rear => DVec3::Y,
        Place::Upper => DVec3::Z,
        Place::Lower => DVec3::NEG_Z,
        Place::Middle => DVec3::ZERO,
    }
}

/// Axis of the file along which points spread most.
pub fn longest_axis(points: &[DVec3]) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &p in points {
        low = low.min(p);
        high = high.max(p);
    }
    let spread = high - low;
    if spread.x >= spread.y && spread.x >= spread.z {
        DVec3::X
    } else if spread.y >= spread.z {
        DVec3::Y
    } else {
        DVec3::Z
    }
}

/// Items with the largest value, within a hundredth of the spread.
fn extreme(items: &[usize], values: &[f64]) -> Vec<usize> {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let slack = 1e-2 * (high - low) + 1e-6;
    items
        .iter()
        .zip(values)
        .filter(|&(_, &v)| v >= high - slack)
        .map(|(&item, _)| item)
        .collect()
}
