//! Force over time while a peg in its hole is guided by the geometric energy: fig. 7 of Behandish & Ilieş 2015, in six degrees of freedom.
//!
//! Their collision test: the hand pushes the seated peg against the walls in random directions, steadily, about once in two seconds. Their snap test: the
//! hand carelessly moves the peg about the entrance and brings it near the fit about once a second. A recording is as long as a hand's keyframes last;
//! several make a test.

use std::f64::consts::{PI, SQRT_2, TAU};
use std::fmt;

use glam::{DQuat, DVec3};
use mortise_rig::RigSpec;
use mortise_scenario::wire::{pose_mm, vector};
use mortise_scenario::{Key, Recording};
use serde::Serialize;

use crate::LabError;
use crate::chart::{Axis, Chart, Line, Look, Point, Series};
use crate::followed::{Followed, Wanted};

/// Ticks a second.
const TICK_HZ: f64 = 1000.0;
/// Time of a push, s, and when in it the hand has arrived, goes back and is back; how far it goes, mm, and turns, degrees: 4 N and 0.17 N m by the hand's springs of
/// 400 N/m and 2 N m/rad.
const PUSH_S: f64 = 2.0;
const PUSHED_S: [f64; 3] = [0.5, 1.25, 1.75];
const PUSH_MM: f64 = 10.0;
const PUSH_DEG: f64 = 5.0;
/// Time of an approach, s, and when in it the hand is about the entrance, before the mouth, and near the fit, where it stays until the approach ends.
const APPROACH_S: f64 = 1.0;
const APPROACHED_S: [f64; 3] = [0.3, 0.5, 0.8];
/// About the entrance: height above the mouth, mm, aside, mm, and turned, degrees; each from 0 to this.
const ABOUT_MM: f64 = 10.0;
const ABOUT_ASIDE_MM: f64 = 5.0;
const ABOUT_DEG: f64 = 8.0;
/// Near the fit, and before the mouth: aside, mm, and turned, degrees, each from 0 to this; and along the way to either side, mm.
const NEAR_MM: f64 = 1.0;
const NEAR_DEG: f64 = 2.0;
const NEAR_ALONG_MM: f64 = 2.0;
/// A peg that is within this distance of the way at the end of an approach was drawn to it, mm: the bound of the energy's own minimum.
const ON_WAY_MM: f64 = 0.15;
/// From here on a vibration is felt as buzzing, Hz: the range in which the skin's receptors for vibration are the most sensitive begins there.
const BUZZ_HZ: f64 = 100.0;
/// Clearance of the pegs with play, mm.
pub(crate) const PLAY_MM: f64 = 0.1;
/// Ticks of a window of vibration, and of an interval of a chart's envelope.
const WINDOW_TICKS: usize = 100;
const ENVELOPE_TICKS: usize = 40;

/// The tests, each with the peg's clearance, mm: both at exact fit as in the paper, and the snap test with play.
pub(crate) const CASES: [(Test, f64); 3] = [(Test::Collision, 0.0), (Test::Snap, 0.0), (Test::Snap, PLAY_MM)];

/// A test of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Test {
    Collision,
    Snap,
}

impl Test {
    pub fn name(self) -> &'static str {
        match self {
            Self::Collision => "collision",
            Self::Snap => "snap",
        }
    }

    /// Pushes or approaches of a recording: as many as twelve keyframes allow.
    fn each(self) -> usize {
        match self {
            Self::Collision => 3,
            Self::Snap => 2,
        }
    }

    /// Time of each, s.
    fn period_s(self) -> f64 {
        match self {
            Self::Collision => PUSH_S,
            Self::Snap => APPROACH_S,
        }
    }

    /// Recordings that last at least this long together.
    pub fn recordings(self, seconds: f64) -> usize {
        (seconds / (self.period_s() * self.each() as f64)).ceil() as usize
    }

    /// The hand of a recording: from the fit and, in the collision test, back to it.
    fn hand(self, followed: &Followed, random: &mut fastrand::Rng) -> Vec<Key> {
        let mut keys = vec![followed.key(0.0, &Wanted::default())];
        for i in 0..self.each() {
            let begin_s = self.period_s() * i as f64;
            match self {
                Self::Collision => {
                    if i > 0 {
                        keys.push(followed.key(begin_s, &Wanted::default()));
                    }
                    let pushed = Wanted {
                        travel_mm: 0.0,
                        aside: PUSH_MM * direction(random),
                        turn: PUSH_DEG.to_radians() * random.f64() * direction(random),
                    };
                    let wanted = [pushed, pushed, Wanted::default()];
                    keys.extend(
                        (PUSHED_S.iter().zip(wanted))
                            .map(|(t_s, wanted)| followed.key(begin_s + t_s, &wanted)),
                    );
                }
                Self::Snap => {
                    let places = approach(followed, random);
                    keys.extend(
                        (APPROACHED_S.iter().zip(&places))
                            .map(|(t_s, wanted)| followed.key(begin_s + t_s, wanted)),
                    );
                    keys.push(followed.key(begin_s + APPROACH_S, &places[2]));
                }
            }
        }
        keys
    }
}

