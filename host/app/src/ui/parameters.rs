//! The board's adjustable parameters as sliders and lists, with unit and range.

use egui::{ComboBox, RichText, Slider, Ui, Vec2};
use mortise_bake::Method;
use mortise_protocol::parameter::{PARAMETERS, Parameter, ParameterId};

use super::{control, margin, theme};
use crate::session::number::number;
use crate::session::{Intent, Session, obstacle};

/// First word of the parameters that the section on guidance shows instead.
pub const GUIDANCE: &str = "Guidance";

/// Whether the section on guidance shows a parameter instead.
fn is_of_guidance(row: &Parameter) -> bool {
    row.name.starts_with(GUIDANCE) || row.id == ParameterId::GeometricForce
}

/// First word of the parameters of the coupling, below which its stability margin is drawn.
const COUPLING: &str = "Coupling";

/// First word of the parameters that say how far the handle reaches.
const POSITION: &str = "Position";

/// First word of the parameters' names in a group, and the group's heading.
const GROUPS: [(&str, &str); 6] = [
    ("Integrator", "Method"),
    (COUPLING, "Coupling of handle and part"),
    (POSITION, "Reach of the handle"),
    ("Contact", "Contact"),
    ("Object", "Held part"),
    ("", "Limits"),
];

/// Draws the parameters.
pub fn show(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    ui.horizontal(|ui| {
        control::section(ui, "Parameters");
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let changed = PARAMETERS
                .iter()
                .any(|row| session.parameters[row.id as usize] != row.default);
            if changed {
                let button = egui::Button::new(RichText::new("Defaults").small());
                let hint = "Reset every parameter to its value at start";
                control::intent_button(ui, session, wanted, button, Intent::ResetParameters, hint);
            }
        });
    });
    for (index, (word, heading)) in GROUPS.iter().enumerate() {
        let earlier = &GROUPS[..index];
        let mut rows = PARAMETERS
            .iter()
            .filter(|row| row.name.starts_with(word) && !earlier.iter().any(|(w, _)| row.name.starts_with(w)))
            .filter(|row| !is_of_guidance(row))
            .peekable();
        if rows.peek().is_none() {
            continue;
        }
        let open = session
            .preferences
            .open
            .get(*heading)
            .copied()
            .unwrap_or(index < 4);
        let section = egui::CollapsingHeader::new(*heading)
            .default_open(open)
            .show_unindented(ui, |ui| {
                if index == 0 {
                    method(ui, session, wanted);
                }
                for row in rows {
                    one(ui, session, wanted, row);
                }
                if *word == COUPLING {
                    margin::show(ui, session, wanted);
                }
                if *word == POSITION
                    && let Some(effect) = session.position_scale_in_words()
                {
                    ui.label(RichText::new(effect).small().color(theme::of(ui).text));
                }
                ui.add_space(4.0);
            });
        if section.header_response.clicked() {
            wanted.push(Intent::Fold {
                section: heading,
                open: !open,
            });
        }
    }
}

/// Draws the choice of the contact method; a change bakes the collision model again.
fn method(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>) {
    let reason = obstacle(session, &Intent::ChooseMethod(session.method));
    let hover = "Distance field: exact to micrometres.\nOccupancy: the textbook's two bits a voxel, off by up to a voxel.\nA change bakes the collision model again.";
    let names = Method::ALL.map(Method::name);
    let known = Method::ALL.iter().position(|&m| m == session.method).unwrap_or(0);
    if let Some(chosen) = combo(ui, "Contact by", &names, known, hover, reason) {
        wanted.push(Intent::ChooseMethod(Method::ALL[chosen]));
    }
}

/// Draws one parameter as a slider or a list.
pub fn one(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, row: &Parameter) {
    if row.choices.is_empty() {
        slider(ui, session, wanted, row);
    } else {
        choice(ui, session, wanted, row);
    }
}

/// Draws a parameter whose values are named choices.
pub fn choice(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, row: &Parameter) {
    let known = session.parameters[row.id as usize].round() as usize;
    let reason = obstacle(session, &Intent::SetParameter(row.id, row.default));
    if let Some(chosen) = combo(
        ui,
        &words(row.name),
        row.choices,
        known,
        row.description.trim(),
        reason,
    ) {
        wanted.push(Intent::SetParameter(row.id, chosen as f32));
    }
}

/// A list to choose from, disabled with a `reason`; returns the index of a new choice.
pub fn combo(
    ui: &mut Ui,
    name: &str,
    names: &[&str],
    known: usize,
    hover: &str,
    reason: Option<String>,
) -> Option<usize> {
    let mut chosen = known;
    let hint = match &reason {
        Some(reason) => format!("{hover}\n{reason}"),
        None => hover.to_owned(),
    };
    ui.add_enabled_ui(reason.is_none(), |ui| {
        ui.horizontal(|ui| {
            let label = ui.label(RichText::new(name).small().color(theme::of(ui).text_weak));
            let list = ComboBox::from_id_salt(name)
                .selected_text(names.get(known).copied().unwrap_or_default())
                .show_index(ui, &mut chosen, names.len(), |i| names[i].to_owned());
            list.labelled_by(label.id);
        });
    })
    .response
    .on_hover_text(hint);
    (chosen != known).then_some(chosen)
}

