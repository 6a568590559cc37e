//! The gaps between parts along the borders of a section: lines in a colour by the exact distance, a legend, and the number under the pointer.

use egui::epaint::{Mesh, Vertex, WHITE_UV};
use egui::{Align2, Color32, CornerRadius, DragValue, FontId, Pos2, Rect, Shape, Ui, Vec2};
use mortise_inspect::TOUCH_MM;

use super::{control, theme};
use crate::cut::{Band, Cut, Gaps};
use crate::session::clearances;
use crate::session::document::Document;
use crate::viewport::gesture::{Viewpoint, on_screen};

/// Width of a line, points.
const WIDTH: f32 = 4.5;
/// Distance from a line within which the pointer is on it, points.
const NEAR: f32 = 9.0;
/// Colours from no gap to the largest one shown.
const SCALE: [[u8; 3]; 4] = [[255, 190, 60], [150, 205, 80], [60, 185, 190], [80, 115, 240]];
/// Colour where surfaces touch.
const TOUCHING: Color32 = Color32::from_rgb(250, 250, 245);
/// Colour where parts overlap.
const OVERLAP: Color32 = Color32::from_rgb(240, 60, 50);

/// Colour of a distance, with gaps up to `range_mm` shown.
fn color(distance_mm: f64, range_mm: f64) -> Color32 {
    if distance_mm < -TOUCH_MM {
        return OVERLAP;
    }
    if distance_mm <= TOUCH_MM {
        return TOUCHING;
    }
    let last = SCALE.len() - 1;
    let at = (distance_mm / range_mm.max(TOUCH_MM)).clamp(0.0, 1.0) * last as f64;
    let below = (at as usize).min(last - 1);
    let share = (at - below as f64) as f32;
    let mixed = |i: usize| {
        let [a, b] = [below, below + 1].map(|stop| f32::from(SCALE[stop][i]));
        (a + share * (b - a)).round() as u8
    };
    Color32::from_rgb(mixed(0), mixed(1), mixed(2))
}

/// Draws the button that shows the gaps, and the largest gap shown.
pub fn controls(ui: &mut Ui, view: &mut Viewpoint) {
    let shown = view.section.shows_gaps;
    let hint = "Colour the borders of the cut by the exact gap to the nearest part";
    let button = control::flat(ui, "Gaps", shown);
    if ui.add(button).on_hover_text(hint).clicked() {
        view.section.shows_gaps = !shown;
    }
    if shown {
        ui.add(
            DragValue::new(&mut view.section.gaps_up_to_um)
                .range(1.0..=20_000.0)
                .speed(5.0)
                .max_decimals(1)
                .prefix("up to ")
                .suffix(" µm"),
        )
        .accessible_name("Largest gap shown")
        .on_hover_text("Wider gaps have no colour");
    }
}

/// Draws the gaps of the section shown.
pub fn show(ui: &Ui, rect: Rect, document: &Document, view: &Viewpoint) {
    let shown = view.section.shown(document).and_then(|shown| shown.cut);
    let (true, Some(cut)) = (view.section.shows_gaps, shown) else {
        return;
    };
    let Some(gaps) = &cut.gaps else { return };
    // From behind the solid hides them.
    if !view.camera.sees_front(cut.plane.origin, cut.plane.normal) {
        return;
    }
    let pointer = ui
        .input(|i| i.pointer.hover_pos())
        .filter(|at| rect.contains(*at));
    let mut mesh = Mesh::default();
    let mut under: Option<(f32, &Band, f32)> = None;
    for band in &gaps.bands {
        if band.parts.iter().any(|part| document.is_hidden(*part)) {
            continue;
        }
        let Some(ends) = ends(cut, rect, view, band) else {
            continue;
        };
        line(
            &mut mesh,
            ends,
            band.distances_mm.map(|mm| color(mm, gaps.range_mm)),
        );
        if let Some(at) = pointer {
            let (away, share) = nearest(at, ends);
            if away < NEAR && under.is_none_or(|(least, ..)| away < least) {
                under = Some((away, band, share));
            }
        }
    }
    let painter = ui.painter_at(rect);
    painter.add(Shape::mesh(mesh));
    legend(ui, rect, gaps);
    if let (Some((_, band, share)), Some(at)) = (under, pointer) {
        note(ui, rect, at, &words(document, band, share.into()));
    }
}

/// A band's ends on the screen.
fn ends(cut: &Cut, rect: Rect, view: &Viewpoint, band: &Band) -> Option<[Pos2; 2]> {
    let [a, b] = band
        .ends
        .map(|end| on_screen(&view.camera, rect, cut.plane.from_plane(end)));
    Some([a?, b?])
}

