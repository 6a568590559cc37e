//! The middle: the 3D view and its overlays. Without a graphics device (tests) the parts are not drawn, the rest is.

use egui::{
    Align2, Color32, CornerRadius, FontId, Pos2, Rect, RichText, Role, Sense, Stroke, Ui, UiBuilder, Vec2,
    WidgetInfo,
};
use glam::DVec3;
use mortise_rig::describe_flags;

use super::{control, cube, fits, gaps, handles, measure, section, theme, way};
use crate::session::pose::point_from_wire;
use crate::session::touch::Touch;
use crate::session::{Intent, Session};
use crate::viewport::camera::{Projection, View};
use crate::viewport::compose::{Look, compose, touching_points};
use crate::viewport::gesture::{Viewpoint, on_screen};
use crate::viewport::picture::Ground;
use crate::viewport::six_axis::{Subject, Use};
use crate::viewport::surface::Surface;

/// Draws the view.
pub fn show(
    ui: &mut Ui,
    session: &mut Session,
    view: &mut Viewpoint,
    surface: Option<&mut Surface>,
    wanted: &mut Vec<Intent>,
) {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "3D view"));
    if surface.is_none() || session.document.is_none() {
        ui.painter()
            .rect_filled(rect, CornerRadius::ZERO, theme::of(ui).ground);
    }
    if session.document.is_none() {
        empty(ui, rect, session, wanted);
        return;
    }
    view.respond(ui, &response, session, wanted);
    if let Some(document) = &session.document {
        section::follow(ui, document, view);
    }
    let Some(document) = &session.document else { return };
    if let Some(surface) = surface {
        let scale = ui.pixels_per_point();
        let size = [rect.width(), rect.height()].map(|points| (points * scale).round().max(1.0) as u32);
        let cut = view.section.shown(document);
        let look = Look {
            camera: view.camera,
            see_through: view.see_through,
            cut,
            marked: &view.marked.parts,
            over: view.over.now,
            pair: view.pair,
            ground: ground(ui),
            scale,
        };
        let picture = compose(session, document, &look);
        if let Some(shown) = surface.show(&document.meshes, picture, rect, size) {
            ui.painter().add(shown);
        }
    }
    touching(ui, rect, session, view);
    way::of_next_step(ui, rect, session, view);
    gaps::show(ui, rect, document, view);
    marked(ui, rect, view);
    if !view.measure.on {
        handles::show(ui, rect, session, view);
    }
    triad(ui, rect, view);
    let below = toolbar(ui, rect, session, view);
    let below = section::show(ui, rect, below, session, view);
    let below = fits::over_view(ui, rect, below, session, view);
    let below = measure::show(ui, rect, below, document, view);
    legend(ui, rect, below, session);
    cube::show(ui, rect, view);
    readout(ui, rect, session);
    hint(ui, rect, session, view);
}

/// Background of the parts in this theme.
fn ground(ui: &Ui) -> Ground {
    match ui.visuals().dark_mode {
        true => Ground::Dark,
        false => Ground::Light,
    }
}

/// Says in the lower right corner what pointer and keys do now.
fn hint(ui: &Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    let hint = if let Some(hint) = steering(view) {
        hint
    } else if view.drags_hand() {
        "Moving the hand · Ctrl turns it"
    } else if view.handles.over().is_some() {
        "Drag: move the part · Ctrl: steps, with Shift finer · Esc: take back"
    } else if view.measure.on && session.connection().is_some() {
        "Click: measure · Backspace: clear · D: end measuring · Drag: orbit · Shift or middle: pan · Wheel: zoom"
    } else if view.measure.on {
        "Click: measure · Esc: clear, end · D: end measuring · Drag: orbit · Shift or middle: pan · Wheel: zoom"
    } else if session.is_armed() {
        "Drag: orbit · Shift or middle: pan · Wheel: zoom · F: fit · D: measure · Double click: grab · F1: keys"
    } else {
        "Drag: orbit · Shift or middle: pan · Wheel: zoom · F: fit · D: measure · Double click: frame · F1: keys"
    };
    ui.painter().text(
        rect.right_bottom() - Vec2::new(14.0, 12.0),
        Align2::RIGHT_BOTTOM,
        hint,
        FontId::proportional(11.5),
        theme::of(ui).text_weak.gamma_multiply(0.8),
    );
}

