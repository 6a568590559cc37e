//! Parameters that the user sets: on the board at once, and on the same rig again when it is connected later.

use mortise_protocol::parameter::{PARAMETERS, Parameter, ParameterId};
use mortise_protocol::rig::Rig;
use mortise_rig::RigSpec;

use super::link::Link;
use super::margin::Subject;
use super::notes::Severity;
use super::state::Session;
use super::tap::GuidanceCommand;

impl Session {
    /// Name of the rig whose parameters are set now: of the connected one, else of the chosen one. All that simulate are one rig; a board with motors is
    /// named by its port, so that what was tried in a simulation never reaches motors by itself.
    pub(super) fn rig_of_parameters(&self) -> String {
        let rig = match &self.link {
            Link::Connecting { spec, .. } => spec,
            Link::Connected(connection) => &connection.spec,
            Link::None => &self.chosen,
        };
        match rig {
            RigSpec::Serial { port } => port.clone(),
            RigSpec::Simulated { .. } | RigSpec::Emulated { .. } => "simulated".to_owned(),
        }
    }

    /// The rig whose limits of stiffness and damping are shown: the connected one, else the one that the description describes, as a board with motors
    /// would have it, else the simulated one.
    ///
    /// # Errors
    /// Why the connected one is not known, as a sentence.
    pub fn limited_rig(&self) -> Result<Subject, &'static str> {
        let described = |rig: &Rig, real: bool| Subject::Described {
            rig: Box::new(rig.clone()),
            real,
        };
        let page = &self.rig_page;
        let Some(connection) = self.connection() else {
            return Ok(match page.checked() {
                Some(Ok(checked)) => described(&checked.rig, true),
                _ => Subject::Simulated,
            });
        };
        let can = &connection.capabilities;
        match &page.on_board {
            Some((Some(rig), true)) => Ok(described(rig, !can.simulated)),
            // No described mechanism has motors that turn the handle.
            _ if can.simulated && can.torque_axes > 0 => Ok(Subject::Simulated),
            None => Err("The description that the board uses is not known yet: read it"),
            Some(_) => Err("The board uses no description: send it one in Set up rig"),
        }
    }

    pub(super) fn set_parameter(&mut self, id: ParameterId, value: f32) {
        let row = id.row();
        let value = if value.is_finite() {
            value.clamp(row.min, row.max)
        } else {
            row.default
        };
        if let Some(known) = self.parameters.get_mut(id as usize) {
            *known = value;
        }
        let rig = self.rig_of_parameters();
        self.own_parameters
            .entry(rig)
            .or_default()
            .insert(id as usize, value);
        if let Some(connection) = self.connection_mut() {
            connection.set_parameter(id, value);
        }
        if id == ParameterId::Guidance {
            self.guide.sending = self.guides();
            self.command_guidance(GuidanceCommand::Set(self.guide));
        }
    }

    /// Sends the parameters that the user has set on this rig to its board when that has others, and says which; says also which stay with another rig.
    pub(super) fn send_own_parameters(&mut self) {
        let rig = self.rig_of_parameters();
        let elsewhere = |row: &&Parameter| {
            let others = self.own_parameters.iter().filter(|(other, _)| **other != rig);
            others
                .flat_map(|(_, own)| own.get(&(row.id as usize)))
                .any(|value| *value != row.default)
        };
        let own = self.own_parameters.get(&rig);
        let stay: Vec<&str> = (PARAMETERS.iter())
            .filter(|row| own.is_none_or(|own| !own.contains_key(&(row.id as usize))))
            .filter(elsewhere)
            .map(|row| row.name)
            .collect();
        let differs = |id: ParameterId| {
            let own = own?.get(&(id as usize)).copied();
            own.filter(|own| self.parameters[id as usize] != *own)
        };
        let sent: Vec<(&str, ParameterId, f32)> = (PARAMETERS.iter())
            .filter_map(|row| Some((row.name, row.id, differs(row.id)?)))
            .collect();
        if !stay.is_empty() {
            let text = format!(
                "Set on another rig, and not sent to this one: {}",
                stay.join(", ")
            );
            self.notes.add(Severity::Info, text);
        }
        if sent.is_empty() {
            return;
        }
        let names: Vec<&str> = sent.iter().map(|(name, ..)| *name).collect();
        let text = format!("Set on the board as before: {}", names.join(", "));
        self.notes.add(Severity::Info, text);
        for (_, id, value) in sent {
            self.set_parameter(id, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(session: &Session) -> Vec<&str> {
        session.notes.iter().map(|note| note.text.as_str()).collect()
    }

    /// Without a rig the limits are those of the description that is edited, as long as it is sound.
    #[test]
    fn limits_are_those_of_the_description_or_of_the_simulated_handle() {
        let mut session = Session::new(std::sync::Arc::new(|| {}));
        assert_eq!(session.limited_rig(), Ok(Subject::Simulated));
        let (name, text) = mortise_rig::EXAMPLES[0];
        session.rig_page.edit(text.to_owned());
        let Ok(Subject::Described { rig, real: true }) = session.limited_rig() else {
            panic!("the described one")
        };
        assert_eq!(rig.name.as_str(), name);
        session.rig_page.edit(text.replace("radius_mm", "radius"));
        assert_eq!(session.limited_rig(), Ok(Subject::Simulated));
    }

    /// A value that the simulated hand bears may shake a motor.
    #[test]
    fn what_was_set_in_a_simulation_stays_there() {
        let mut session = Session::new(std::sync::Arc::new(|| {}));
        let id = ParameterId::CouplingDamping;
        let default = id.row().default;
        session.set_parameter(id, 35.0);
        let board = |port: &str| RigSpec::Serial {
            port: port.to_owned(),
        };
        for (rig, expected) in [
            (board("/dev/ttyACM0"), default),
            ("emulated".parse().expect("a rig"), 35.0),
            (board("/dev/ttyACM0"), default),
        ] {
            session.chosen = rig;
            // As a board answers that has just started.
            session.parameters[id as usize] = default;
            session.send_own_parameters();
            assert_eq!(session.parameters[id as usize], expected);
        }
        assert!(said(&session).iter().any(|text| text.starts_with("Set on another rig, and not sent to this one: CouplingDamping")));
        // Each board has its own.
        session.set_parameter(id, 12.0);
        for (rig, expected) in [(board("/dev/ttyACM1"), default), (board("/dev/ttyACM0"), 12.0)] {
            session.chosen = rig;
            session.parameters[id as usize] = default;
            session.send_own_parameters();
            assert_eq!(session.parameters[id as usize], expected);
        }
    }
}
