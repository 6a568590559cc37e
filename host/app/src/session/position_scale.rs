//! Position scaling: the held part moves so many times as far as the handle, on the board. Here the poses of both, the simulated hand, and what it does to
//! what is felt, in words.
//!
//! Where the window plans what the handle is to do for a part, it plans for a *scaled handle*, which moves as far as the part.

use glam::DAffine3;
use mortise_protocol::message::HandScript;
use mortise_protocol::parameter::ParameterId;

use super::held::scaled;
use super::number::number;
use super::state::Session;

impl Session {
    /// How many times as far as the handle a part moves that is grabbed now.
    pub fn chosen_position_scale(&self) -> f64 {
        f64::from(self.parameters[ParameterId::PositionScale as usize])
    }

    /// The same for the held part, else for the next one.
    fn position_scale(&self) -> f64 {
        self.held
            .map_or(self.chosen_position_scale(), |held| held.scale())
    }

    /// Pose of the scaled handle, mm.
    pub fn scaled_handle(&self) -> Option<DAffine3> {
        let telemetry = self.telemetry.as_ref()?;
        Some(scaled(&telemetry.handle, self.position_scale()))
    }

    /// What the simulated hand does to the handle so that the scaled handle follows a script: as strong and as stiff a hand, seen from the part.
    pub(super) fn for_handle(&self, mut script: HandScript) -> HandScript {
        let scale = self.position_scale() as f32;
        script.stiffness *= scale * scale;
        script.damping *= scale * scale;
        script.tremor /= scale;
        for frame in &mut script.keyframes {
            frame.pose.position = frame.pose.position.map(|x| x / scale);
            frame.push = frame.push.map(|n| n * scale);
        }
        script
    }

    /// What the chosen scale does, in words; `None` where it does nothing.
    pub fn position_scale_in_words(&self) -> Option<String> {
        let scale = self.chosen_position_scale();
        if scale == 1.0 {
            return None;
        }
        let stiffness = f64::from(self.parameters[ParameterId::CouplingStiffness as usize]);
        let from = match self.held {
            Some(held) if held.scale() != scale => "From the next grab on the",
            _ => "The",
        };
        Some(format!(
            "{from} part moves {} times as far as the handle; the coupling's {} N/m are felt as {} N/m",
            number(scale),
            number(stiffness),
            number(scale * scale * stiffness)
        ))
    }
}
