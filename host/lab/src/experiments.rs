//! The table of experiments.

use crate::blend::Blend;
use crate::clearance::Clearance;
use crate::energy::Energy;
use crate::experiment::Experiment;
use crate::helps::Helps;
use crate::hybrid::Hybrid;
use crate::pareto::Pareto;
use crate::peers::Peers;
use crate::rate::Rate;
use crate::stability::Stability;
use crate::study::feature_size::FeatureSize;
use crate::study::shrink::Shrink;

/// Every experiment, in the order in which help lists them.
pub const ALL: &[&dyn Experiment] = &[
    &Clearance,
    &Pareto,
    &Peers,
    &Blend,
    &Energy,
    &Helps,
    &Stability,
    &Rate,
    &Shrink,
    &FeatureSize,
    &Hybrid,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// A file's name begins with that of its experiment.
    #[test]
    fn names_differ_and_files_are_named_after_their_experiment() {
        for (index, experiment) in ALL.iter().enumerate() {
            let name = experiment.name();
            assert!(ALL[..index].iter().all(|other| other.name() != name), "{name}");
            for file in experiment.rows().iter().chain(&experiment.charts()) {
                assert!(file == name || file.starts_with(&format!("{name}-")), "{file}");
            }
            for part in experiment.parts() {
                assert!(experiment.rows().iter().any(|file| file == part), "{part}");
            }
        }
    }
}
