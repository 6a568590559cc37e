//! How lines of recorded runs look: those of the chosen one are full, those of the others dashed or dotted, each in its own way.

use egui::{Sense, Shape, Stroke, Ui, Vec2};
use egui_plot::LineStyle;

use crate::session::runs::MOST_RUNS;
use crate::ui::theme;

/// Styles of the other runs by their place among all.
const STYLES: [LineStyle; MOST_RUNS] = [
    LineStyle::Dashed { length: 4.0 },
    LineStyle::Dotted { spacing: 4.0 },
    LineStyle::Dashed { length: 10.0 },
    LineStyle::Dotted { spacing: 8.0 },
    LineStyle::Dashed { length: 18.0 },
    LineStyle::Dashed { length: 2.0 },
];
/// Gap after a dash of the plots, in times of its length.
const GAP: f32 = std::f32::consts::GOLDEN_RATIO;
/// Size of a sample, points.
const SAMPLE: Vec2 = Vec2::new(34.0, 12.0);

/// Style of the lines of a run by its place among all; `None`: the chosen one.
pub fn style(run: Option<usize>) -> LineStyle {
    run.map_or(LineStyle::Solid, |run| STYLES[run % STYLES.len()])
}

/// A short line that looks like those of the run.
pub fn sample(ui: &mut Ui, run: Option<usize>) {
    let (rect, _) = ui.allocate_exact_size(SAMPLE, Sense::hover());
    let stroke = Stroke::new(1.6, theme::of(ui).text_strong);
    let ends = [rect.left_center(), rect.right_center()];
    let shapes = match style(run) {
        LineStyle::Solid => vec![Shape::line_segment(ends, stroke)],
        LineStyle::Dashed { length } => Shape::dashed_line(&ends, stroke, length, GAP * length),
        LineStyle::Dotted { spacing } => Shape::dotted_line(&ends, stroke.color, spacing, 0.8),
    };
    ui.painter().extend(shapes);
}
