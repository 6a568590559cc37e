//! Colours, type and spacing, in one place. Dark, quiet, one accent; red is kept for STOP and faults, orange for what is in hand or touches.

use egui::{
    Color32, CornerRadius, FontFamily, FontId, Margin, Shadow, Stroke, Style, TextStyle, Vec2, Visuals,
};

/// Behind everything.
pub const GROUND: Color32 = Color32::from_rgb(19, 21, 25);
/// Panels.
pub const PANEL: Color32 = Color32::from_rgb(27, 30, 36);
/// Cards on panels.
pub const CARD: Color32 = Color32::from_rgb(34, 38, 45);
/// Lines between things.
pub const LINE: Color32 = Color32::from_rgb(48, 53, 62);
/// Controls at rest.
pub const CONTROL: Color32 = Color32::from_rgb(50, 56, 66);
/// Controls under the pointer.
pub const CONTROL_HOVER: Color32 = Color32::from_rgb(64, 72, 84);
/// Text.
pub const TEXT: Color32 = Color32::from_rgb(214, 219, 226);
/// Text that matters.
pub const TEXT_STRONG: Color32 = Color32::from_rgb(244, 247, 250);
/// Text that explains.
pub const TEXT_WEAK: Color32 = Color32::from_rgb(146, 154, 166);
/// The accent.
pub const ACCENT: Color32 = Color32::from_rgb(92, 164, 245);
/// The accent as a ground.
pub const ACCENT_DIM: Color32 = Color32::from_rgb(38, 82, 132);
/// In hand, and touching.
pub const HELD: Color32 = Color32::from_rgb(245, 166, 66);
/// All is well.
pub const GOOD: Color32 = Color32::from_rgb(104, 200, 132);
/// Look here.
pub const WARNING: Color32 = Color32::from_rgb(240, 196, 88);
/// STOP and faults.
pub const STOP: Color32 = Color32::from_rgb(214, 48, 49);
/// The same under the pointer.
pub const STOP_HOVER: Color32 = Color32::from_rgb(235, 70, 68);
/// Text about faults: red that can be read on dark.
pub const FAULT_TEXT: Color32 = Color32::from_rgb(255, 122, 112);
/// Forces of contacts, in plots and as arrows.
pub const CONTACT: Color32 = Color32::from_rgb(255, 112, 72);

/// Surfaces that are guided onto each other: far from [`CONTACT`] for every kind of colour vision, and hatched in the picture.
pub const MATES: Color32 = Color32::from_rgb(56, 204, 166);

/// Sets everything.
pub fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| *style = style_of(style.clone()));
}

fn style_of(mut style: Style) -> Style {
    style.text_styles = [
        (TextStyle::Small, 11.5, FontFamily::Proportional),
        (TextStyle::Body, 13.5, FontFamily::Proportional),
        (TextStyle::Button, 13.5, FontFamily::Proportional),
        (TextStyle::Heading, 17.0, FontFamily::Proportional),
        (TextStyle::Monospace, 12.5, FontFamily::Monospace),
    ]
    .into_iter()
    .map(|(style, size, family)| (style, FontId::new(size, family)))
    .collect();
    let spacing = &mut style.spacing;
    spacing.item_spacing = Vec2::new(8.0, 6.0);
    spacing.button_padding = Vec2::new(10.0, 5.0);
    spacing.interact_size = Vec2::new(36.0, 26.0);
    spacing.indent = 14.0;
    spacing.slider_width = 132.0;
    spacing.slider_rail_height = 4.0;
    spacing.combo_width = 120.0;
    spacing.tooltip_width = 360.0;
    spacing.menu_margin = Margin::same(6);
    style.interaction.tooltip_delay = 0.35;
    style.interaction.selectable_labels = false;
    style.animation_time = 0.12;
    style.visuals = visuals();
    style
}

fn visuals() -> Visuals {
    let mut v = Visuals::dark();
    v.panel_fill = PANEL;
    v.window_fill = CARD;
    v.window_stroke = Stroke::new(1.0, LINE);
    v.window_corner_radius = CornerRadius::same(10);
    v.menu_corner_radius = CornerRadius::same(8);
    v.window_shadow = Shadow {
        offset: [0, 8],
        blur: 24,
        spread: 0,
        color: Color32::from_black_alpha(110),
    };
    v.popup_shadow = v.window_shadow;
    v.extreme_bg_color = GROUND;
    v.faint_bg_color = CARD;
    v.weak_text_color = Some(TEXT_WEAK);
    v.warn_fg_color = WARNING;
    v.error_fg_color = FAULT_TEXT;
    v.hyperlink_color = ACCENT;
    v.selection.bg_fill = ACCENT_DIM;
    v.selection.stroke = Stroke::new(1.0, TEXT_STRONG);
    v.slider_trailing_fill = true;
    v.handle_shape = egui::style::HandleShape::Circle;
    v.indent_has_left_vline = false;
    v.striped = false;
    v.disabled_alpha = 0.45;
    v.interact_cursor = None;
    let corner = CornerRadius::same(6);
    for (widget, fill, text) in [
        (&mut v.widgets.noninteractive, PANEL, TEXT),
        (&mut v.widgets.inactive, CONTROL, TEXT),
        (&mut v.widgets.hovered, CONTROL_HOVER, TEXT_STRONG),
        (&mut v.widgets.active, ACCENT_DIM, TEXT_STRONG),
        (&mut v.widgets.open, CONTROL_HOVER, TEXT_STRONG),
    ] {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::NONE;
        widget.fg_stroke = Stroke::new(1.0, text);
        widget.corner_radius = corner;
        widget.expansion = 0.0;
    }
    v.widgets.noninteractive.bg_stroke = Stroke::new(1.0, LINE);
    v
}

/// Frame of a side panel.
pub fn panel() -> egui::Frame {
    egui::Frame::NONE
        .fill(PANEL)
        .inner_margin(Margin::symmetric(14, 12))
}

/// Frame of a card over the picture.
pub fn card() -> egui::Frame {
    egui::Frame::NONE
        .fill(CARD.gamma_multiply(0.94))
        .stroke(Stroke::new(1.0, LINE))
        .corner_radius(10)
        .inner_margin(Margin::symmetric(14, 10))
}