/// Where the hand of an approach goes: about the entrance, before the mouth, near the fit.
fn approach(followed: &Followed, random: &mut fastrand::Rng) -> [Wanted; 3] {
    let [x, y] = followed.across();
    let mouth = -followed.depth_mm();
    let mut off = |travel_mm: f64, aside_mm: f64, turn_deg: f64| {
        let (sin, cos) = (TAU * random.f64()).sin_cos();
        Wanted {
            travel_mm,
            aside: aside_mm * random.f64() * (cos * x + sin * y),
            turn: turn_deg.to_radians() * random.f64() * direction(random),
        }
    };
    let mut places = [
        off(mouth, ABOUT_ASIDE_MM, ABOUT_DEG),
        off(mouth, NEAR_MM, NEAR_DEG),
        off(0.0, NEAR_MM, NEAR_DEG),
    ];
    places[0].travel_mm -= ABOUT_MM * random.f64();
    places[2].travel_mm += NEAR_ALONG_MM * (2.0 * random.f64() - 1.0);
    places
}

/// A direction, evenly over the sphere (Archimedes: even along an axis and about it).
fn direction(random: &mut fastrand::Rng) -> DVec3 {
    let z = 2.0 * random.f64() - 1.0;
    let (sin, cos) = (TAU * random.f64()).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * cos, radius * sin, z)
}

/// A tick of a recording.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    /// Force on the handle, N.
    pub force: DVec3,
    /// Distance of the peg's centre of mass from the way, mm; how far it is turned from the fit, rad.
    pub aside_mm: f64,
    pub turned_rad: f64,
    /// Whether it is in the fit.
    pub is_in: bool,
}

/// What a test showed.
#[derive(Clone, Debug)]
pub(crate) struct Felt {
    test: Test,
    /// Recordings, tick by tick.
    runs: Vec<Vec<Moment>>,
    /// Hashes of every tick's state, by recording.
    pub states: Vec<String>,
    /// Ticks missed.
    pub missed: u32,
    /// Instructions of the longest tick; NaN where they are not counted.
    pub instructions: f64,
    /// Largest force on the handle, N.
    pub peak_n: f64,
    /// Deepest overlap by the exact surfaces, mm.
    pub overlap_mm: f64,
}

/// Plays a test with this many recordings; the peg must begin seated. Telemetry of every `every_ticks`-th tick.
pub(crate) fn play(
    followed: &Followed,
    test: Test,
    recordings: usize,
    every_ticks: u16,
    rig: &RigSpec,
) -> Result<Felt, LabError> {
    let hands: Vec<Vec<Key>> = (0..recordings)
        .map(|seed| test.hand(followed, &mut fastrand::Rng::with_seed(seed as u64)))
        .collect();
    let played = followed.play(&hands, every_ticks, rig)?;
    let largest = |of: fn(&Recording) -> f64| played.iter().map(of).fold(0.0, f64::max);
    Ok(Felt {
        test,
        missed: played
            .iter()
            .map(|recording| recording.outcome.missed_ticks)
            .sum(),
        instructions: (played.iter())
            .map(|recording| recording.outcome.instructions_per_tick_max)
            .try_fold(0.0, |most: f64, of| Some(most.max(f64::from(of?))))
            .unwrap_or(f64::NAN),
        peak_n: largest(|recording| recording.outcome.peak_force_n),
        overlap_mm: largest(|recording| recording.outcome.penetration_mm),
        states: played
            .iter()
            .map(|recording| recording.outcome.state_hash.clone())
            .collect(),
        runs: played
            .iter()
            .map(|recording| moments(followed, recording))
            .collect(),
    })
}