/// What the SpaceMouse moves now.
fn steering(view: &Viewpoint) -> Option<&'static str> {
    match view.six_axis.subject()? {
        Subject::Hand(_) => Some("SpaceMouse: moving the hand"),
        Subject::Part(..) => Some("SpaceMouse: moving the part"),
        Subject::View | Subject::Nothing => None,
    }
}

fn empty(ui: &mut Ui, rect: Rect, session: &Session, wanted: &mut Vec<Intent>) {
    if session.is_busy() {
        return;
    }
    let full = Vec2::new(400.0, 290.0);
    let card = Rect::from_center_size(rect.center(), full.min(rect.size() - Vec2::splat(12.0)));
    if card.size() == full {
        dashed(ui, card.expand(18.0));
    }
    ui.scope_builder(UiBuilder::new().max_rect(card), |ui| {
        ui.set_clip_rect(rect);
        let roomy = card.size() == full;
        ui.vertical_centered(|ui| {
            if roomy {
                ui.add_space(12.0);
                let (mark, _) = ui.allocate_exact_size(Vec2::splat(72.0), Sense::hover());
                control::mark(ui, mark, theme::of(ui).text_weak);
                ui.add_space(14.0);
            }
            ui.label(
                RichText::new("Drop a STEP file here")
                    .size(22.0)
                    .color(theme::of(ui).text_strong),
            );
            ui.label(
                RichText::new("Feel whether its parts go together, before anything is made")
                    .color(theme::of(ui).text_weak),
            );
            ui.add_space(if roomy { 16.0 } else { 2.0 });
            let wide = Vec2::new(
                220.0f32.min(ui.available_width()),
                if roomy { 36.0 } else { 28.0 },
            );
            let open = control::primary(ui, "Open STEP file…").min_size(wide);
            control::intent_button(ui, session, wanted, open, Intent::Browse, "Ctrl+O");
            ui.add_space(2.0);
            let sample = egui::Button::new("Open the sample").min_size(wide);
            let hint = "A block with an 18.75 mm hole and a peg 1 mm thinner";
            control::intent_button(ui, session, wanted, sample, Intent::OpenSample, hint);
        });
    });
}

fn dashed(ui: &Ui, rect: Rect) {
    let corners = [
        rect.left_top(),
        rect.right_top(),
        rect.right_bottom(),
        rect.left_bottom(),
        rect.left_top(),
    ];
    let stroke = Stroke::new(1.5, theme::of(ui).line);
    ui.painter()
        .extend(egui::Shape::dashed_line(&corners, stroke, 7.0, 6.0));
}

/// Draws dots at the touching points.
fn touching(ui: &Ui, rect: Rect, session: &Session, view: &Viewpoint) {
    if session.grabbed().is_none() {
        return;
    }
    let Some(telemetry) = &session.telemetry else {
        return;
    };
    let painter = ui.painter_at(rect);
    for point in touching_points(telemetry) {
        if let Some(at) = on_screen(&view.camera, rect, point) {
            painter.circle(at, 3.5, theme::of(ui).contact, Stroke::new(1.0, Color32::WHITE));
        }
    }
}

/// Draws a ring around the marked place.
fn marked(ui: &Ui, rect: Rect, view: &Viewpoint) {
    let place = (view.marked.place).and_then(|place| on_screen(&view.camera, rect, place));
    if let Some(at) = place {
        let painter = ui.painter_at(rect);
        painter.circle_stroke(at, 11.0, Stroke::new(3.5, theme::of(ui).ground));
        painter.circle_stroke(at, 11.0, Stroke::new(2.0, theme::of(ui).accent));
    }
}

/// Draws the world's axes in the lower left corner.
fn triad(ui: &Ui, rect: Rect, view: &Viewpoint) {
    let origin = rect.left_bottom() + Vec2::new(44.0, -44.0);
    let camera = &view.camera;
    let mut axes = [
        (DVec3::X, "x", Color32::from_rgb(226, 98, 92)),
        (DVec3::Y, "y", Color32::from_rgb(120, 196, 108)),
        (DVec3::Z, "z", Color32::from_rgb(100, 152, 240)),
    ];
    axes.sort_by(|a, b| {
        let near = |axis: DVec3| axis.dot(camera.backward());
        near(a.0).total_cmp(&near(b.0))
    });
    let painter = ui.painter_at(rect);
    for (axis, name, color) in axes {
        let seen = Vec2::new(axis.dot(camera.right()) as f32, -axis.dot(camera.up()) as f32);
        painter.line_segment([origin, origin + 24.0 * seen], Stroke::new(2.0, color));
        painter.text(
            origin + 33.0 * seen,
            Align2::CENTER_CENTER,
            name,
            FontId::proportional(12.0),
            color,
        );
    }
}

