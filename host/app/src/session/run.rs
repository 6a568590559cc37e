//! A recorded run as the window shows it: its traces, where its handle and part were, and its figures. Pure but for reading the file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mortise_protocol::message::{FromDevice, Telemetry, ToDevice, WirePose};
use mortise_record::{EntryKind, Recording};

use super::history::{History, Sample};

/// Contact force from which parts touch, N.
const TOUCH_N: f32 = 0.05;

/// Longest time between a tick and the nearest sample of telemetry, s.
const AROUND_S: f64 = 0.5;

/// Figures of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Time from the first touch to the deepest insertion, s; 0 without a touch.
    pub insertion_s: f64,
    /// Largest contact force, N.
    pub contact_n: f32,
    /// Largest force on the handle, N.
    pub handle_n: f32,
    /// Deepest penetration, µm.
    pub depth_um: f32,
    /// Deepest insertion, mm.
    pub insertion_mm: f32,
}

/// A recorded run.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The file.
    pub path: PathBuf,
    /// Its samples; of a longer one the last minutes.
    pub history: History,
    /// Of each part that was held, by its number in the collision model: times, s, and poses.
    parts: BTreeMap<u16, Vec<(f64, WirePose)>>,
    duration_s: f64,
    /// Checksums of the collision models that were on the board.
    pub scenes: Vec<u32>,
    /// First tick of each stretch in which the board counted on, and its time in the run, s.
    starts: Vec<(u32, f64)>,
    newest_tick: Option<u32>,
    tick_hz: u16,
    /// Time of the first touch, s.
    pub touch_s: Option<f64>,
    /// Its figures.
    pub figures: Figures,
}

impl Run {
    /// Reads a recording. Cost: some seconds for an hour.
    ///
    /// # Errors
    /// One line: what, where, what to do.
    pub fn read(path: &Path) -> Result<Self, String> {
        let recording = Recording::open(path).map_err(|error| error.to_string())?;
        let mut run = Self {
            path: path.to_owned(),
            tick_hz: 1_000,
            ..Self::default()
        };
        let mut start = None;
        for entry in recording.entries() {
            match entry.kind {
                EntryKind::Telemetry(sample) => run.add(&sample, &mut start),
                EntryKind::Received(FromDevice::Capabilities(can)) => {
                    run.tick_hz = can.tick_hz.max(1);
                    run.scenes.extend(can.scene);
                }
                EntryKind::Sent(_, ToDevice::SceneBegin { crc, .. }) => run.scenes.push(crc),
                _ => {}
            }
        }
        match run.history.is_empty() {
            true => Err(format!(
                "{}: holds no telemetry, so nothing can be shown",
                path.display()
            )),
            false => Ok(run),
        }
    }

    fn add(&mut self, telemetry: &Telemetry, start: &mut Option<f64>) {
        let mut sample = Sample::of(telemetry, self.tick_hz);
        sample.time_s -= *start.get_or_insert(sample.time_s);
        self.history.add(sample);
        // The history's time goes on where the board started again.
        let time_s = self.history.newest().map_or(0.0, |newest| newest.time_s);
        self.duration_s = time_s;
        if self.newest_tick.is_none_or(|newest| telemetry.tick < newest) {
            self.starts.push((telemetry.tick, time_s));
        }
        self.newest_tick = Some(telemetry.tick);
        if let Some((part, pose)) = telemetry.object {
            self.parts.entry(part).or_default().push((time_s, pose));
        }
        if sample.contact_n > TOUCH_N && self.touch_s.is_none() {
            self.touch_s = Some(time_s);
        }
        let figures = &mut self.figures;
        figures.contact_n = figures.contact_n.max(sample.contact_n);
        figures.handle_n = figures.handle_n.max(sample.handle_n);
        figures.depth_um = figures.depth_um.max(sample.depth_um);
        if sample.insertion_mm > figures.insertion_mm {
            figures.insertion_mm = sample.insertion_mm;
            figures.insertion_s = self.touch_s.map_or(0.0, |touch| time_s - touch);
        }
    }

