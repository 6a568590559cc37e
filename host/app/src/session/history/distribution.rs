//! How often a signal has which values.

use super::signal::Signal;
use super::store::History;

/// Values of a signal, counted.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// Lower end of the first bin, and width of a bin.
    pub bins: [f64; 2],
    /// Samples in each bin.
    pub counts: Vec<u32>,
    /// Values that half and 99 % of the samples do not exceed, and the largest.
    pub quantiles: [f64; 3],
}

/// The distribution of a signal over the whole history, in this number of bins; `None` without samples. Cost: a sort, 2 ms for ten minutes.
pub fn distribution(history: &History, signal: &Signal, bins: usize) -> Option<Distribution> {
    let mut values: Vec<f64> = history
        .iter()
        .filter_map(|s| signal.of(s))
        .map(f64::from)
        .collect();
    values.sort_unstable_by(f64::total_cmp);
    let (low, high) = (*values.first()?, *values.last()?);
    let bins = bins.max(1);
    // Values that are all the same have a bin as well.
    let width = ((high - low) / bins as f64).max(f64::from(f32::EPSILON) * (1.0 + high.abs()));
    let mut counts = vec![0; bins];
    for value in &values {
        counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
    }
    let at = |share: f64| values[((share * values.len() as f64).ceil() as usize).clamp(1, values.len()) - 1];
    Some(Distribution {
        bins: [low, width],
        counts,
        quantiles: [at(0.5), at(0.99), high],
    })
}

#[cfg(test)]
mod tests {
    use super::super::sample::Sample;
    use super::*;

    fn of(costs: &[f32]) -> Option<Distribution> {
        let mut history = History::default();
        for (i, &cost) in costs.iter().enumerate() {
            history.add(Sample {
                time_s: i as f64,
                cost,
                ..Sample::default()
            });
        }
        distribution(&history, Signal::named("loop_cost").expect("a signal"), 10)
    }

    #[test]
    fn every_sample_is_counted_once_and_quantiles_are_those_of_the_sorted_values() {
        assert_eq!(of(&[]), None);
        let costs: Vec<f32> = (0..1000).map(|i| ((i * 617) % 1000) as f32).collect();
        let found = of(&costs).expect("samples");
        assert_eq!(found.counts, [100; 10]);
        assert_eq!(found.quantiles, [499.0, 989.0, 999.0]);
        let same = of(&[7.0; 5]).expect("samples");
        assert_eq!(same.counts.iter().sum::<u32>(), 5);
        assert_eq!(same.quantiles, [7.0; 3]);
        assert!(same.bins[1] > 0.0);
    }
}
