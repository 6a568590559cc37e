//! Drawing a chart on any of plotters' backends.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::{
    Cartesian2d, Circle, DrawingArea, DrawingBackend, IntoFont as _, PathElement, Polygon, RGBColor,
    Rectangle, Text, WHITE,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, ShapeStyle, TextStyle};

use super::axis::{Coordinate, number};
use super::labels::{Box4, place};
use super::{Chart, Line, Look, Point, Series};

const INK: RGBColor = RGBColor(36, 41, 47);
const GREY: RGBColor = RGBColor(101, 109, 118);
const GRID: RGBColor = RGBColor(225, 228, 232);

/// Space above the plot for title and legend, and below it for each line of the note, pixels.
const HEAD: u32 = 34;
const LEGEND_ROW: u32 = 24;
const NOTE: u32 = 22;
/// Margin on either side of the note, pixels.
const NOTE_SIDE: u32 = 16;

type Area<DB> = DrawingArea<DB, Shift>;
type Context<'a, DB> = ChartContext<'a, DB, Cartesian2d<Coordinate, Coordinate>>;

/// Factor from the chart's pixels to those of the drawing area.
#[derive(Clone, Copy)]
struct Scale(u32);

impl Scale {
    fn of(self, pixels: u32) -> i32 {
        (pixels * self.0).cast_signed()
    }

    fn text(self, size: u32, colour: &RGBColor) -> TextStyle<'_> {
        TextStyle::from(("sans-serif", f64::from(size * self.0)).into_font()).color(colour)
    }

    fn stroke(self, colour: RGBColor, width: u32) -> ShapeStyle {
        colour.stroke_width(width * self.0)
    }
}

/// An error as text.
fn reported(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// `text` broken into lines that fit the area with a margin of `side` on either side; no line for empty text.
fn wrapped<DB: DrawingBackend>(
    area: &Area<DB>,
    text: &str,
    style: &TextStyle<'_>,
    side: i32,
) -> Result<Vec<String>, String> {
    let most = area.dim_in_pixel().0.cast_signed() - 2 * side;
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let longer = lines.last().map(|line| format!("{line} {word}"));
        let fits = match &longer {
            Some(line) => {
                area.estimate_text_size(line, style)
                    .map_err(reported)?
                    .0
                    .cast_signed()
                    <= most
            }
            None => false,
        };
        match (longer, lines.last_mut()) {
            (Some(longer), Some(line)) if fits => *line = longer,
            _ => lines.push(word.to_owned()),
        }
    }
    Ok(lines)
}

impl Chart {
    /// Draws the chart with every length multiplied by `scale`. Errors are text.
    pub(super) fn draw<DB: DrawingBackend>(&self, area: &Area<DB>, scale: u32) -> Result<(), String> {
        let scale = Scale(scale);
        let drawn = || self.series.iter().flat_map(|series| self.drawn(series));
        let x = self
            .x
            .range(drawn().map(|point| point.x))
            .ok_or("it has no point")?;
        let y = self
            .y
            .range(drawn().map(|point| point.y))
            .ok_or("it has no point")?;
        area.fill(&WHITE).map_err(reported)?;
        let (head, rest) = area.split_vertically(if self.title.is_empty() { 0 } else { scale.of(HEAD) });
        head.draw(&Text::new(
            self.title.as_str(),
            (scale.of(16), scale.of(14)),
            scale.text(21, &INK),
        ))
        .map_err(reported)?;
        let rows = self.legend(&rest, scale)?;
        let (_, rest) = rest.split_vertically(scale.of(LEGEND_ROW * rows + 6));
        let height = rest.dim_in_pixel().1.cast_signed();
        let note = wrapped(&rest, &self.note, &scale.text(14, &GREY), scale.of(NOTE_SIDE))?;
        let (plot, foot) = rest.split_vertically(height - scale.of(NOTE) * note.len() as i32);
        for (row, line) in note.into_iter().enumerate() {
            let at = (scale.of(NOTE_SIDE), scale.of(4) + scale.of(NOTE) * row as i32);
            foot.draw(&Text::new(line, at, scale.text(14, &GREY)))
                .map_err(reported)?;
        }

        let mut context: Context<'_, DB> = ChartBuilder::on(&plot)
            .margin_left(scale.of(14))
            .margin_right(scale.of(24))
            .margin_top(scale.of(4))
            .x_label_area_size(scale.of(52))
            .y_label_area_size(scale.of(78))
            .build_cartesian_2d(self.x.coordinate(x), self.y.coordinate(y))
            .map_err(reported)?;
        context
            .configure_mesh()
            .bold_line_style(scale.stroke(GRID, 1))
            .light_line_style(WHITE.stroke_width(0))
            .axis_style(scale.stroke(GREY, 1))
            .x_desc(self.x.title.as_str())
            .y_desc(self.y.title.as_str())
            .axis_desc_style(scale.text(16, &INK))
            .label_style(scale.text(15, &INK))
            .set_all_tick_mark_size(scale.of(4))
            .x_label_formatter(&|value| number(*value))
            .y_label_formatter(&|value| number(*value))
            .draw()
            .map_err(reported)?;
        self.plot(&context, &plot, scale)
    }