fn slider(ui: &mut Ui, session: &Session, wanted: &mut Vec<Intent>, row: &Parameter) {
    let known = session.parameters[row.id as usize];
    let mut value = known;
    let reason = obstacle(session, &Intent::SetParameter(row.id, value));
    let hover = format!(
        "{}\n{} to {} {}, at start {}",
        row.description.trim(),
        number(row.min.into()),
        number(row.max.into()),
        row.unit,
        number(row.default.into())
    );
    let name = words(row.name);
    ui.spacing_mut().item_spacing.y = 1.0;
    let label = ui.horizontal(|ui| {
        let color = if known == row.default {
            theme::of(ui).text_weak
        } else {
            theme::of(ui).text_strong
        };
        let label = ui.label(RichText::new(&name).small().color(color));
        label.on_hover_text(&hover)
    });
    let wide = ui.available_width();
    ui.spacing_mut().slider_width = (wide - 122.0).max(80.0);
    ui.spacing_mut().interact_size = Vec2::new(104.0, 22.0);
    let slider = Slider::new(&mut value, row.min..=row.max)
        // Ranges over more than two decades (factor 150) have a logarithmic slider.
        .logarithmic(row.min > 0.0 && row.max / row.min > 150.0)
        .suffix(format!(" {}", row.unit))
        .custom_formatter(|value, _| number(value));
    let response = ui
        .add_enabled(reason.is_none(), slider)
        .labelled_by(label.inner.id);
    if response.changed() && value != known {
        wanted.push(Intent::SetParameter(row.id, value));
    }
    match reason {
        Some(reason) => response.on_disabled_hover_text(format!("{hover}\n{reason}")),
        None => response.on_hover_text(hover),
    };
    ui.add_space(5.0);
}

/// Words of a parameter's name: `CouplingAngularDamping` becomes `Coupling angular damping`.
pub fn words(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !text.is_empty() {
            text.push(' ');
            text.extend(c.to_lowercase());
        } else {
            text.push(c);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::{Duration, Instant};

    use super::*;
    use egui_kittest::Harness;
    use egui_kittest::kittest::{NodeT as _, Queryable as _};

    /// A session with a simulated rig, so that parameters can be changed.
    fn connected() -> Session {
        let mut session = Session::new(Arc::new(|| {}));
        session.act(Intent::Connect);
        let begun = Instant::now();
        while session.connection().is_none() {
            assert!(begun.elapsed() < Duration::from_secs(60), "no simulated rig");
            std::thread::sleep(Duration::from_millis(5));
            session.poll();
        }
        session
    }

    /// All texts of the window for a parameter with this row, its tooltip's included.
    fn texts(session: &Session, row: &Parameter) -> Vec<String> {
        let mut harness = Harness::builder()
            .with_size(Vec2::new(500.0, 400.0))
            .build_ui(|ui| {
                ui.style_mut().interaction.tooltip_delay = 0.0;
                one(ui, session, &mut Vec::new(), row);
            });
        harness
            .get_all_by_label(&words(row.name))
            .next()
            .expect("its name")
            .hover();
        harness.run_steps(4);
        let root = harness.root();
        let nodes = root.children_recursive().map(|node| {
            let node = node.accesskit_node();
            [node.label(), node.value()]
        });
        nodes.flatten().flatten().collect()
    }

    /// What [`texts`] must have for a row.
    fn expected(row: &Parameter) -> Vec<String> {
        let range = format!(
            "{}\n{} to {} {}, at start {}",
            row.description.trim(),
            number(row.min.into()),
            number(row.max.into()),
            row.unit,
            number(row.default.into())
        );
        vec![words(row.name), range]
    }

    #[test]
    fn the_window_says_of_a_parameter_what_its_row_says() {
        let session = connected();
        let known = ParameterId::ForceLimit.row();
        let changed = [
            Parameter {
                name: "ForceBound",
                ..*known
            },
            Parameter {
                description: " Another meaning.",
                ..*known
            },
            Parameter {
                unit: "lbf",
                ..*known
            },
            Parameter { min: 3.0, ..*known },
            Parameter { max: 77.0, ..*known },
            Parameter {
                default: 4.0,
                ..*known
            },
        ];
        let quantities = PARAMETERS.iter().filter(|row| row.choices.is_empty());
        for row in quantities.chain(&changed) {
            let found = texts(&session, row);
            for text in expected(row) {
                assert!(found.contains(&text), "{text:?} is not in {found:?}");
            }
        }
        // Each change is seen: the window has none of the unchanged row's texts that differ.
        for row in &changed {
            assert_ne!(expected(row), expected(known));
        }
    }

    #[test]
    fn a_choice_is_shown_by_its_name() {
        let session = connected();
        for row in PARAMETERS.iter().filter(|row| !row.choices.is_empty()) {
            let found = texts(&session, row);
            let chosen = row.choice(row.default).expect("a choice");
            assert!(
                found.iter().any(|text| text == chosen),
                "{chosen} is not in {found:?}"
            );
        }
    }

    #[test]
    fn names_read_as_words() {
        assert_eq!(words("CouplingAngularDamping"), "Coupling angular damping");
        assert_eq!(words("ForceLimit"), "Force limit");
    }

    #[test]
    fn every_parameter_has_a_group() {
        assert_eq!(
            GROUPS.last().map(|g| g.0),
            Some(""),
            "the last group takes the remaining parameters"
        );
    }
}
