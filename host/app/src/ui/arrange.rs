//! Which panels are shown: all of them where there is room, one at a time with tabs where there is not. The bar with STOP and the state is
//! above either.

use egui::{RichText, Ui, Vec2};

use super::theme;

/// From here on every panel is shown, points.
const WIDE: Vec2 = Vec2::new(980.0, 560.0);
/// From here on one panel stands beside the view, points.
const BESIDE: f32 = 620.0;
/// Width of that panel, points.
const BESIDE_WIDTH: f32 = 300.0;

/// How panels are arranged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrangement {
    /// All panels about the view.
    Wide,
    /// The view, and one panel of this width beside it.
    Beside(f32),
    /// The view or one panel.
    Single,
}

impl Arrangement {
    /// For a window of `size` points.
    pub fn of(size: Vec2) -> Self {
        if size.x >= WIDE.x && size.y >= WIDE.y {
            Self::Wide
        } else if size.x >= BESIDE {
            Self::Beside(BESIDE_WIDTH.max(0.32 * size.x))
        } else {
            Self::Single
        }
    }
}

/// A panel that can be chosen where not all are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// The 3D view.
    #[default]
    View,
    /// The rig, hand, guidance and parameters.
    Rig,
    /// The parts.
    Parts,
    /// The messages.
    Messages,
    /// The traces.
    Plots,
}

impl Tab {
    fn name(self) -> &'static str {
        match self {
            Self::View => "View",
            Self::Rig => "Rig",
            Self::Parts => "Parts",
            Self::Messages => "Messages",
            Self::Plots => "Plots",
        }
    }

    /// The tab in force under `arrangement`: beside the view, the view needs none.
    pub fn under(self, arrangement: Arrangement) -> Self {
        match (arrangement, self) {
            (Arrangement::Beside(_), Self::View) => Self::Rig,
            _ => self,
        }
    }
}

/// The tabs; changes `chosen`.
pub fn tabs(ui: &mut Ui, arrangement: Arrangement, chosen: &mut Tab) {
    let all = [Tab::View, Tab::Rig, Tab::Parts, Tab::Messages, Tab::Plots];
    let first = usize::from(matches!(arrangement, Arrangement::Beside(_)));
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = Vec2::new(2.0, 2.0);
        ui.spacing_mut().button_padding = Vec2::new(7.0, 2.0);
        for tab in all.into_iter().skip(first) {
            let text = RichText::new(tab.name())
                .size(12.5)
                .color(theme::of(ui).text_strong);
            let button = egui::Button::selectable(*chosen == tab, text);
            // Named apart from the headings of what they show.
            let named = format!("Show {}", tab.name());
            if ui.add(button).accessible_name(named).clicked() {
                *chosen = tab;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_window_shows_all_and_a_small_one_some() {
        assert_eq!(Arrangement::of(Vec2::new(1520.0, 940.0)), Arrangement::Wide);
        assert_eq!(
            Arrangement::of(Vec2::new(800.0, 500.0)),
            Arrangement::Beside(300.0)
        );
        assert_eq!(Arrangement::of(Vec2::new(266.0, 200.0)), Arrangement::Single);
        assert_eq!(Tab::View.under(Arrangement::Beside(300.0)), Tab::Rig);
        assert_eq!(Tab::View.under(Arrangement::Single), Tab::View);
    }
}
