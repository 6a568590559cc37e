//! The mechanism that the description describes, drawn within its reach, with a slider for each joint. Nothing is driven: the sliders move the drawing.

use egui::{Align2, Mesh, Painter, Pos2, Rect, RichText, Sense, Shape, Slider, Stroke, Ui, Vec2};
use egui::{Role, WidgetInfo};
use glam::DVec2;

use super::diagram::Diagram;
use super::theme::Palette;
use super::{control, theme};
use crate::session::mechanism::links::{Angles, Links, Skeleton};
use crate::session::mechanism::reach::{Limit, Seen};
use crate::session::mechanism::region::{Cell, Region};
use crate::session::mechanism::{Mechanism, words};
use crate::session::rig_page::{DrawIntent, RigIntent};
use crate::session::{Intent, Session};

/// Least and largest height of a view, points, and its share of the width.
const HEIGHT: (f32, f32, f32) = (150.0, 260.0, 0.9);
/// Space around the reach, as a share of its extent.
const AROUND: f64 = 0.14;
/// Radius of a joint and of the handle, points.
const JOINT: f32 = 4.0;
const HANDLE: f32 = 6.0;
/// Strength of the filling where no force is rendered, and where all of it is.
const FADED: f32 = 0.1;
const FULL: f32 = 0.28;
/// Length of the world's axes, points.
const AXES: f32 = 26.0;

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    control::section(ui, "Mechanism");
    ui.add_space(4.0);
    let page = &session.rig_page;
    let mechanism = match page.checked() {
        None => {
            return weak(
                ui,
                "No picture: there is no description. Choose an example, open a file, or read what the board keeps.",
            );
        }
        Some(Err(why)) => {
            ui.label(RichText::new(format!("No picture: {why}")).color(theme::of(ui).warning));
            return;
        }
        Some(Ok(checked)) => &checked.mechanism,
    };
    let (angles, live) = page.drawn();
    let skeleton = mechanism.links.skeleton(angles);
    choice(ui, session, wanted);
    views(ui, mechanism, &skeleton);
    ui.label(RichText::new(words::reach(mechanism)).size(12.5));
    if let Some(remarks) = words::remarks(mechanism) {
        weak(ui, &remarks);
    }
    ui.label(RichText::new(words::place(&skeleton)).size(12.5));
    sliders(ui, mechanism, angles, live, wanted);
}

fn weak(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}

/// Draws the views beside each other.
fn views(ui: &mut Ui, mechanism: &Mechanism, skeleton: &Skeleton) {
    let views = mechanism.links.views();
    let width = ui.available_width();
    let each = (width - 8.0 * (views.len() - 1) as f32) / views.len() as f32;
    let size = Vec2::new(width, (HEIGHT.2 * each).clamp(HEIGHT.0, HEIGHT.1));
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    for (number, view) in views.iter().enumerate() {
        let left = rect.left() + number as f32 * (each + 8.0);
        let place = Rect::from_min_size(Pos2::new(left, rect.top()), Vec2::new(each, rect.height()));
        if let Some(seen) = mechanism.reach.in_view(*view) {
            Drawing {
                links: &mechanism.links,
                skeleton,
                seen,
            }
            .show(ui, place);
        }
    }
    let name = format!("Picture of the mechanism. {}", words::reach(mechanism));
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &name));
    response.on_hover_text(
        "Millimetres in the mechanism's own frame.\nFilled: where the handle can be, weaker where force fades near singular postures.\nLines with a joint and its angle: that joint at its limit.\nDashed: the workspace, in the plane of the handle.\nx, y, z: the world's axes at its origin.",
    );
}

/// One view.
struct Drawing<'a> {
    links: &'a Links,
    skeleton: &'a Skeleton,
    seen: &'a Seen,
}

