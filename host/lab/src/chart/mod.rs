//! Charts as SVG and PNG: points and lines over two axes, logarithmic or linear, each series distinguished by colour, mark and a label of its own.
//!
//! Colours are Okabe and Ito's (2008), distinguishable with any kind of colour blindness. The font is part of the program, so a machine needs none.

mod axis;
mod draw;
mod labels;

use std::sync::Once;

use mortise_output::Folder;
use plotters::backend::{BitMapBackend, DrawingBackend, SVGBackend};
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea as _};
use plotters::style::{FontStyle, register_font};

use crate::error::LabError;

/// Size as shown on a page, pixels.
const SIZE: (u32, u32) = (960, 600);
/// Height of each chart of a stack, pixels.
const STACKED: u32 = 260;
/// Pixels of the PNG for each pixel of the page, for high-density screens.
const SHARPNESS: u32 = 2;
/// Supersampling factor: the PNG is drawn this much finer and then averaged, which smooths every edge.
const SMOOTHING: u32 = 2;

/// A chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Title: what the chart shows, one line.
    pub title: String,
    /// How the data was measured, in small letters below the plot; may be empty.
    pub note: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub title: String,
    /// Values of the ticks; `None` on a logarithmic axis: 1, 2 and 5 times the powers of ten, the powers alone where there are many, every digit
    /// where there are few; `None` on a linear axis: equal steps.
    pub ticks: Option<Vec<f64>>,
    /// Scale of the axis.
    pub scale: AxisScale,
}

/// Scale of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AxisScale {
    /// Equal lengths are equal ratios.
    #[default]
    Logarithmic,
    /// Equal lengths are equal differences.
    Linear,
}

/// A series of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Colour and mark.
    pub look: Look,
    /// How lines join the points.
    pub line: Line,
    /// Its points; those that are not finite, or not positive on a logarithmic axis, are omitted.
    pub points: Vec<Point>,
}

/// Distinguishable pairs of colour and mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Blue disc.
    BlueDisc,
    /// Vermilion square.
    VermilionSquare,
    /// Green triangle.
    GreenTriangle,
    /// Purple diamond.
    PurpleDiamond,
    /// Orange cross.
    OrangeCross,
    /// Sky-blue ring.
    SkyRing,
    /// No marks, black.
    Black,
}

impl Look {
    /// The look of the series with this index.
    pub fn nth(index: usize) -> Self {
        const ALL: [Look; 6] = [
            Look::VermilionSquare,
            Look::BlueDisc,
            Look::GreenTriangle,
            Look::PurpleDiamond,
            Look::OrangeCross,
            Look::SkyRing,
        ];
        ALL[index % ALL.len()]
    }
}

/// How lines join the points of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// No line.
    None,
    /// Solid line from each point to the next.
    Solid,
    /// Dashed line from each point to the next.
    Dashed,
    /// Staircase of a Pareto frontier: level until the next point, then down.
    Stair,
    /// Solid line without marks: a course with more points than can be distinguished.
    Trace,
    /// Dashed line without marks.
    DashedTrace,
}

/// A point with an optional label.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// Horizontal value.
    pub x: f64,
    /// Vertical value.
    pub y: f64,
    /// Label beside it; may be empty.
    pub label: String,
    /// Drawn open, with an arrow upwards: the value is a lower bound.
    pub at_least: bool,
}

impl Axis {
    /// A logarithmic axis with ticks chosen from the values.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ticks: None,
            scale: AxisScale::Logarithmic,
        }
    }

    /// The same axis, linear.
    pub fn linear(self) -> Self {
        let scale = AxisScale::Linear;
        Self { scale, ..self }
    }

    /// The same axis with these ticks.
    pub fn with_ticks(self, ticks: &[f64]) -> Self {
        let ticks = Some(ticks.to_vec());
        Self { ticks, ..self }
    }
}

impl Chart {
    fn cannot(&self, what: String) -> LabError {
        LabError::Input {
            name: format!("chart `{}`", self.title),
            what,
        }
    }
}

/// Writes stacked charts, the first on top, to `NAME.svg` and `NAME.png` in `folder`. Empty titles and notes take no space, nor does a legend without
/// names.
///
/// # Errors
/// `Unwritable`; `Input` for a chart without a point.
pub fn write_stack(charts: &[Chart], folder: &Folder, name: &str) -> Result<(), LabError> {
    static FONT: Once = Once::new();
    FONT.call_once(|| {
        for style in [FontStyle::Normal, FontStyle::Bold] {
            // Registering fails only for an unreadable font; this one is part of the program and covered by the test below.
            let _ = register_font("sans-serif", style, epaint_default_fonts::UBUNTU_LIGHT);
        }
    });
    let size = size(charts.len());
    let mut text = String::new();
    draw_stack(
        charts,
        &SVGBackend::with_string(&mut text, size).into_drawing_area(),
        1,
    )?;
    folder.write(format!("{name}.svg"), text.as_bytes())?;

    let name = format!("{name}.png");
    let pixels = pixels(charts)?;
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, size.0 * SHARPNESS, size.1 * SHARPNESS);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::High);
    (encoder.write_header())
        .and_then(|mut writer| writer.write_image_data(&pixels))
        .map_err(|error| LabError::Unwritable {
            path: folder.path().join(&name),
            source: error.into(),
        })?;
    Ok(folder.write(name, &png)?)
}

