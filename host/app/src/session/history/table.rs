//! Samples as a table of comma-separated values, for other programs.

use super::signal::Signal;
use super::store::History;

/// A table of these signals from one time to another: a row for each sample, an empty field where it has no value, a row of empty fields at a gap. Times
/// are the history's, s.
pub fn csv(history: &History, signals: &[&Signal], from_s: f64, to_s: f64) -> String {
    let mut table = ::csv::Writer::from_writer(Vec::new());
    let names = signals.iter().map(|signal| signal.key.to_owned());
    let rows = (history.between(from_s, to_s).enumerate()).flat_map(|(index, (breaks, sample))| {
        let values = signals
            .iter()
            .map(|signal| signal.of(sample).map_or(String::new(), |v| v.to_string()));
        let row: Vec<String> = std::iter::once(format!("{:.4}", sample.time_s))
            .chain(values)
            .collect();
        let gap = (breaks && index > 0).then(|| vec![String::new(); row.len()]);
        gap.into_iter().chain(Some(row))
    });
    let head: Vec<String> = std::iter::once("time_s".to_owned()).chain(names).collect();
    for row in std::iter::once(head).chain(rows) {
        // Writing to memory cannot fail, and every row is as long as the head.
        let _ = table.write_record(row);
    }
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::super::sample::Sample;
    use super::*;

    #[test]
    fn a_table_has_a_row_for_each_sample_and_an_empty_one_at_a_gap() {
        let mut history = History::default();
        for (time_s, cost) in [(1.0, 5.0), (1.25, f32::NAN), (1.5, 7.5), (3.0, 8.0), (4.0, 9.0)] {
            history.add(Sample {
                time_s,
                cost,
                points: 3,
                ..Sample::default()
            });
        }
        let signals = ["loop_cost", "points"].map(|key| Signal::named(key).unwrap());
        assert_eq!(
            csv(&history, &signals, 1.1, 3.0),
            "time_s,loop_cost,points\n1.2500,,3\n1.5000,7.5,3\n,,\n3.0000,8,3\n"
        );
        assert_eq!(csv(&history, &[], 9.0, 9.5), "time_s\n");
    }
}