    /// Draws names and marks in rows above the plot; returns the number of rows.
    fn legend<DB: DrawingBackend>(&self, area: &Area<DB>, scale: Scale) -> Result<u32, String> {
        let style = scale.text(16, &INK);
        let width = area.dim_in_pixel().0.cast_signed();
        let start = scale.of(24);
        let (mut x, mut row) = (start, 0);
        let mut named = self
            .series
            .iter()
            .filter(|series| !series.name.is_empty())
            .peekable();
        if named.peek().is_none() {
            return Ok(0);
        }
        for series in named {
            let (words, _) = area.estimate_text_size(&series.name, &style).map_err(reported)?;
            let taken = scale.of(26) + words.cast_signed() + scale.of(26);
            if x + taken > width && x > start {
                (x, row) = (start, row + 1);
            }
            let y = scale.of(LEGEND_ROW * row + LEGEND_ROW / 2);
            if series.line != Line::None {
                let ends = [(x - scale.of(11), y), (x + scale.of(11), y)];
                stroke(area, &ends, series, scale)?;
            }
            if series.line.has_marks() {
                mark(area, (x, y), series.look, false, scale)?;
            }
            let level = style.pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(
                series.name.as_str(),
                (x + scale.of(18), y + scale.of(2)),
                level,
            ))
            .map_err(reported)?;
            x += taken;
        }
        Ok(row + 1)
    }

    /// Draws lines first, then marks, then labels.
    fn plot<DB: DrawingBackend>(
        &self,
        context: &Context<'_, DB>,
        area: &Area<DB>,
        scale: Scale,
    ) -> Result<(), String> {
        // Everything is drawn in pixel coordinates of `area`, because labels are placed in them.
        let (left, top) = area.get_base_pixel();
        let pixel = |x: f64, y: f64| {
            let (px, py) = context.backend_coord(&(x, y));
            (px - left, py - top)
        };
        let (across, up) = context.plotting_area().get_pixel_range();
        let frame = Box4 {
            left: across.start - left,
            top: up.start - top,
            right: across.end - left,
            bottom: up.end - top,
        };
        let mut taken = Vec::new();
        for series in self.series.iter().filter(|series| series.line != Line::None) {
            let corners: Vec<(i32, i32)> = self.corners(series).iter().map(|&(x, y)| pixel(x, y)).collect();
            stroke(area, &corners, series, scale)?;
            taken.extend(along(&corners, scale));
        }
        for series in &self.series {
            for point in self.drawn(series).filter(|_| series.line.has_marks()) {
                let at = pixel(point.x, point.y);
                mark(area, at, series.look, point.at_least, scale)?;
                let (x, y) = at;
                let above = if point.at_least { 20 } else { 6 };
                taken.push(Box4 {
                    top: y - scale.of(above),
                    ..Box4::about((x, y), scale.of(6))
                });
            }
        }
        let mut written: Vec<(&str, (i32, i32))> = Vec::new();
        for series in &self.series {
            let colour = series.look.colour();
            let style = scale.text(15, &colour);
            for point in self.drawn(series).filter(|point| !point.label.is_empty()) {
                let at = pixel(point.x, point.y);
                // Two series with the same label at the same point write it once.
                if written.contains(&(point.label.as_str(), at)) {
                    continue;
                }
                let (width, height) = area.estimate_text_size(&point.label, &style).map_err(reported)?;
                let size = (width.cast_signed(), height.cast_signed() + scale.of(3));
                if let Some(corner) = place(at, size, scale.of(9), &frame, &mut taken) {
                    written.push((point.label.as_str(), at));
                    area.draw(&Text::new(point.label.as_str(), corner, style.clone()))
                        .map_err(reported)?;
                }
            }
        }
        Ok(())
    }
}

impl Chart {
    /// The points of a series that both axes can show.
    fn drawn<'s>(&'s self, series: &'s Series) -> impl Iterator<Item = &'s Point> {
        series
            .points
            .iter()
            .filter(|point| self.x.shows(point.x) && self.y.shows(point.y))
    }

    /// Corners of the series' line.
    fn corners(&self, series: &Series) -> Vec<(f64, f64)> {
        let mut corners: Vec<(f64, f64)> = Vec::new();
        for point in self.drawn(series) {
            if series.line == Line::Stair
                && let Some(&(_, y)) = corners.last()
            {
                corners.push((point.x, y));
            }
            corners.push((point.x, point.y));
        }
        corners
    }
}

