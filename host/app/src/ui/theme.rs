//! Colours, type and spacing: restrained, with one accent; red is reserved for STOP and faults, orange for the held part and contact.
//!
//! Dark or light according to the system; [`of`] returns the colours of the theme that a [`Ui`] is drawn in.

use egui::{
    Color32, CornerRadius, FontFamily, FontId, Margin, Shadow, Stroke, Style, TextStyle, Theme,
    ThemePreference, Ui, Vec2, Visuals,
};

/// STOP, in both themes; its text is white.
pub const STOP: Color32 = Color32::from_rgb(214, 48, 49);
/// STOP under the pointer, and the mark of a fault.
pub const STOP_HOVER: Color32 = Color32::from_rgb(235, 70, 68);

/// Time in which controls change, s; 0 where the desktop asks for less motion. The view then jumps instead of gliding.
pub const ANIMATION_S: f32 = 0.12;

/// The colours of one theme.
#[derive(Debug)]
pub struct Palette {
    /// Window background.
    pub ground: Color32,
    /// Panels.
    pub panel: Color32,
    /// Cards on panels.
    pub card: Color32,
    /// Dividing lines.
    pub line: Color32,
    /// Controls at rest.
    pub control: Color32,
    /// Controls under the pointer.
    pub control_hover: Color32,
    /// Text.
    pub text: Color32,
    /// Emphasised text.
    pub text_strong: Color32,
    /// Explanatory text.
    pub text_weak: Color32,
    /// The accent.
    pub accent: Color32,
    /// The accent as a background of text.
    pub accent_dim: Color32,
    /// The held part, and contact.
    pub held: Color32,
    /// Normal state.
    pub good: Color32,
    /// Warnings.
    pub warning: Color32,
    /// Text about faults.
    pub fault_text: Color32,
    /// Contact forces, in plots and as arrows.
    pub contact: Color32,
    /// Surfaces guided onto each other: distinguishable from `contact` for every kind of colour vision, and hatched in the view.
    pub mates: Color32,
    /// The x, y and z axes of a part's handles.
    pub axes: [Color32; 3],
}

const DARK: Palette = Palette {
    ground: Color32::from_rgb(19, 21, 25),
    panel: Color32::from_rgb(27, 30, 36),
    card: Color32::from_rgb(34, 38, 45),
    line: Color32::from_rgb(48, 53, 62),
    control: Color32::from_rgb(50, 56, 66),
    control_hover: Color32::from_rgb(64, 72, 84),
    text: Color32::from_rgb(214, 219, 226),
    text_strong: Color32::from_rgb(244, 247, 250),
    text_weak: Color32::from_rgb(146, 154, 166),
    accent: Color32::from_rgb(92, 164, 245),
    accent_dim: Color32::from_rgb(38, 82, 132),
    held: Color32::from_rgb(245, 166, 66),
    good: Color32::from_rgb(104, 200, 132),
    warning: Color32::from_rgb(240, 196, 88),
    fault_text: Color32::from_rgb(255, 122, 112),
    contact: Color32::from_rgb(255, 112, 72),
    mates: Color32::from_rgb(56, 204, 166),
    axes: [
        Color32::from_rgb(236, 104, 98),
        Color32::from_rgb(120, 196, 108),
        Color32::from_rgb(112, 162, 245),
    ],
};

const LIGHT: Palette = Palette {
    ground: Color32::from_rgb(229, 233, 239),
    panel: Color32::from_rgb(245, 246, 248),
    card: Color32::from_rgb(255, 255, 255),
    line: Color32::from_rgb(206, 212, 220),
    control: Color32::from_rgb(222, 227, 234),
    control_hover: Color32::from_rgb(206, 213, 223),
    text: Color32::from_rgb(44, 50, 60),
    text_strong: Color32::from_rgb(14, 18, 24),
    text_weak: Color32::from_rgb(86, 95, 108),
    accent: Color32::from_rgb(20, 94, 190),
    accent_dim: Color32::from_rgb(166, 203, 245),
    held: Color32::from_rgb(158, 84, 0),
    good: Color32::from_rgb(16, 116, 54),
    warning: Color32::from_rgb(134, 88, 0),
    fault_text: Color32::from_rgb(176, 26, 22),
    contact: Color32::from_rgb(190, 58, 16),
    mates: Color32::from_rgb(0, 116, 90),
    axes: [
        Color32::from_rgb(176, 32, 30),
        Color32::from_rgb(18, 104, 40),
        Color32::from_rgb(22, 78, 186),
    ],
};

/// Colours of a theme.
pub const fn palette(theme: Theme) -> &'static Palette {
    match theme {
        Theme::Dark => &DARK,
        Theme::Light => &LIGHT,
    }
}

/// Colours of the theme `ui` is drawn in.
pub fn of(ui: &Ui) -> &'static Palette {
    palette(Theme::from_dark_mode(ui.visuals().dark_mode))
}

