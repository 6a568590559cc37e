//! Stability margin of the coupling: for each motion the plane of stiffness and damping with what the rig's loop bears, the setting in it, and its margin
//! in words.

use egui::{
    Align2, CollapsingHeader, Color32, Mesh, Painter, Rect, RichText, Role, Sense, Shape, Stroke, Ui, Vec2,
    WidgetInfo,
};
use glam::DVec2;

use super::diagram::Diagram;
use super::theme::Palette;
use super::{control, theme};
use crate::session::margin::limits::{Map, Margin};
use crate::session::margin::sampled_loop::Gains;
use crate::session::margin::{Limits, Motion, Plane, words};
use crate::session::rig_page::RigIntent;
use crate::session::{Intent, Session};

/// The section's name.
const NAME: &str = "Stability margin";
/// Height of a plane, points.
const HEIGHT: f32 = 150.0;
/// The plane shows this many times what the board takes.
const SHOWN: f64 = 1.06;

/// Draws the section.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let open = session.preferences.open.get(NAME).copied().unwrap_or(true);
    let section = CollapsingHeader::new(NAME)
        .default_open(open)
        .show_unindented(ui, |ui| contents(ui, session, wanted));
    if section.header_response.clicked() {
        wanted.push(Intent::Fold {
            section: NAME,
            open: !open,
        });
    }
}

fn contents(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.spacing_mut().item_spacing.y = 3.0;
    let subject = match session.limited_rig() {
        Ok(subject) => subject,
        Err(why) => {
            weak(ui, why);
            let button = egui::Button::new(RichText::new("Read description").size(12.5));
            let read = Intent::Rig(RigIntent::Read);
            control::intent_button(
                ui,
                session,
                wanted,
                button,
                read,
                "Read the description that the board keeps",
            );
            return;
        }
    };
    let Some(limits) = session.limits.of(&subject, session.chosen_position_scale()) else {
        return weak(
            ui,
            "No force is rendered in any posture of the described mechanism",
        );
    };
    weak(ui, &format!("Of {}. {}", limits.name, words::class()));
    if let Some(scaled) = words::scaled(limits.scale) {
        weak(ui, &scaled);
    }
    for plane in &limits.planes {
        one(ui, plane, &plane.margin(&session.parameters));
    }
    if !turns(&limits) {
        weak(
            ui,
            "No motor turns this handle: angular stiffness and damping move the held part alone",
        );
    }
    ui.add_space(4.0);
}

fn turns(limits: &Limits) -> bool {
    limits.planes.iter().any(|plane| plane.motion == Motion::Rotation)
}

fn weak(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).small().color(theme::of(ui).text_weak));
}

/// Draws a motion's plane and margin.
fn one(ui: &mut Ui, plane: &Plane, margin: &Margin) {
    let ink = theme::of(ui);
    let [stiffness_unit, damping_unit] = words::units(plane.motion);
    let name = words::name(plane.motion);
    ui.add_space(2.0);
    ui.label(
        RichText::new(format!(
            "{name}: damping in {damping_unit} over stiffness in {stiffness_unit}"
        ))
        .size(12.0),
    );
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), HEIGHT), Sense::hover());
    draw(ui, rect, &plane.map, margin);
    let first = words::stiffness(plane, margin);
    response.widget_info(|| {
        WidgetInfo::labeled(Role::Image, true, format!("Plane of stability, {name}. {first}"))
    });
    response.on_hover_text(
        "Filled: stable, weaker where dry friction no longer holds the handle between two counts.\nGreen line: passive with any hand up to there.\nDashed: the end of what the board takes.\nDot: the setting.",
    );
    let color = if margin.times() < 1.0 {
        ink.fault_text
    } else {
        ink.text_strong
    };
    ui.label(RichText::new(first).size(12.5).color(color));
    weak(ui, &words::damping(plane, margin));
    weak(ui, &words::passivity(plane, margin));
    weak(ui, &words::basis(plane));
}

fn draw(ui: &Ui, rect: Rect, map: &Map, margin: &Margin) {
    let ink = theme::of(ui);
    let most = DVec2::new(map.most.stiffness, map.most.damping);
    let diagram = Diagram::new(rect, [DVec2::ZERO, SHOWN * most], false);
    diagram.grid(&ui.painter_at(rect), ink);
    let painter = ui.painter_at(diagram.rect);
    let resting = map.resting();
    strip(
        &painter,
        &diagram,
        map,
        f64::INFINITY,
        ink.card.lerp_to_gamma(ink.accent, 0.16),
    );
    strip(
        &painter,
        &diagram,
        map,
        resting,
        ink.card.lerp_to_gamma(ink.accent, 0.36),
    );
    lines(&painter, &diagram, map, ink);
    if resting < most.x {
        let ends = [DVec2::new(resting, 0.0), DVec2::new(resting, most.y)];
        diagram.line(&painter, &ends, Stroke::new(1.5, ink.accent));
        let place = diagram.at(DVec2::new(resting, 0.86 * most.y)) + Vec2::new(6.0, 0.0);
        diagram.label(
            &painter,
            place,
            Align2::LEFT_CENTER,
            "trembles beyond",
            ink,
            ink.accent,
        );
    }
    let corner = [DVec2::new(most.x, 0.0), most, DVec2::new(0.0, most.y)];
    diagram.dashed(&painter, &corner, Stroke::new(1.2, ink.text_weak));
    point(&painter, &diagram, &margin.gains, ink);
}

/// Fills what is stable up to a stiffness.
fn strip(painter: &Painter, diagram: &Diagram, map: &Map, up_to: f64, color: Color32) {
    let mut mesh = Mesh::default();
    for (row, limit) in map.rows.iter().enumerate() {
        let stiffness = limit.stable.min(up_to).min(map.most.stiffness);
        for x in [0.0, stiffness] {
            mesh.colored_vertex(diagram.at(DVec2::new(x, limit.damping)), color);
        }
        if row > 0 {
            let first = 2 * row as u32 - 2;
            mesh.add_triangle(first, first + 1, first + 3);
            mesh.add_triangle(first, first + 3, first + 2);
        }
    }
    painter.add(Shape::mesh(mesh));
}

/// Draws where the loop begins to oscillate, and up to where it is passive.
fn lines(painter: &Painter, diagram: &Diagram, map: &Map, ink: &Palette) {
    let along = |of: fn(&crate::session::margin::limits::Row) -> f64| -> Vec<DVec2> {
        let drawn = map
            .rows
            .iter()
            .map(|row| DVec2::new(of(row).min(2.0 * map.most.stiffness), row.damping));
        drawn.collect()
    };
    let stable = along(|row| row.stable);
    diagram.line(painter, &stable, Stroke::new(2.0, ink.accent));
    let passive = along(|row| row.passive);
    diagram.line(painter, &passive, Stroke::new(1.5, ink.good));
    let within = stable
        .iter()
        .filter(|place| place.x > 0.0 && place.x < 0.7 * map.most.stiffness);
    if let Some(place) = within.max_by(|a, b| a.x.total_cmp(&b.x)) {
        let at = diagram.at(*place) + Vec2::new(6.0, 0.0);
        diagram.label(
            painter,
            at,
            Align2::LEFT_CENTER,
            "oscillates beyond",
            ink,
            ink.accent,
        );
    }
}

fn point(painter: &Painter, diagram: &Diagram, gains: &Gains, ink: &Palette) {
    let at = diagram.at(DVec2::new(gains.stiffness, gains.damping));
    painter.circle(at, 5.0, ink.held, Stroke::new(1.5, ink.card));
}
