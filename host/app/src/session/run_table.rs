//! Figures of recorded runs, one list for the window, the report and the table of comma-separated values.

use super::run::Run;

/// A figure of a run.
pub struct RunFigure {
    /// Name in the table of comma-separated values, with its unit.
    pub key: &'static str,
    /// Name, with its unit.
    pub name: &'static str,
    /// Digits after the point.
    digits: usize,
    of: fn(&Run) -> Option<f64>,
}

impl RunFigure {
    /// The value of a run as text; `None` where it has none.
    pub fn text(&self, run: &Run) -> Option<String> {
        let value = (self.of)(run)?;
        Some(format!("{value:.*}", self.digits))
    }
}

/// Time in which a part went in is that from the first touch to the deepest insertion.
#[rustfmt::skip]
pub const RUN_FIGURES: [RunFigure; 7] = [
    RunFigure { key: "length_s", name: "Length, s", digits: 1, of: |run| Some(run.duration_s()) },
    RunFigure { key: "first_touch_s", name: "First touch, s", digits: 2, of: |run| run.touch_s },
    RunFigure { key: "insertion_s", name: "From the touch to the deepest insertion, s", digits: 2, of: |run| run.touch_s.map(|_| run.figures.insertion_s) },
    RunFigure { key: "insertion_mm", name: "Deepest insertion, mm", digits: 2, of: |run| Some(run.figures.insertion_mm.into()) },
    RunFigure { key: "contact_n", name: "Largest contact force, N", digits: 2, of: |run| Some(run.figures.contact_n.into()) },
    RunFigure { key: "handle_n", name: "Largest force on the handle, N", digits: 2, of: |run| Some(run.figures.handle_n.into()) },
    RunFigure { key: "depth_um", name: "Deepest penetration, µm", digits: 0, of: |run| Some(run.figures.depth_um.into()) },
];

/// Figures of runs as comma-separated values: a row for each, an empty field where it has no value, the collision models by their checksums.
pub fn csv<'r>(runs: impl Iterator<Item = &'r Run>) -> String {
    let mut table = ::csv::Writer::from_writer(Vec::new());
    let keys = RUN_FIGURES.iter().map(|figure| figure.key.to_owned());
    let head: Vec<String> = ["run".to_owned()]
        .into_iter()
        .chain(keys)
        .chain(["models".to_owned()])
        .collect();
    let rows = runs.map(|run| {
        let values = (RUN_FIGURES.iter()).map(|figure| figure.text(run).unwrap_or_default());
        [run.path.display().to_string()]
            .into_iter()
            .chain(values)
            .chain([models(run)])
            .collect()
    });
    for row in std::iter::once(head).chain(rows) {
        // Writing to memory cannot fail, and every row is as long as the head.
        let _ = table.write_record(row);
    }
    let bytes = table.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Checksums of the collision models that were on the board.
pub fn models(run: &Run) -> String {
    let scenes: Vec<String> = run.scenes.iter().map(|crc| format!("{crc:08x}")).collect();
    scenes.join(" ")
}

#[cfg(test)]
mod tests {
    use super::super::history::Sample;
    use super::*;

    #[test]
    fn a_table_has_a_row_for_each_run_and_no_figure_that_a_run_has_not() {
        let sample = |i: usize| Sample {
            time_s: 0.5 * i as f64,
            ..Sample::default()
        };
        let mut touches = Run::of("a, b.mcap", (0..5).map(sample));
        touches.touch_s = Some(0.5);
        touches.figures.insertion_s = 1.25;
        touches.scenes = vec![0xab, 0x1234_5678];
        let free = Run::of("c.mcap", (0..3).map(sample));
        assert_eq!(
            csv([&touches, &free].into_iter()),
            "run,length_s,first_touch_s,insertion_s,insertion_mm,contact_n,handle_n,depth_um,models\n\
             \"a, b.mcap\",2.0,0.50,1.25,0.00,0.00,0.00,0,000000ab 12345678\n\
             c.mcap,1.0,,,0.00,0.00,0.00,0,\n"
        );
    }
}
