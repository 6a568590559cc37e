//! Help on keys and the pointer (F1): every key of the window, in the words of the page `docs/getting-started.md`.

use egui::{Grid, Key, Modifiers, RichText, ScrollArea, Ui};

use super::{control, theme};

/// A group of keys: its name, and each key with what it does.
pub type Group = (&'static str, &'static [(&'static str, &'static str)]);

/// Every key and pointer action.
pub const KEYS: &[Group] = &[
    ("Motors", &[("Space, Esc", "STOP: motors off, now")]),
    (
        "Window",
        &[
            ("Ctrl+O", "open a file"),
            ("Ctrl+K", "open and close the command line"),
            ("F1", "show and hide this list"),
        ],
    ),
    (
        "View",
        &[
            ("Drag", "orbit about the point under the pointer"),
            ("Shift+drag, middle button", "pan"),
            ("Wheel", "zoom to the pointer"),
            ("F", "see everything"),
            (
                "1, 3, 7",
                "from the front, right, top; with Ctrl from the opposite side",
            ),
            ("0", "from the front, right and above"),
            ("5", "orthographic and perspective"),
            ("X", "section on and off"),
        ],
    ),
    (
        "Parts",
        &[
            ("Click", "select the part"),
            (
                "Ctrl+click, Shift+click",
                "select it too; select all up to there in the list",
            ),
            ("Ctrl+G", "group the selected parts"),
            ("Ctrl+Shift+G", "take the group of the selected part apart"),
            (
                "Double click",
                "grab the part, or frame it while it cannot be grabbed",
            ),
            ("H", "hide the selected parts, and show them again"),
            ("I", "show the selected parts alone"),
            ("Shift+H", "show all parts"),
            (
                "C, held",
                "clutch: the held part stays where it is while the handle moves",
            ),
        ],
    ),
    (
        "Measuring",
        &[
            ("D", "begin and end measuring"),
            ("Click", "measure the vertex, edge, axis or face there"),
            ("Backspace", "clear the measurement"),
            (
                "Esc",
                "clear the measurement, then end measuring; with a rig connected it is STOP alone",
            ),
        ],
    ),
    (
        "Moving the selected part",
        &[
            ("Ctrl+Z", "undo the last move"),
            ("Ctrl+Shift+Z, Ctrl+Y", "redo the move undone last"),
            (
                "Arrows, Page Up, Page Down",
                "move by 1 mm; with Shift by 0.1 mm, with Ctrl by 10 mm",
            ),
            ("Alt with these", "turn by 5°; with Shift by 0.5°"),
            (
                "Drag a handle",
                "move along an arrow, in a square's plane, in the view; turn by a ring",
            ),
            (
                "Ctrl while dragging it",
                "steps of 1 mm and 5°; with Shift of 0.1 mm and 0.5°",
            ),
            (
                "Esc while dragging it",
                "take it back; with a rig connected it is STOP too",
            ),
        ],
    ),
    (
        "Fits",
        &[
            ("M", "find fits of the selected part"),
            ("N", "next fit"),
            ("T", "the part the other way round"),
            ("G", "guide the held part along the way into the fit"),
            ("P", "place the part in the fit"),
        ],
    ),
    (
        "SpaceMouse",
        &[
            (
                "Cap",
                "move the view, or the part: the selected one, or the one that a simulated hand holds",
            ),
            ("Left button", "switch between view and part"),
            ("Right button", "see everything"),
        ],
    ),
    (
        "Simulated hand",
        &[
            ("Drag the held part", "move the hand"),
            ("Ctrl while dragging it", "turn the hand"),
        ],
    ),
];

/// State of the help.
#[derive(Debug, Default)]
pub struct Help {
    /// Whether it is shown.
    pub open: bool,
}

impl Help {
    /// Takes F1, and Esc while the help is shown and no rig is connected.
    pub fn keys(&mut self, ui: &Ui) {
        if ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::F1)) {
            self.open = !self.open;
        }
        self.open &= !(self.open && ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)));
    }

    /// Draws the help over the window, below the bar at the top, which ends at `top`.
    pub fn show(&mut self, ui: &Ui, top: f32) {
        let screen = ui.ctx().content_rect();
        egui::Window::new("Keys")
            .open(&mut self.open)
            .collapsible(false)
            .resizable(false)
            .constrain_to(egui::Rect::from_min_max(
                egui::pos2(screen.left(), top),
                screen.max,
            ))
            .default_pos(egui::pos2(screen.center().x - 220.0, top + 20.0))
            .show(ui.ctx(), |ui| {
                let high = (screen.bottom() - top - 90.0).max(60.0);
                ScrollArea::vertical().max_height(high).show(ui, groups);
            });
    }
}

fn groups(ui: &mut Ui) {
    for (name, keys) in KEYS {
        control::section(ui, name);
        Grid::new(*name)
            .num_columns(2)
            .min_col_width(150.0)
            .spacing([14.0, 3.0])
            .show(ui, |ui| {
                for (key, what) in *keys {
                    ui.label(RichText::new(*key).color(theme::of(ui).text_strong));
                    ui.label(*what);
                    ui.end_row();
                }
            });
        ui.add_space(8.0);
    }
}
