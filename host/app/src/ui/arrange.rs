//! Choice of the panels shown: all of them in a large window; in a smaller one a drawer beside the view, opened and closed by tabs; in a small one the view or one panel.
//! The bar with STOP and the state is above any of them.

use egui::{RichText, Ui, Vec2};

use super::theme;
use crate::session::workspace::Workspace;

/// Smallest window size at which every panel is shown, points.
const WIDE: Vec2 = Vec2::new(1200.0, 560.0);
/// Smallest window width at which a drawer has space beside the view, points.
const BESIDE: f32 = 620.0;
/// Smallest width of the drawer, points.
const BESIDE_WIDTH: f32 = 300.0;

/// Arrangement of the panels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrangement {
    /// All panels around the view.
    Wide,
    /// The view, and a drawer of this width (points) beside it.
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

/// What a tab shows where not all panels are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tab {
    /// The middle of the workspace alone.
    Middle,
    /// The rig, hand, guidance and parameters.
    Rig,
    /// The parts, or the runs that are analysed.
    Left,
    /// The messages.
    Messages,
    /// The traces.
    Plots,
}

impl Tab {
    const ALL: [Self; 5] = [Self::Middle, Self::Rig, Self::Left, Self::Messages, Self::Plots];

    fn name(self, workspace: Workspace) -> &'static str {
        match (self, workspace) {
            (Self::Middle, Workspace::Rig) => "Set-up",
            (Self::Middle, _) => "View",
            (Self::Rig, _) => "Rig",
            (Self::Left, Workspace::Analyse) => "Runs",
            (Self::Left, _) => "Parts",
            (Self::Messages, _) => "Messages",
            (Self::Plots, _) => "Plots",
        }
    }
}

/// The tab that is chosen.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tabs {
    /// `None`: none was chosen yet.
    chosen: Option<Tab>,
}

impl Tabs {
    /// The chosen tab. At the start, a drawer has the rig.
    pub fn chosen(self, arrangement: Arrangement) -> Tab {
        self.chosen.unwrap_or(match arrangement {
            Arrangement::Beside(_) => Tab::Rig,
            Arrangement::Wide | Arrangement::Single => Tab::Middle,
        })
    }

    /// Draws the tabs. A click opens what the tab shows; one on the open drawer's tab closes it.
    pub fn show(&mut self, ui: &mut Ui, arrangement: Arrangement, workspace: Workspace) {
        let chosen = self.chosen(arrangement);
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = Vec2::new(2.0, 2.0);
            ui.spacing_mut().button_padding = Vec2::new(7.0, 2.0);
            for tab in Tab::ALL {
                let name = tab.name(workspace);
                let text = RichText::new(name).size(12.5).color(theme::of(ui).text_strong);
                let button = egui::Button::selectable(chosen == tab, text);
                // The accessible names differ from the headings of the panels.
                let named = format!("Show {name}");
                if ui.add(button).accessible_name(named).clicked() {
                    let closes = chosen == tab && matches!(arrangement, Arrangement::Beside(_));
                    self.chosen = Some(if closes { Tab::Middle } else { tab });
                }
            }
        });
    }
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
        assert_eq!(Tabs::default().chosen(Arrangement::Beside(300.0)), Tab::Rig);
        assert_eq!(Tabs::default().chosen(Arrangement::Single), Tab::Middle);
    }
}