/// Applies style and colours. The theme follows the system and is dark until the system reports one.
pub fn apply(ctx: &egui::Context) {
    ctx.options_mut(|options| {
        options.theme_preference = ThemePreference::System;
        options.fallback_theme = Theme::Dark;
    });
    for theme in [Theme::Dark, Theme::Light] {
        ctx.style_mut_of(theme, |style| *style = style_of(style.clone(), theme));
    }
}

fn style_of(mut style: Style, theme: Theme) -> Style {
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
    style.animation_time = ANIMATION_S;
    style.visuals = visuals(theme);
    style
}

fn visuals(theme: Theme) -> Visuals {
    let p = palette(theme);
    let mut v = theme.default_visuals();
    v.panel_fill = p.panel;
    v.window_fill = p.card;
    v.window_stroke = Stroke::new(1.0, p.line);
    v.window_corner_radius = CornerRadius::same(10);
    v.menu_corner_radius = CornerRadius::same(8);
    v.window_shadow = Shadow {
        offset: [0, 8],
        blur: 24,
        spread: 0,
        color: Color32::from_black_alpha(if theme == Theme::Dark { 110 } else { 50 }),
    };
    v.popup_shadow = v.window_shadow;
    v.extreme_bg_color = p.ground;
    v.faint_bg_color = p.card;
    v.weak_text_color = Some(p.text_weak);
    v.warn_fg_color = p.warning;
    v.error_fg_color = p.fault_text;
    v.hyperlink_color = p.accent;
    v.selection.bg_fill = p.accent_dim;
    v.selection.stroke = Stroke::new(1.0, p.text_strong);
    v.slider_trailing_fill = true;
    v.handle_shape = egui::style::HandleShape::Circle;
    v.indent_has_left_vline = false;
    v.striped = false;
    v.disabled_alpha = 0.45;
    v.interact_cursor = None;
    let corner = CornerRadius::same(6);
    for (widget, fill, text) in [
        (&mut v.widgets.noninteractive, p.panel, p.text),
        (&mut v.widgets.inactive, p.control, p.text),
        (&mut v.widgets.hovered, p.control_hover, p.text_strong),
        (&mut v.widgets.active, p.accent_dim, p.text_strong),
        (&mut v.widgets.open, p.control_hover, p.text_strong),
    ] {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::NONE;
        widget.fg_stroke = Stroke::new(1.0, text);
        widget.corner_radius = corner;
        widget.expansion = 0.0;
    }
    v.widgets.noninteractive.bg_stroke = Stroke::new(1.0, p.line);
    v
}

/// Frame of a side panel. It fills nothing, which a software renderer would pay for in every pixel: the window is cleared to [`Palette::panel`].
pub fn panel() -> egui::Frame {
    egui::Frame::NONE.inner_margin(Margin::symmetric(14, 12))
}

/// Frame of a card over the view.
pub fn card(palette: &Palette) -> egui::Frame {
    egui::Frame::NONE
        .fill(palette.card.gamma_multiply(0.94))
        .stroke(Stroke::new(1.0, palette.line))
        .corner_radius(10)
        .inner_margin(Margin::symmetric(14, 10))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance according to WCAG 2: weighted sum of linear sRGB.
    fn luminance(color: Color32) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        };
        0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
    }

    fn contrast(a: Color32, b: Color32) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    /// Where the window library does not know it, what [`super::super::appearance`] found counts.
    #[test]
    fn the_theme_is_the_systems() {
        let ctx = egui::Context::default();
        apply(&ctx);
        let shown = |system_theme| {
            let input = egui::RawInput {
                system_theme,
                ..Default::default()
            };
            ctx.run_ui(input, |_| {}).textures_delta.clear();
            ctx.theme()
        };
        assert_eq!(shown(None), Theme::Dark);
        assert_eq!(shown(Some(Theme::Light)), Theme::Light);
        assert_eq!(shown(Some(Theme::Dark)), Theme::Dark);
        ctx.options_mut(|options| options.fallback_theme = Theme::Light);
        assert_eq!(shown(None), Theme::Light);
    }

    /// WCAG 2 requires 4.5 for text of this size and 3 for large text: STOP is 21 points.
    #[test]
    fn text_can_be_read_in_both_themes() {
        for (name, p) in [("dark", &DARK), ("light", &LIGHT)] {
            for (what, ink) in [
                ("text", p.text),
                ("strong", p.text_strong),
                ("weak", p.text_weak),
                ("held", p.held),
                ("good", p.good),
                ("warning", p.warning),
                ("fault", p.fault_text),
                ("contact", p.contact),
                ("mates", p.mates),
                ("x", p.axes[0]),
                ("y", p.axes[1]),
                ("z", p.axes[2]),
            ] {
                for (on, fill) in [("panel", p.panel), ("card", p.card), ("ground", p.ground)] {
                    let ratio = contrast(ink, fill);
                    assert!(ratio >= 4.5, "{name}: {what} on {on}: {ratio:.2}");
                }
            }
            for fill in [p.control, p.control_hover, p.accent_dim] {
                assert!(contrast(p.text_strong, fill) >= 4.5, "{name}: text on a control");
            }
        }
        assert!(contrast(Color32::WHITE, STOP) >= 3.0);
    }
}