/// Draws the view's bar; returns its lower end.
fn toolbar(ui: &mut Ui, rect: Rect, session: &Session, view: &mut Viewpoint) -> f32 {
    let Some(document) = &session.document else {
        return rect.top();
    };
    let wide = 660.0f32.min(rect.width() - 24.0 - cube::height(rect)).max(0.0);
    let place = Rect::from_min_size(rect.min + Vec2::splat(12.0), Vec2::new(wide, 34.0));
    let ink = theme::of(ui);
    let drawn = ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 4.0;
            ui.spacing_mut().button_padding = Vec2::new(9.0, 4.0);
            let flat = |text: &str| {
                egui::Button::new(RichText::new(text).size(12.5)).fill(ink.control.gamma_multiply(0.85))
            };
            if ui.add(flat("Fit")).on_hover_text("See everything (F)").clicked() {
                view.fit(document.extent, rect);
            }
            for named in View::ALL {
                let hint = format!("View from: {} ({})", named.name().to_lowercase(), key_of(named));
                if ui.add(flat(named.name())).on_hover_text(hint).clicked() {
                    view.look(named, document.extent, rect);
                }
            }
            projection(ui, view);
            ui.add_space(6.0);
            let through = egui::Button::new(RichText::new("See through").size(12.5))
                .selected(view.see_through)
                .fill(if view.see_through {
                    ink.accent_dim
                } else {
                    ink.control.gamma_multiply(0.85)
                });
            let hint = "Draw fixed parts as glass to see inside a hole";
            if ui.add(through).on_hover_text(hint).clicked() {
                view.see_through = !view.see_through;
            }
            section::toggle(ui, document, view);
            measure::toggle(ui, view);
            space_mouse(ui, view);
        });
    });
    drawn.response.rect.bottom()
}

/// Draws the button of the projection.
fn projection(ui: &mut Ui, view: &mut Viewpoint) {
    let parallel = view.camera.projection == Projection::Orthographic;
    let response = ui
        .add(control::flat(ui, "Ortho", parallel))
        .accessible_name("Orthographic")
        .on_hover_text("Orthographic view: equal lengths look equal at every depth (5)");
    if response.clicked() {
        view.switch_projection();
    }
}

/// Draws the button that chooses what a SpaceMouse moves, where there is one.
fn space_mouse(ui: &mut Ui, view: &mut Viewpoint) {
    if !view.six_axis.is_there {
        return;
    }
    let moves_parts = view.six_axis.used == Use::Part;
    let response = ui
        .add(control::flat(ui, "SpaceMouse: part", moves_parts))
        .accessible_name("SpaceMouse moves the part")
        .on_hover_text(
            "The SpaceMouse moves the selected part, or the simulated hand that holds one, in place of the view (its left button)",
        );
    if response.clicked() {
        view.six_axis.switch();
    }
}

/// Key of a view, and how to see the opposite side.
fn key_of(view: View) -> &'static str {
    match view {
        View::Iso => "0",
        View::Front => "1; back: Ctrl+1",
        View::Right => "3; left: Ctrl+3",
        View::Top => "7; bottom: Ctrl+7",
        View::Back => "Ctrl+1",
        View::Left => "Ctrl+3",
        View::Bottom => "Ctrl+7",
    }
}

/// Legend of the face colours, under the bars, which end at `top`, while a part is held.
fn legend(ui: &mut Ui, rect: Rect, top: f32, session: &Session) {
    if session.grabbed().is_none() {
        return;
    }
    let place = Rect::from_min_size(Pos2::new(rect.left() + 14.0, top + 8.0), Vec2::new(240.0, 20.0));
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.horizontal(|ui| {
            let touches = "Faces and edges of both parts that touch now";
            swatch(ui, theme::of(ui).contact, false, "touches", touches);
            let fits = "Faces that fit: guided onto each other, or held together by contact (hatched)";
            swatch(ui, theme::of(ui).mates, true, "fits", fits);
            if session.drawing_energy().is_some() {
                let draws = "From where its energy draws the middle of the part into its fit: the brighter the deeper the energy and the larger its force";
                let [r, g, b] = ground(ui).glow().map(|c| (255.0 * c) as u8);
                swatch(ui, Color32::from_rgb(r, g, b).gamma_multiply(0.6), false, "draws", draws);
            }
        });
    });
}