fn moments(followed: &Followed, recording: &Recording) -> Vec<Moment> {
    let seat = followed.seat();
    let moments = recording.samples.iter().filter_map(|sample| {
        let at = pose_mm(&sample.object.as_ref()?.1);
        Some(Moment {
            force: vector(sample.wrench.force),
            aside_mm: followed.aside_mm(&at),
            turned_rad: DQuat::from_mat3(&(at.matrix3 * seat.matrix3.inverse()))
                .to_scaled_axis()
                .length(),
            is_in: followed.is_in(&at),
        })
    });
    moments.collect()
}

impl Felt {
    /// Approaches, and of them those at whose end the peg was on its way, and in the fit; none in the collision test. Every tick's sample is needed.
    pub fn approaches(&self) -> Option<[usize; 3]> {
        if self.test != Test::Snap {
            return None;
        }
        let (whole, stays) = [APPROACH_S, APPROACHED_S[2]]
            .map(|t_s| (TICK_HZ * t_s) as usize)
            .into();
        let mut count = [0; 3];
        for approach in self.runs.iter().flat_map(|run| run.chunks_exact(whole)) {
            count[0] += 1;
            count[1] += usize::from((approach.last()).is_some_and(|moment| moment.aside_mm < ON_WAY_MM));
            count[2] += usize::from(approach[stays..].iter().any(|moment| moment.is_in));
        }
        Some(count)
    }

    /// How much the force vibrates. Every tick's sample is needed.
    pub fn vibration(&self) -> Vibration {
        let mut sums = Sums::default();
        for run in &self.runs {
            let forces: Vec<DVec3> = run.iter().map(|moment| moment.force).collect();
            sums.add(&forces);
        }
        sums.vibration()
    }

    /// Largest distance from the way, mm, and largest turn from the fit, mrad.
    pub fn off(&self) -> [f64; 2] {
        let moments = || self.runs.iter().flatten();
        [
            moments().map(|moment| moment.aside_mm).fold(0.0, f64::max),
            1e3 * moments().map(|moment| moment.turned_rad).fold(0.0, f64::max),
        ]
    }

    /// Time, s. Every tick's sample is needed.
    pub fn seconds(&self) -> f64 {
        self.runs.iter().map(Vec::len).sum::<usize>() as f64 / TICK_HZ
    }

    /// The row of the table.
    pub fn row(&self, section: &'static str, clearance_mm: f64) -> Row {
        let vibration = self.vibration();
        let approaches = self.approaches();
        let [aside_mm, turned_mrad] = self.off();
        Row {
            section,
            clearance_mm,
            test: self.test.name(),
            seconds: self.seconds(),
            peak_n: self.peak_n,
            overlap_um: 1e3 * self.overlap_mm,
            aside_um: 1e3 * aside_mm,
            turned_mrad,
            above_100_hz_percent: vibration.percent,
            above_100_hz_rms_n: vibration.rms_n,
            approaches: approaches.map(|count| count[0]),
            on_way: approaches.map(|count| count[1]),
            seated: approaches.map(|count| count[2]),
            missed_ticks: self.missed,
        }
    }

    /// Force over time: the least and the largest of every 40 ms.
    pub fn chart(&self, section: &str) -> Chart {
        let forces: Vec<f64> = (self.runs.iter().flatten())
            .map(|moment| moment.force.length())
            .collect();
        let title = match self.test {
            Test::Collision => "seated peg pushed against its walls",
            Test::Snap => "peg brought near its fit once a second",
        };
        // A line of its own for each interval: one line would turn back at each, and a thick line's joints there reach far beyond its points.
        let bars = envelope(&forces).into_iter().map(|(tick, ends)| Series {
            name: String::new(),
            look: Look::BlueDisc,
            line: Line::Trace,
            points: ends
                .map(|y| Point {
                    x: tick / TICK_HZ,
                    y,
                    ..Point::default()
                })
                .into(),
        });
        Chart {
            title: format!("{section}: {title}"),
            note: String::new(),
            x: Axis::new("time, s").linear(),
            y: Axis::new("force, N").linear(),
            series: bars.collect(),
        }
    }
}

