//! A held part whose handle follows a path, whatever it feels: the product's own tick with the stiffest hand there is.
//!
//! World frame, lengths mm and angles rad in paths; the handle grips the part's centre of mass. The force on the part is the coupling's, k_T times the
//! distance of the handle beyond the part, up to the coupling's limit: 10 N with default settings.

use glam::{DAffine3, DQuat, DVec3};
use mortise_haptics::observer::{Observer, Place};
use mortise_haptics::{Input, Output, Settings, State, Twist, tick};
use mortise_protocol::image::SceneImage;

use crate::LabError;

/// A baked image, aligned for reading in place.
pub(crate) struct Image {
    words: Vec<u32>,
}

impl Image {
    /// Copies `bytes`.
    pub fn new(bytes: &[u8]) -> Self {
        let mut words = vec![0u32; bytes.len().div_ceil(4)];
        bytemuck::cast_slice_mut::<u32, u8>(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self { words }
    }

    /// Its scene.
    ///
    /// # Errors
    /// `Input`, never for images that the baker wrote.
    pub fn scene(&self) -> Result<SceneImage<'_>, LabError> {
        SceneImage::open(bytemuck::cast_slice(&self.words)).map_err(|error| LabError::Input {
            name: "image".into(),
            what: error.to_string(),
        })
    }
}

/// Pose of the handle at a time: position of the grip, mm, and rotation from the part's orientation in the file.
#[derive(Clone, Copy, Debug)]
struct Key {
    t_s: f64,
    position_mm: DVec3,
    turn: DQuat,
    /// Whether the way to it begins and ends at rest.
    eased: bool,
}

/// Keys in the order of time; between them positions are on a line and turns along the shortest arc.
#[derive(Clone, Debug, Default)]
pub(crate) struct HandlePath {
    keys: Vec<Key>,
}

impl HandlePath {
    /// At `position_mm` at the start.
    pub fn from(position_mm: DVec3, turn: DQuat) -> Self {
        let first = Key {
            t_s: 0.0,
            position_mm,
            turn,
            eased: false,
        };
        Self { keys: vec![first] }
    }

    /// Goes on to a pose within `seconds` at constant speed.
    pub fn then(self, seconds: f64, position_mm: DVec3, turn: DQuat) -> Self {
        self.with(seconds, position_mm, turn, false)
    }

    /// Goes on to a pose within `seconds`, at rest at both ends, as a hand does.
    pub fn ease(self, seconds: f64, position_mm: DVec3, turn: DQuat) -> Self {
        self.with(seconds, position_mm, turn, true)
    }

    fn with(mut self, seconds: f64, position_mm: DVec3, turn: DQuat, eased: bool) -> Self {
        let t_s = self.duration_s() + seconds;
        self.keys.push(Key {
            t_s,
            position_mm,
            turn,
            eased,
        });
        self
    }

    /// Time of the last key, s.
    pub fn duration_s(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.t_s)
    }

    fn at(&self, t_s: f64) -> Place {
        let next = self.keys.iter().position(|key| key.t_s > t_s);
        let (from, to, part) = match next {
            Some(next) if next > 0 => {
                let (from, to) = (self.keys[next - 1], self.keys[next]);
                let part = (t_s - from.t_s) / (to.t_s - from.t_s);
                // 3s² − 2s³: no speed at the ends.
                let eased = part * part * (3.0 - 2.0 * part);
                (from, to, if to.eased { eased } else { part })
            }
            Some(_) => (self.keys[0], self.keys[0], 0.0),
            None => {
                let last = self.keys[self.keys.len() - 1];
                (last, last, 0.0)
            }
        };
        Place {
            position: 1e-3 * from.position_mm.lerp(to.position_mm, part),
            orientation: from.turn.slerp(to.turn, part),
        }
    }
}

/// One tick, as seen from outside.
pub(crate) struct Seen<'o> {
    /// Time of the tick, s, and the handle's position in it, mm.
    pub t_s: f64,
    pub handle_mm: DVec3,
    /// Pose of the part's shape in the world at the tick's end, mm.
    pub object: DAffine3,
    /// What the tick returned.
    pub out: &'o Output,
}

/// Energy that the device generated at the handle in a run, beyond what its springs and the object stored: the largest rise over any interval, J.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Made {
    pub handle_j: f64,
}

/// Plays `path` with part `part` of `scene`; calls `see` after each tick.
///
/// # Errors
/// `Input` where the part cannot be grabbed.
pub(crate) fn drive(
    scene: &SceneImage<'_>,
    part: u16,
    settings: &Settings,
    path: &HandlePath,
    see: &mut dyn FnMut(&Seen<'_>),
) -> Result<Made, LabError> {
    let period = f64::from(settings.period_s);
    let mut state = Box::new(State::new());
    state.load_scene(scene);
    let mut at = path.at(0.0);
    state
        .grab(scene, part, &at.pose())
        .map_err(|error| LabError::Input {
            name: format!("part {part}"),
            what: error.to_string(),
        })?;
    let mut observer = Observer::new(scene, &state, settings, &at);
    let mut last = at;
    for index in 0..(path.duration_s() / period) as u32 {
        let input = Input {
            handle: at.pose(),
            handle_twist: speed(&last, &at, period),
            enabled: true,
        };
        if let Some(observer) = &mut observer {
            observer.look(&state);
        }
        let out = tick(&mut state, scene, settings, &input);
        let next = path.at(period * f64::from(index + 1));
        if let Some(observer) = &mut observer {
            observer.tick(&state, &at, &next, &out.handle);
        }
        see(&Seen {
            t_s: period * f64::from(index),
            handle_mm: 1e3 * at.position,
            object: pose_mm(&out),
            out: &out,
        });
        (last, at) = (at, next);
    }
    Ok(Made {
        handle_j: observer.as_ref().map_or(f64::NAN, Observer::given_j),
    })
}

fn speed(from: &Place, to: &Place, period: f64) -> Twist {
    let turned = (to.orientation * from.orientation.conjugate()).to_scaled_axis();
    Twist {
        linear: ((to.position - from.position) / period).as_vec3(),
        angular: (turned / period).as_vec3(),
    }
}

fn pose_mm(out: &Output) -> DAffine3 {
    let [x, y, z, w] = out.object.orientation.to_array().map(f64::from);
    let position = DVec3::from_array(out.object.position.to_array().map(f64::from));
    DAffine3::from_rotation_translation(DQuat::from_xyzw(x, y, z, w).normalize(), 1e3 * position)
}
