//! First touch of two parts along a motion, from given poses: the sweep of [`crate::probe`].

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use mortise_haptics::{Course, Motion, Pose, Prober, Quat, Settings, Vec3};
use serde::Serialize;

use crate::error::ScenarioError;
use crate::probe::{NamedPose, Pair, ProbeScene};

/// Longest shift, mm: the force law's limit of positions.
const LONGEST_MM: f64 = 100e3;
/// Largest turn about an axis, degrees: a hundred times round.
const MOST_DEG: f64 = 36e3;

/// A motion: shift of the moving part's origin, and turn about it, in the fixed part's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Along {
    /// Shift, mm.
    pub shift_mm: DVec3,
    /// Turn: direction and angle, degrees.
    pub turn_deg: DVec3,
}

impl FromStr for Along {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split(',')
            .map(|cell| match cell.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(format!("`{cell}` is no number")),
            })
            .collect::<Result<Vec<f64>, String>>()?;
        let (shift, turn) = match *numbers.as_slice() {
            [x, y, z] => ([x, y, z], [0.0; 3]),
            [x, y, z, rx, ry, rz] => ([x, y, z], [rx, ry, rz]),
            _ => {
                return Err(format!(
                    "{} numbers; give dx,dy,dz in mm, or dx,dy,dz,rx,ry,rz with degrees",
                    numbers.len()
                ));
            }
        };
        let [shift_mm, turn_deg] = [shift, turn].map(DVec3::from_array);
        if shift_mm.abs().max_element() > LONGEST_MM {
            return Err(format!("the shift is beyond {LONGEST_MM} mm; give millimetres"));
        }
        if turn_deg.abs().max_element() > MOST_DEG {
            return Err(format!("the turn is beyond {MOST_DEG} degrees; give degrees"));
        }
        Ok(Self { shift_mm, turn_deg })
    }
}

/// What happens along a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Happens {
    /// The parts touch.
    Touch,
    /// They come within a micrometre, and no overlap is proven after that.
    Near,
    /// They are proven to stay apart.
    Free,
    /// From the share on nothing is proven: faces without a formula, or cells too coarse.
    Unknown,
}

/// Result of a sweep from one pose. Positions in the fixed part's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepRow {
    /// Name of the pose it starts from.
    pub name: String,
    /// What happens.
    pub happens: Happens,
    /// Share of the motion that is proven to be free.
    pub share: f64,
    /// The first touch lies no farther beyond that share; absent where none is proven.
    pub share_error: Option<f64>,
    /// Origin of the moving part there, mm.
    pub position_mm: [f64; 3],
    /// Its orientation there: w, x, y, z.
    pub orientation: [f64; 4],
    /// Smallest distance found between the parts there, mm.
    pub gap_mm: Option<f64>,
    /// Nearest point of the moving part there, mm.
    pub nearest_mm: Option<[f64; 3]>,
    /// Steps taken.
    pub steps: u32,
}

impl ProbeScene {
    /// First touch along `along` from a pose.
    ///
    /// # Errors
    /// `Input` when the force law refuses the pose or the motion's end.
    pub fn sweep(&self, pair: Pair, named: &NamedPose, along: &Along) -> Result<SweepRow, ScenarioError> {
        let scene = self.scene()?;
        let [x, y, z, w] = named.orientation.as_quat().to_array();
        let start = Pose::new(
            Vec3::from_array((1e-3 * named.position_mm).as_vec3().to_array()),
            Quat::from_xyzw(x, y, z, w),
        );
        let radians = along.turn_deg * (std::f64::consts::PI / 180.0);
        let motion = Motion {
            shift: Vec3::from_array((1e-3 * along.shift_mm).as_vec3().to_array()),
            turn: Vec3::from_array(radians.as_vec3().to_array()),
        };
        let mut prober = Box::new(Prober::new());
        let found = prober
            .sweep(
                &scene,
                [pair.moving, pair.fixed],
                &start,
                &motion,
                &Settings::default().contact,
            )
            .map_err(|error| self.refused(named, &error.to_string()))?;
        let mm = |v: Vec3| v.to_array().map(|x| 1e3 * f64::from(x));
        let [x, y, z, w] = found.pose.orientation.to_array().map(f64::from);
        Ok(SweepRow {
            name: named.name.clone(),
            happens: match found.course {
                Course::Touch => Happens::Touch,
                Course::Near => Happens::Near,
                Course::Free => Happens::Free,
                Course::Unknown => Happens::Unknown,
            },
            share: found.share,
            share_error: found.error.is_finite().then_some(found.error),
            position_mm: mm(found.pose.position),
            orientation: [w, x, y, z],
            gap_mm: found.gap_m.is_finite().then_some(1e3 * found.gap_m),
            nearest_mm: found.nearest.is_finite().then(|| mm(found.nearest)),
            steps: found.steps,
        })
    }
}

impl fmt::Display for SweepRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.position_mm;
        let percent = 100.0 * self.share;
        write!(f, "{}: ", self.name)?;
        match self.happens {
            Happens::Touch => write!(
                f,
                "first touch after {percent:.4} % (+ {:.4} %)",
                100.0 * self.share_error.unwrap_or_default()
            )?,
            Happens::Near => write!(f, "within 1 µm after {percent:.4} %, no overlap proven")?,
            Happens::Free => f.write_str("free all the way")?,
            Happens::Unknown => write!(f, "free for {percent:.4} %, then not proven")?,
        }
        write!(f, ", at {x:.4} {y:.4} {z:.4} mm")?;
        if let Some(gap) = self.gap_mm {
            write!(f, ", gap {gap:+.4} mm")?;
        }
        write!(f, ", {} steps", self.steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_are_read() {
        let along: Along = "1, 2,-3".parse().expect("three numbers");
        assert_eq!(along.shift_mm, DVec3::new(1.0, 2.0, -3.0));
        assert_eq!(along.turn_deg, DVec3::ZERO);
        let along: Along = "0,0,0,0,0,90".parse().expect("six numbers");
        assert_eq!(along.turn_deg, DVec3::Z * 90.0);
        for (text, part) in [
            ("1,2", "2 numbers"),
            ("1,2,x", "`x` is no number"),
            ("1,2,NaN", "`NaN` is no number"),
            ("1,2,1e9", "give millimetres"),
            ("0,0,0,0,0,1e9", "give degrees"),
        ] {
            let error = text.parse::<Along>().expect_err(part);
            assert!(error.contains(part), "{error}");
        }
    }
}