/// Middle of each interval, ticks, and the least and the largest value in it and at its neighbours' ends, so that neighbours meet.
fn envelope(values: &[f64]) -> Vec<(f64, [f64; 2])> {
    let starts = (0..values.len()).step_by(ENVELOPE_TICKS);
    let intervals = starts.map(|start| {
        let end = (start + ENVELOPE_TICKS).min(values.len());
        let with_ends = &values[start.saturating_sub(1)..(end + 1).min(values.len())];
        let least = with_ends.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = with_ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (0.5 * (start + end) as f64, [least, largest])
    });
    intervals.collect()
}

/// How much a force vibrates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vibration {
    /// Energy of its part above [`BUZZ_HZ`], % of that of all its variation about the mean.
    pub percent: f64,
    /// Largest root mean square of that part over a tenth of a second, N.
    pub rms_n: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    all: f64,
    above: f64,
    window: f64,
}

impl Sums {
    fn add(&mut self, forces: &[DVec3]) {
        let mean = forces.iter().sum::<DVec3>() / forces.len().max(1) as f64;
        self.all += forces
            .iter()
            .map(|force| (force - mean).length_squared())
            .sum::<f64>();
        let above: Vec<f64> = high_pass(forces)
            .iter()
            .map(|force| force.length_squared())
            .collect();
        self.above += above.iter().sum::<f64>();
        for window in above.chunks_exact(WINDOW_TICKS) {
            let mean = window.iter().sum::<f64>() / WINDOW_TICKS as f64;
            self.window = self.window.max(mean);
        }
    }

    fn vibration(&self) -> Vibration {
        Vibration {
            percent: 100.0 * self.above / self.all.max(f64::MIN_POSITIVE),
            rms_n: self.window.sqrt(),
        }
    }
}

/// What is above [`BUZZ_HZ`]: Butterworth's filter of second order, by the bilinear transform, at rest with the first value.
fn high_pass(values: &[DVec3]) -> Vec<DVec3> {
    let k = (PI * BUZZ_HZ / TICK_HZ).tan();
    let whole = 1.0 + SQRT_2 * k + k * k;
    let (a1, a2) = (2.0 * (k * k - 1.0) / whole, (1.0 - SQRT_2 * k + k * k) / whole);
    let first = values.first().copied().unwrap_or_default();
    let (mut x, mut y) = ([first; 2], [DVec3::ZERO; 2]);
    let passed = values.iter().map(|&value| {
        let out = (value - 2.0 * x[0] + x[1]) / whole - a1 * y[0] - a2 * y[1];
        (x, y) = ([value, x[0]], [out, y[0]]);
        out
    });
    passed.collect()
}

