//! Ways in that guidance follows: those of the assembly itself, and that of the fit which the operator chose. Pure.

use std::collections::BTreeMap;
use std::sync::Arc;

use mortise_brep::CadModel;
use mortise_mating::recognise::Target;

use super::threads::Cancel;

/// The ways that are followed.
#[derive(Debug, Default)]
pub struct Ways {
    /// Those of the assembly, by moving part; there while they are searched, too.
    pub(super) of_assembly: BTreeMap<usize, Vec<Target>>,
    /// That of the fit which the operator chose.
    pub(super) chosen: Option<Target>,
    pub(super) cancel: Cancel,
}

/// The ways of a part in the assembly.
pub struct WaysFound {
    /// The model in which they were searched.
    pub model: Arc<CadModel>,
    /// The part.
    pub moving: usize,
    /// Its ways, with the parts in which it sits.
    pub targets: Vec<Target>,
}

impl Ways {
    /// What guidance follows: between two parts that the operator chose a fit for, that fit alone.
    pub(super) fn followed(&self) -> Vec<Target> {
        let chosen = |target: &&Target| self.chosen.as_ref().is_none_or(|chosen| chosen.id != target.id);
        let of_assembly = self.of_assembly.values().flatten().filter(chosen);
        self.chosen.iter().chain(of_assembly).cloned().collect()
    }

    /// Forgets all of them, as for another file.
    pub(super) fn clear(&mut self) {
        self.cancel.set();
        *self = Self::default();
    }
}