impl Drawing<'_> {
    fn at(&self, point: glam::DVec3) -> DVec2 {
        self.links.seen(self.seen.view, self.skeleton.yaw, point)
    }

    /// Corners of what is drawn.
    fn bounds(&self) -> [DVec2; 2] {
        let [low, high] = self.seen.bounds;
        let around = AROUND * (high - low).max_element();
        [low - around, high + around]
    }

    fn show(&self, ui: &Ui, rect: Rect) {
        let ink = theme::of(ui);
        let diagram = Diagram::new(rect, self.bounds(), true);
        diagram.grid(&ui.painter_at(rect), ink);
        let painter = ui.painter_at(diagram.rect);
        fill(&painter, &diagram, &self.seen.region, ink);
        self.reach(&painter, &diagram, ink);
        self.world(&painter, &diagram, ink);
        self.links(&painter, &diagram, ink);
        for limit in &self.seen.limits {
            mark(&painter, &diagram, limit, ink);
        }
        let corner = diagram.rect.left_top() + Vec2::new(4.0, 3.0);
        let name = format!("{}, mm", self.seen.view.name());
        diagram.label(&painter, corner, Align2::LEFT_TOP, &name, ink, ink.text_weak);
    }

    fn reach(&self, painter: &Painter, diagram: &Diagram, ink: &Palette) {
        let edge = Stroke::new(1.5, ink.accent);
        for line in self.seen.lines() {
            diagram.line(painter, line, edge);
        }
        for ends in &self.seen.region.folds {
            diagram.line(painter, ends, edge);
        }
        if let Some((centre, radius)) = self.links.workspace(self.seen.view, self.skeleton) {
            let circle: Vec<DVec2> = (0..=96)
                .map(|step| {
                    centre + radius * DVec2::from_angle(core::f64::consts::TAU * f64::from(step) / 96.0)
                })
                .collect();
            diagram.dashed(painter, &circle, Stroke::new(1.0, ink.text_weak));
        }
    }

    /// The world's axes at its origin.
    fn world(&self, painter: &Painter, diagram: &Diagram, ink: &Palette) {
        let (origin, ends) = self.links.world_axes(self.seen.view, self.skeleton.yaw);
        let from = diagram.at(origin);
        for ((end, color), name) in ends.into_iter().zip(ink.axes).zip(["x", "y", "z"]) {
            let to = from + AXES * Vec2::new(end.x as f32, -end.y as f32);
            // An axis towards the eye is a dot.
            if end.length() > 0.15 {
                painter.line_segment([from, to], Stroke::new(2.0, color));
                let beyond = to + 7.0 * Vec2::new(end.x as f32, -end.y as f32).normalized();
                diagram.label(painter, beyond, Align2::CENTER_CENTER, name, ink, color);
            }
        }
        painter.circle_filled(from, 2.5, ink.text);
    }

    fn links(&self, painter: &Painter, diagram: &Diagram, ink: &Palette) {
        for link in &self.skeleton.links {
            let ends = link.map(|end| diagram.at(self.at(end)));
            painter.line_segment(ends, Stroke::new(5.0, ink.card));
            painter.line_segment(ends, Stroke::new(3.0, ink.text_strong));
        }
        for joint in &self.skeleton.joints {
            painter.circle(
                diagram.at(self.at(*joint)),
                JOINT,
                ink.card,
                Stroke::new(2.0, ink.text_strong),
            );
        }
        if let Some(handle) = self.skeleton.handle {
            painter.circle(
                diagram.at(self.at(handle)),
                HANDLE,
                ink.held,
                Stroke::new(1.5, ink.card),
            );
        }
    }
}

/// Fills the region, weaker where force fades, without seams: cells overlap where the reach folds back.
fn fill(painter: &Painter, diagram: &Diagram, region: &Region, ink: &Palette) {
    let color = |share: f64| {
        let share = FADED + (FULL - FADED) * share as f32;
        ink.card.lerp_to_gamma(ink.accent, share)
    };
    let least = |cell: &Cell| cell.shares.iter().copied().fold(1.0, f64::min);
    let mut cells: Vec<&Cell> = region.cells.iter().collect();
    // A place that one posture reaches in full is reached in full.
    cells.sort_by(|a, b| least(a).total_cmp(&least(b)));
    let mut mesh = Mesh::default();
    for cell in cells {
        let first = mesh.vertices.len() as u32;
        for (corner, share) in cell.corners.iter().zip(&cell.shares) {
            mesh.colored_vertex(diagram.at(*corner), color(*share));
        }
        for corner in 1..cell.corners.len() as u32 - 1 {
            mesh.add_triangle(first, first + corner, first + corner + 1);
        }
    }
    painter.add(Shape::mesh(mesh));
}

