//! What a catalogue states of an assembly, by the indices of its parts.

use crate::taxonomy::Connection;

/// What is stated of an assembly's parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stated {
    /// Of each part whether it has a thread; the last statement counts.
    pub(crate) threads: Vec<(usize, bool)>,
    /// Parts, ascending, and what connects them.
    pub(crate) connections: Vec<([usize; 2], Connection)>,
}

impl Stated {
    /// Whether a part is stated to have a thread, or to have none.
    pub fn thread(&self, part: usize) -> Option<bool> {
        let stated = self.threads.iter().rev().find(|(stated, _)| *stated == part);
        stated.map(|(_, thread)| *thread)
    }

    /// What connects two parts, ascending.
    pub fn connections(&self, parts: [usize; 2]) -> impl Iterator<Item = Connection> + '_ {
        (self.connections.iter())
            .filter(move |(pair, _)| *pair == parts)
            .map(|(_, kind)| *kind)
    }

    /// Parts of `set` by what does not come apart: each set of parts that permanent connections join is one.
    pub fn units(&self, set: &[usize]) -> Vec<Vec<usize>> {
        let mut units: Vec<Vec<usize>> = set.iter().map(|&part| vec![part]).collect();
        for pair in self.permanent() {
            let place = |part: usize| units.iter().position(|unit| unit.contains(&part));
            if let [Some(a), Some(b)] = pair.map(place)
                && a != b
            {
                let (kept, gone) = (a.min(b), a.max(b));
                let more = units.remove(gone);
                units[kept].extend(more);
                units[kept].sort_unstable();
            }
        }
        units
    }

    /// Pairs that do not come apart.
    pub fn permanent(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        (self.connections.iter())
            .filter(|(_, kind)| kind.is_permanent())
            .map(|(pair, _)| *pair)
    }
}