    /// A run of these samples.
    #[cfg(test)]
    pub(super) fn of(path: &str, samples: impl Iterator<Item = Sample>) -> Self {
        let mut run = Self {
            path: PathBuf::from(path),
            ..Self::default()
        };
        samples.for_each(|sample| run.history.add(sample));
        run.duration_s = run.history.newest().map_or(0.0, |newest| newest.time_s);
        run
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Time at which the board computed a tick, s; `None` if it is not in the run.
    pub fn time_of(&self, tick: u32) -> Option<f64> {
        let ends = self.starts.iter().skip(1).map(|(_, begins_s)| *begins_s);
        let ends = ends.chain([self.duration_s]);
        (self.starts.iter().zip(ends)).find_map(|(&(first, begins_s), end_s)| {
            let since = f64::from(tick) - f64::from(first);
            let time_s = begins_s + since / f64::from(self.tick_hz.max(1));
            // Telemetry begins, and ends, within this time of the ticks.
            let is_in = (begins_s - AROUND_S..=end_s + AROUND_S).contains(&time_s);
            is_in.then(|| time_s.clamp(0.0, self.duration_s))
        })
    }

    /// Where each part was that was ever held, by its number in the collision model: where it was held last, or before that where it was held first.
    pub fn poses(&self, time_s: f64) -> impl Iterator<Item = (u16, WirePose)> {
        self.parts.iter().filter_map(move |(&part, poses)| {
            let after = poses.partition_point(|(time, _)| *time <= time_s);
            let (_, pose) = poses.get(after.saturating_sub(1))?;
            Some((part, *pose))
        })
    }

    /// Name of the file.
    pub fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(tick: u32, contact: f32) -> Telemetry {
        let pose = WirePose {
            position: [0.0, 0.0, tick as f32 * 1e-3],
            orientation: [0.0, 0.0, 0.0, 1.0],
        };
        Telemetry {
            tick,
            handle: pose,
            object: Some((1, pose)),
            wrench: Default::default(),
            contact: mortise_protocol::message::WireWrench {
                force: [contact, 0.0, 0.0],
                torque: [0.0; 3],
            },
            hand: None,
            cost: 0,
            points: 0,
            flags: 0,
            missed: 0,
            dropped: 0,
            guidance: Default::default(),
            pairs: Default::default(),
        }
    }

    fn run(first: u32, touch: u32) -> Run {
        let mut run = Run {
            tick_hz: 1_000,
            ..Run::default()
        };
        let mut start = None;
        for step in 0..200 {
            let contact = if step >= touch { 2.0 } else { 0.0 };
            run.add(&sample(first + 10 * step, contact), &mut start);
        }
        run
    }

    #[test]
    fn a_part_is_where_it_was_held_last_and_before_that_where_it_was_held_first() {
        let mut run = run(5_000, 80);
        let z = |run: &Run, part: u16, time: f64| {
            let found = run.poses(time).find(|(known, _)| *known == part);
            found.map(|(_, pose)| pose.position[2])
        };
        // Another part is held from 2 s on.
        for step in 200..300 {
            let mut later = sample(5_000 + 10 * step, 0.0);
            later.object = Some((4, later.handle));
            run.add(&later, &mut Some(5.0));
        }
        for (time, one, other) in [
            (-1.0, 5.0, 7.0),
            (0.014, 5.01, 7.0),
            (1.0, 6.0, 7.0),
            (2.5, 6.99, 7.5),
            (9.0, 6.99, 7.99),
        ] {
            assert!((z(&run, 1, time).expect("held") - one).abs() < 1e-3, "{time}");
            assert!((z(&run, 4, time).expect("held") - other).abs() < 1e-3, "{time}");
        }
        assert_eq!(z(&run, 2, 1.0), None);
    }

    #[test]
    fn a_board_that_started_again_goes_on_behind_what_was() {
        let mut run = run(5_000, 80);
        let ended = run.duration_s();
        run.add(&sample(3, 0.0), &mut Some(5.0));
        assert!(run.duration_s() > ended);
        // Times of ticks before and after it.
        let near = |tick, time: f64| (run.time_of(tick).expect("in the run") - time).abs() < 1e-9;
        assert!(near(5_000, 0.0) && near(5_995, 0.995) && near(3, run.duration_s()));
        assert_eq!(run.time_of(20_000), None);
        assert_eq!(Run::default().time_of(0), None);
        assert!(run.parts[&1].is_sorted_by(|a, b| a.0 <= b.0));
    }
}