fn size(charts: usize) -> (u32, u32) {
    let (width, height) = SIZE;
    let stacked = STACKED * u32::try_from(charts).unwrap_or(1);
    (width, if charts > 1 { stacked } else { height })
}

fn draw_stack<DB: DrawingBackend>(
    charts: &[Chart],
    area: &DrawingArea<DB, Shift>,
    scale: u32,
) -> Result<(), LabError> {
    for (chart, area) in charts.iter().zip(area.split_evenly((charts.len(), 1))) {
        chart.draw(&area, scale).map_err(|what| chart.cannot(what))?;
    }
    Ok(())
}

/// Red, green and blue of each pixel of the PNG, row by row.
fn pixels(charts: &[Chart]) -> Result<Vec<u8>, LabError> {
    let fine = SHARPNESS * SMOOTHING;
    let (width, height) = size(charts.len());
    let (width, height) = (width * fine, height * fine);
    let mut drawn = vec![255u8; 3 * (width * height) as usize];
    draw_stack(
        charts,
        &BitMapBackend::with_buffer(&mut drawn, (width, height)).into_drawing_area(),
        fine,
    )?;
    let (step, row) = (SMOOTHING as usize, 3 * width as usize);
    let mut pixels = Vec::with_capacity(drawn.len() / (step * step));
    for y in (0..height as usize).step_by(step) {
        for x in (0..width as usize).step_by(step) {
            for channel in 0..3 {
                let block = (0..step * step)
                    .map(|i| u32::from(drawn[(y + i / step) * row + 3 * (x + i % step) + channel]));
                pixels.push((block.sum::<u32>() / (SMOOTHING * SMOOTHING)) as u8);
            }
        }
    }
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Chart {
        let point = |&(x, y): &(f64, f64)| Point {
            x,
            y,
            label: format!("{x} here"),
            ..Point::default()
        };
        Chart {
            title: "Test".into(),
            note: String::new(),
            x: Axis::new("x, mm"),
            y: Axis::new("y, µm"),
            series: vec![Series {
                name: "one".into(),
                look: Look::BlueDisc,
                line: Line::Stair,
                points: points.iter().map(point).collect(),
            }],
        }
    }

    fn out(path: &std::path::Path) -> Folder {
        Folder::new(path, mortise_output::Existing::Keep, &[""; 0]).expect("a folder")
    }

    #[test]
    fn both_files_are_written_and_read_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_stack(&[chart(&[(1.0, 20.0), (10.0, 2.0)])], &out(folder.path()), "test").expect("two points");
        let svg = std::fs::read_to_string(folder.path().join("test.svg")).expect("written");
        for words in ["<svg", "x, mm", "y, µm", "10 here", "one"] {
            assert!(svg.contains(words), "{words}");
        }
        let png = std::fs::File::open(folder.path().join("test.png")).expect("written");
        let mut reader = (png::Decoder::new(std::io::BufReader::new(png)).read_info()).expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("fits")];
        let info = reader.next_frame(&mut pixels).expect("whole");
        assert_eq!(
            (info.width, info.height),
            (SIZE.0 * SHARPNESS, SIZE.1 * SHARPNESS)
        );
        // White paper, the first series' blue somewhere, and letters, which show that the font works.
        assert_eq!(pixels[..3], [255; 3]);
        assert!(pixels.chunks(3).any(|pixel| pixel == [0, 114, 178]));
        let title = &pixels[..3 * (info.width * 40 * SHARPNESS) as usize];
        assert!(
            title.iter().filter(|&&value| value < 100).count() > 100,
            "no letters"
        );
    }

    #[test]
    fn a_long_note_stays_on_the_paper() {
        let long = Chart {
            note: "Down and left is better, most of the time. ".repeat(12),
            ..chart(&[(1.0, 20.0), (10.0, 2.0)])
        };
        let pixels = pixels(&[long]).expect("two points");
        let row = 3 * (SIZE.0 * SHARPNESS) as usize;
        let at_side = 3 * (4 * SHARPNESS) as usize;
        let grey = |part: &[u8]| part.iter().any(|&value| value < 200);
        let foot = &pixels[pixels.len() - 40 * SHARPNESS as usize * row..];
        assert!(foot.chunks(row).any(grey), "no note");
        assert!(
            !foot.chunks(row).any(|row| grey(&row[row.len() - at_side..])),
            "cut off"
        );
    }

    #[test]
    fn a_chart_without_points_says_so() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for points in [&[][..], &[(0.0, 1.0), (1.0, f64::NAN), (-1.0, 2.0)]] {
            let error =
                write_stack(&[chart(points)], &out(folder.path()), "none").expect_err("nothing to draw");
            assert!(error.to_string().contains("no point"), "{error}");
        }
    }
}