/// Marks where a joint is at its limit.
fn mark(painter: &Painter, diagram: &Diagram, limit: &Limit, ink: &Palette) {
    let Some(piece) = limit.pieces.iter().max_by_key(|piece| piece.len()) else {
        return;
    };
    let middle = match piece[..] {
        [a, b] => a.midpoint(b),
        _ => piece[piece.len() / 2],
    };
    let at = diagram.at(middle);
    if piece.len() == 1 {
        painter.circle(at, 3.5, ink.accent, Stroke::new(1.0, ink.card));
    }
    let text = format!(
        "{}: {}°",
        limit.joint + 1,
        words::number(limit.angle.to_degrees())
    );
    let place = at + Vec2::new(0.0, if piece.len() == 1 { 12.0 } else { 0.0 });
    diagram.label(painter, place, Align2::CENTER_CENTER, &text, ink, ink.accent);
}

/// Draws a slider for each joint.
fn sliders(ui: &mut Ui, mechanism: &Mechanism, angles: Angles, live: bool, wanted: &mut Vec<Intent>) {
    let draw = |intent| Intent::Rig(RigIntent::Draw(intent));
    for (joint, [from, to]) in mechanism.links.ranges().iter().enumerate() {
        let mut degrees = angles[joint].to_degrees();
        let before = degrees;
        ui.horizontal(|ui| {
            let label = ui.label(RichText::new(format!("Joint {}", joint + 1)).small());
            ui.spacing_mut().slider_width = (ui.available_width() - 84.0).max(80.0);
            let range = from.to_degrees()..=to.to_degrees();
            let slider = Slider::new(&mut degrees, range).suffix("°").fixed_decimals(1);
            let response = ui.add_enabled(!live, slider).labelled_by(label.id);
            if response.changed() && degrees != before {
                wanted.push(draw(DrawIntent::Joint(joint, degrees.to_radians())));
            }
            response
                .on_hover_text("Moves the drawing; nothing is driven")
                .on_disabled_hover_text("Drawn where the connected mechanism has it");
        });
    }
}

/// Draws the buttons that choose the posture.
fn choice(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let draw = |intent| Intent::Rig(RigIntent::Draw(intent));
    ui.horizontal(|ui| {
        let button = egui::Button::new("Home pose").min_size(Vec2::new(0.0, 26.0));
        let hint = "Draw the pose in which counting starts";
        control::intent_button(ui, session, wanted, button, draw(DrawIntent::Home), hint);
        let follows = session.rig_page.follows();
        let button = egui::Button::selectable(follows, "Live joints").min_size(Vec2::new(0.0, 26.0));
        let hint = "Draw the joints where the connected mechanism has them";
        let intent = draw(DrawIntent::Follow(!follows));
        control::intent_button(ui, session, wanted, button, intent, hint);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use mortise_rig::{EXAMPLES, parse_rig};

    /// Everything that is drawn of any example in any posture of a grid is within the picture.
    #[test]
    fn links_and_reach_are_within_the_picture() {
        for (name, text) in EXAMPLES {
            let mechanism = Mechanism::new(&parse_rig(text, name).expect(name)).expect(name);
            for share in [0.0, 0.31, 0.68, 1.0] {
                let mut angles = mechanism.links.home();
                for (angle, [from, to]) in angles.iter_mut().zip(mechanism.links.ranges()) {
                    *angle = from + share * (to - from);
                }
                let skeleton = mechanism.links.skeleton(angles);
                for view in mechanism.links.views() {
                    let seen = mechanism.reach.in_view(*view).expect("a reach");
                    let drawing = Drawing {
                        links: &mechanism.links,
                        skeleton: &skeleton,
                        seen,
                    };
                    let [low, high] = drawing.bounds();
                    for end in skeleton.links.iter().flatten() {
                        let at = drawing.at(*end);
                        assert!(
                            at.cmpge(low).all() && at.cmple(high).all(),
                            "{name} {view:?}: {at}"
                        );
                    }
                }
            }
        }
    }
}