/// A square in a face colour, and its meaning.
fn swatch(ui: &mut Ui, color: Color32, hatched: bool, text: &str, hint: &str) {
    let (square, response) = ui.allocate_exact_size(Vec2::splat(12.0), Sense::hover());
    let painter = ui.painter_at(square);
    let fill = if hatched {
        color.gamma_multiply(0.35)
    } else {
        color
    };
    painter.rect_filled(square, CornerRadius::same(2), fill);
    if hatched {
        for shift in [-6.0, 0.0, 6.0] {
            let ends = [
                square.left_bottom() + Vec2::new(shift, 0.0),
                square.right_top() + Vec2::new(shift, 0.0),
            ];
            painter.line_segment(ends, Stroke::new(2.2, color));
        }
    }
    response.on_hover_text(hint);
    let label = ui.label(RichText::new(text).size(12.0).color(theme::of(ui).text));
    label.on_hover_text(hint);
    ui.add_space(6.0);
}

/// Present force and touching faces, in the upper right corner, while a part is held.
fn readout(ui: &Ui, rect: Rect, session: &Session) {
    let (Some(part), Some(telemetry), Some(document)) =
        (session.grabbed(), &session.telemetry, &session.document)
    else {
        return;
    };
    let sample = session.history.newest();
    let mut lines = vec![(document.moving_name(part).to_owned(), theme::of(ui).held, 14.5)];
    if let Some(sample) = sample {
        lines.push((
            format!("{:.2} N on the handle", sample.handle_n),
            theme::of(ui).text_strong,
            13.0,
        ));
    }
    if telemetry.pairs.is_empty() {
        lines.push(("no contact".to_owned(), theme::of(ui).text_weak, 12.5));
    }
    for words in describe_flags(telemetry.flags) {
        lines.push((words.to_owned(), theme::of(ui).warning, 12.5));
    }
    for pair in telemetry.pairs.iter().take(3) {
        let at = point_from_wire(pair.point);
        let own = Touch::of(document, part, [pair.moving_face, pair.moving_edge_face], at);
        let touched = document.model_part(pair.static_part).map(|other| {
            let touch = Touch::of(document, other, [pair.static_face, pair.static_edge_face], at);
            format!(
                "{touch} of {}",
                document.owner_name(other, &[pair.static_face.into()])
            )
        });
        let touched = touched.as_deref().unwrap_or("?");
        let text = format!("{own} on {touched}, {:.0} µm deep", 1e6 * pair.depth.max(0.0));
        lines.push((text, theme::of(ui).contact, 12.5));
    }
    let guided = match telemetry.guidance.active {
        0 if session.guides_by_energy() && telemetry.guidance.engagement > 0.0 => {
            Some("drawn by its energy".to_owned())
        }
        0 => None,
        1 => Some("guided by 1 target".to_owned()),
        targets => Some(format!("guided by {targets} targets")),
    };
    if let Some(guided) = guided {
        let [x, y, z] = telemetry.guidance.wrench.force.map(f64::from);
        let pull = DVec3::new(x, y, z).length();
        lines.push((format!("{guided}, {pull:.2} N"), theme::of(ui).mates, 12.5));
    }
    let painter = ui.painter_at(rect);
    let galleys: Vec<_> = lines
        .into_iter()
        .map(|(text, color, size)| painter.layout_no_wrap(text, FontId::proportional(size), color))
        .collect();
    let wide = galleys.iter().map(|g| g.size().x).fold(0.0, f32::max);
    let high: f32 = galleys.iter().map(|g| g.size().y + 3.0).sum();
    let card = Rect::from_min_size(
        Pos2::new(rect.right() - wide - 38.0, rect.top() + 12.0 + cube::height(rect)),
        Vec2::new(wide + 26.0, high + 15.0),
    );
    painter.rect(
        card,
        CornerRadius::same(8),
        theme::of(ui).card.gamma_multiply(0.9),
        Stroke::new(1.0, theme::of(ui).line),
        egui::StrokeKind::Inside,
    );
    let mut at = card.min + Vec2::new(13.0, 9.0);
    for galley in galleys {
        let height = galley.size().y;
        painter.galley(at, galley, theme::of(ui).text);
        at.y += height + 3.0;
    }
}