/// A test of a section.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Section.
    pub section: &'static str,
    /// The hole's width less the peg's, mm.
    pub clearance_mm: f64,
    /// Test.
    pub test: &'static str,
    /// Time, s.
    pub seconds: f64,
    /// Largest force on the handle, N.
    pub peak_n: f64,
    /// Deepest overlap by the exact surfaces, µm.
    pub overlap_um: f64,
    /// Largest distance of the peg's centre of mass from the hole's axis, µm.
    pub aside_um: f64,
    /// Largest turn of the peg from the fit, mrad.
    pub turned_mrad: f64,
    /// Energy of the force's part above 100 Hz, % of that of all its variation about the mean.
    pub above_100_hz_percent: f64,
    /// Largest root mean square of that part over a tenth of a second, N.
    pub above_100_hz_rms_n: f64,
    /// Approaches of the snap test.
    pub approaches: Option<usize>,
    /// Of them those at whose end the peg was within 0.15 mm of the hole's axis.
    pub on_way: Option<usize>,
    /// Of them those in which the peg was within 0.1 mm of the fit along the axis.
    pub seated: Option<usize>,
    /// Ticks missed.
    pub missed_ticks: u32,
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, clearance {} mm, {} test of {:.0} s: at most {:.2} N, {:.1} µm of overlap, {:.0} µm and {:.1} mrad off; {:.2} % above 100 Hz, {:.2} N over 0.1 s",
            self.section,
            self.clearance_mm,
            self.test,
            self.seconds,
            self.peak_n,
            self.overlap_um,
            self.aside_um,
            self.turned_mrad,
            self.above_100_hz_percent,
            self.above_100_hz_rms_n,
        )?;
        if let (Some(all), Some(on_way), Some(seated)) = (self.approaches, self.on_way, self.seated) {
            write!(f, "; of {all} approaches {on_way} on the way, {seated} in")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(hz: f64) -> Vec<DVec3> {
        (0..2000)
            .map(|tick| DVec3::new(1.0, 0.0, 2.0 * (TAU * hz * f64::from(tick) / TICK_HZ).sin()))
            .collect()
    }

    /// Butterworth: the energy passes by 1/(1 + (f_c/f)⁴), f by the bilinear transform tan(πf/f_s).
    #[test]
    fn a_sine_counts_by_its_frequency() {
        for hz in [5.0, 50.0, 100.0, 200.0, 400.0] {
            let mut sums = Sums::default();
            sums.add(&sine(hz));
            let ratio = (PI * BUZZ_HZ / TICK_HZ).tan() / (PI * hz / TICK_HZ).tan();
            let passed = 1.0 / (1.0 + ratio.powi(4));
            let found = sums.vibration();
            // The transient at the start lasts some milliseconds of two seconds.
            assert!((found.percent / 100.0 - passed).abs() < 0.01, "{hz}: {found:?}");
            // An amplitude of 2 N is √2 N root mean square.
            let rms = (2.0 * passed).sqrt();
            assert!((found.rms_n - rms).abs() < 0.06, "{hz}: {found:?}");
        }
    }

    #[test]
    fn a_steady_force_does_not_vibrate() {
        assert_eq!(high_pass(&[DVec3::ONE; 50]), [DVec3::ZERO; 50]);
    }

    #[test]
    fn an_envelope_keeps_the_extremes_of_each_interval_and_joins_neighbours() {
        let mut values = vec![1.0; 2 * ENVELOPE_TICKS + 3];
        (values[3], values[ENVELOPE_TICKS], values[2 * ENVELOPE_TICKS + 2]) = (5.0, -1.0, 2.0);
        let found = envelope(&values);
        let middle = 0.5 * ENVELOPE_TICKS as f64;
        let last = 2.0 * ENVELOPE_TICKS as f64 + 1.5;
        assert_eq!(
            found,
            [
                (middle, [-1.0, 5.0]),
                (3.0 * middle, [-1.0, 1.0]),
                (last, [1.0, 2.0])
            ]
        );
    }

    #[test]
    fn directions_are_even_over_the_sphere() {
        let mut random = fastrand::Rng::with_seed(1);
        let directions: Vec<DVec3> = (0..10_000).map(|_| direction(&mut random)).collect();
        assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        // Six standard deviations of a mean, 1/√(3·10⁴), and of a mean square, √(4/45)/10².
        let count = directions.len() as f64;
        let mean = directions.iter().sum::<DVec3>() / count;
        let square = directions.iter().map(|d| d * d).sum::<DVec3>() / count;
        assert!(mean.abs().max_element() < 0.035, "{mean}");
        assert!((square - 1.0 / 3.0).abs().max_element() < 0.018, "{square}");
    }

    #[test]
    fn approaches_are_counted_by_their_ends() {
        let moment = |aside_mm: f64, is_in: bool| Moment {
            force: DVec3::ZERO,
            aside_mm,
            turned_rad: 0.0,
            is_in,
        };
        // Off its way and outside; on its way and outside; on its way and in at last; in only before the hand stays.
        let mut run = vec![moment(1.0, false); 4000];
        for tick in 0..1000 {
            run[1000 + tick].aside_mm = 0.1;
            run[2000 + tick].aside_mm = 0.1;
        }
        run[2999].is_in = true;
        run[3000].is_in = true;
        let felt = Felt {
            test: Test::Snap,
            runs: vec![run],
            states: Vec::new(),
            missed: 0,
            instructions: f64::NAN,
            peak_n: 0.0,
            overlap_mm: 0.0,
        };
        assert_eq!(felt.approaches(), Some([4, 2, 1]));
    }
}
