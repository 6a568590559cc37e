//! Choice of the panels shown: all of them in a large window, one at a time with tabs in a small one. The bar with STOP and the state is
//! above either.

use egui::{RichText, Ui, Vec2};

use super::theme;

/// Smallest window size at which every panel is shown, points.
const WIDE: Vec2 = Vec2::new(980.0, 560.0);
/// Smallest window width at which one panel stands beside the view, points.
const BESIDE: f32 = 620.0;
/// Width of that panel, points.
const BESIDE_WIDTH: f32 = 300.0;

/// Arrangement of the panels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrangement {
    /// All panels around the view.
    Wide,
    /// The view, and one panel of this width (points) beside it.
    Beside(f32),
    /// The view or one panel.
    Single,
}

impl Arrangement {
    /// Arrangement for a window of `size` points.
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

    /// The tab shown under `arrangement`: beside the view, the view itself needs no tab.
    pub fn under(self, arrangement: Arrangement) -> Self {
        match (arrangement, self) {
            (Arrangement::Beside(_), Self::View) => Self::Rig,
            _ => self,
        }
    }
}

/// Draws the tabs; a click changes `chosen`.
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
            // The accessible names differ from the headings of the panels.
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