impl Line {
    fn is_broken(self) -> bool {
        matches!(self, Self::Dashed | Self::DashedTrace)
    }

    fn has_marks(self) -> bool {
        !matches!(self, Self::Trace | Self::DashedTrace)
    }
}

impl Look {
    fn colour(self) -> RGBColor {
        match self {
            Self::BlueDisc => RGBColor(0, 114, 178),
            Self::VermilionSquare => RGBColor(213, 94, 0),
            Self::GreenTriangle => RGBColor(0, 158, 115),
            Self::PurpleDiamond => RGBColor(204, 121, 167),
            Self::OrangeCross => RGBColor(230, 159, 0),
            Self::SkyRing => RGBColor(86, 180, 233),
            Self::Black => INK,
        }
    }
}

/// Small boxes along a line that labels must not cover.
fn along(corners: &[(i32, i32)], scale: Scale) -> Vec<Box4> {
    let step = scale.of(5);
    let mut boxes = Vec::new();
    for ends in corners.windows(2) {
        let [(x0, y0), (x1, y1)] = [ends[0], ends[1]];
        let count = ((x1 - x0).abs().max((y1 - y0).abs()) / step).max(1);
        boxes.extend((0..=count).map(|i| {
            let at = (x0 + (x1 - x0) * i / count, y0 + (y1 - y0) * i / count);
            Box4::about(at, scale.of(3))
        }));
    }
    boxes
}

fn stroke<DB: DrawingBackend>(
    area: &Area<DB>,
    corners: &[(i32, i32)],
    series: &Series,
    scale: Scale,
) -> Result<(), String> {
    let style = scale.stroke(series.look.colour(), 2);
    if series.line.is_broken() {
        let dashed = DashedPathElement::new(corners.iter().copied(), scale.of(7), scale.of(5), style);
        area.draw(&dashed).map_err(reported)
    } else {
        area.draw(&PathElement::new(corners.to_vec(), style))
            .map_err(reported)
    }
}

/// Draws the mark of `look`; a lower bound ("at least") has an arrow upwards.
fn mark<DB: DrawingBackend>(
    area: &Area<DB>,
    at: (i32, i32),
    look: Look,
    at_least: bool,
    scale: Scale,
) -> Result<(), String> {
    let colour = look.colour();
    let filled = colour.filled();
    let (x, y) = at;
    let corner = |dx: i32, dy: i32| (x + dx * scale.of(1), y + dy * scale.of(1));
    let line = |from: (i32, i32), to: (i32, i32)| {
        let element = PathElement::new(vec![from, to], scale.stroke(colour, 2));
        area.draw(&element).map_err(reported)
    };
    if at_least {
        line(corner(0, -5), corner(0, -18))?;
        line(corner(-4, -13), corner(0, -18))?;
        line(corner(4, -13), corner(0, -18))?;
    }
    match look {
        Look::BlueDisc => area.draw(&Circle::new(at, scale.of(5), filled)),
        Look::SkyRing => {
            area.draw(&Circle::new(at, scale.of(5), WHITE.filled()))
                .map_err(reported)?;
            area.draw(&Circle::new(at, scale.of(5), scale.stroke(colour, 2)))
        }
        Look::VermilionSquare => area.draw(&Rectangle::new([corner(-5, -5), corner(5, 5)], filled)),
        Look::GreenTriangle => {
            let corners = vec![corner(0, -6), corner(6, 5), corner(-6, 5)];
            area.draw(&Polygon::new(corners, filled))
        }
        Look::PurpleDiamond => {
            let corners = vec![corner(0, -7), corner(7, 0), corner(0, 7), corner(-7, 0)];
            area.draw(&Polygon::new(corners, filled))
        }
        Look::OrangeCross => {
            line(corner(-5, -5), corner(5, 5))?;
            return line(corner(-5, 5), corner(5, -5));
        }
        Look::Black => return Ok(()),
    }
    .map_err(reported)
}

#[cfg(test)]
mod tests {
    use super::super::Axis;
    use super::*;

    #[test]
    fn a_stair_goes_level_first() {
        let point = |x, y| Point {
            x,
            y,
            ..Point::default()
        };
        let series = Series {
            name: String::new(),
            look: Look::Black,
            line: Line::Stair,
            points: vec![point(1.0, 9.0), point(3.0, 4.0)],
        };
        let chart = Chart {
            title: String::new(),
            note: String::new(),
            x: Axis::new(""),
            y: Axis::new(""),
            series: Vec::new(),
        };
        assert_eq!(chart.corners(&series), [(1.0, 9.0), (3.0, 9.0), (3.0, 4.0)]);
    }
}