fn line(mesh: &mut Mesh, [a, b]: [Pos2; 2], colors: [Color32; 2]) {
    let along = b - a;
    let length = along.length();
    if !length.is_finite() || length <= 0.0 {
        return;
    }
    let across = 0.5 * WIDTH * along.rot90() / length;
    let first = mesh.vertices.len() as u32;
    for (end, color) in [(a, colors[0]), (b, colors[1])] {
        for pos in [end - across, end + across] {
            mesh.vertices.push(Vertex {
                pos,
                uv: WHITE_UV,
                color,
            });
        }
    }
    mesh.add_triangle(first, first + 1, first + 2);
    mesh.add_triangle(first + 1, first + 3, first + 2);
}

/// Distance of `at` from a line, and the share of the line up to there.
fn nearest(at: Pos2, [a, b]: [Pos2; 2]) -> (f32, f32) {
    let along = b - a;
    let share = ((at - a).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
    (at.distance(a + share * along), share)
}

/// The distance at a share of a band, in words.
fn words(document: &Document, band: &Band, share: f64) -> String {
    let [a, b] = band.distances_mm;
    let mm = a + share * (b - a);
    let [own, other] = band.parts.map(|part| document.part_name(part));
    format!("{own} – {other}: {}", clearances::words(mm))
}

/// A text beside the pointer.
fn note(ui: &Ui, rect: Rect, at: Pos2, text: &str) {
    let painter = ui.painter_at(rect);
    let ink = theme::of(ui);
    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(12.5), ink.text_strong);
    let size = galley.size() + Vec2::new(14.0, 8.0);
    let least = rect.right() - size.x - 4.0;
    let place = Rect::from_min_size(
        Pos2::new((at.x + 14.0).min(least), (at.y - size.y - 6.0).max(rect.top())),
        size,
    );
    painter.rect_filled(place, CornerRadius::same(5), ink.card);
    painter.galley(place.min + Vec2::new(7.0, 4.0), galley, ink.text_strong);
}

/// The meaning of the colours, at the right end of the view.
fn legend(ui: &Ui, rect: Rect, gaps: &Gaps) {
    let (wide, high) = (12.0, 132.0f32.min(rect.height() - 120.0));
    if high < 40.0 {
        return;
    }
    let bar = Rect::from_min_size(
        Pos2::new(rect.right() - 96.0, rect.bottom() - high - 74.0),
        Vec2::new(wide, high),
    );
    let ink = theme::of(ui);
    let painter = ui.painter_at(rect);
    let around = Rect::from_min_max(
        bar.min - Vec2::new(10.0, 26.0),
        Pos2::new(rect.right() - 8.0, bar.bottom() + 34.0),
    );
    painter.rect_filled(around, CornerRadius::same(8), ink.card.gamma_multiply(0.9));
    let text = |at: Pos2, words: &str| {
        painter.text(
            at,
            Align2::LEFT_CENTER,
            words,
            FontId::proportional(11.5),
            ink.text,
        );
    };
    text(bar.left_top() - Vec2::new(2.0, 14.0), "Gap, µm");
    let steps = 24;
    for step in 0..steps {
        let share = f64::from(step) / f64::from(steps - 1);
        let top = bar.bottom() - high * (step + 1) as f32 / steps as f32;
        let piece = Rect::from_min_size(
            Pos2::new(bar.left(), top),
            Vec2::new(wide, high / steps as f32 + 0.5),
        );
        painter.rect_filled(
            piece,
            CornerRadius::ZERO,
            color((share * gaps.range_mm).max(2.0 * TOUCH_MM), gaps.range_mm),
        );
    }
    for share in [0.0, 0.5, 1.0] {
        let at = Pos2::new(bar.right() + 6.0, bar.bottom() - high * share);
        let um = 1e3 * gaps.range_mm * f64::from(share);
        text(at, &format!("{um:.0}"));
    }
    for (row, (ink, words)) in [(TOUCHING, "touching"), (OVERLAP, "overlap")]
        .into_iter()
        .enumerate()
    {
        let y = bar.bottom() + 12.0 + 14.0 * row as f32;
        let square = Rect::from_center_size(Pos2::new(bar.center().x, y), Vec2::splat(9.0));
        painter.rect_filled(square, CornerRadius::same(2), ink);
        text(Pos2::new(bar.right() + 6.0, y), words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_overlap_touch_and_gap_apart() {
        assert_eq!(color(-0.01, 0.5), OVERLAP);
        assert_eq!(color(0.0, 0.5), TOUCHING);
        assert_eq!(color(0.5, 0.5), Color32::from_rgb(80, 115, 240));
        assert_eq!(color(7.0, 0.5), color(0.5, 0.5), "beyond the range");
        assert_ne!(color(0.1, 0.5), color(0.2, 0.5));
        assert_eq!(color(f64::NAN, 0.5).a(), 255, "no panic");
    }

    #[test]
    fn the_pointer_is_near_a_line_at_its_nearest_point() {
        let ends = [Pos2::new(0.0, 0.0), Pos2::new(10.0, 0.0)];
        assert_eq!(nearest(Pos2::new(5.0, 3.0), ends), (3.0, 0.5));
        assert_eq!(nearest(Pos2::new(14.0, 3.0), ends), (5.0, 1.0));
    }
}
