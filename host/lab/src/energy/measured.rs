//! An energy of a peg and its hole as numbers: where its minimum is, how wide it is, how many there are, and what it does above the mouth.

use std::fmt;

use glam::{DAffine3, DQuat, DVec3};
use mortise_energy::{BakedEnergy, Pair};
use serde::Serialize;

use super::sections::{DEPTH, Section};
use crate::followed::Followed;

/// Largest translation and rotation of a curve, mm and degrees, and its points.
pub(super) const SHIFT_MM: f64 = 20.0;
pub(super) const ANGLE_DEG: f64 = 60.0;
pub(super) const POINTS: usize = 81;
/// Heights of the peg's foot above the mouth, mm, and the largest lateral offset there.
pub(super) const ABOVE_MM: [f64; 3] = [1.0, 2.0, 5.0];
pub(super) const ASIDE_MM: f64 = 6.0;
/// Reach of the search for a minimum about the fit, mm and degrees.
const SEARCH_MM: f64 = 1.0;
const SEARCH_DEG: f64 = 3.0;
/// Steps by which the end of a convex part is sought, mm and degrees.
const STEP_MM: f64 = 0.1;
const STEP_DEG: f64 = 0.25;
/// A minimum counts where the energy falls to it, and rises from it, by more than this share of the well's depth. The board draws with 3 N where its energy is the
/// steepest, about 0.4 of the depth a millimetre; 1 % of it over 2 mm, half a convex part, is 0.04 N: half the force of the hand's own tremor (0.2 mm by 400 N/m), so no
/// smaller well holds a part against it.
const LEAST_WELL: f64 = 0.01;

/// What was found of a section with some of the samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Entry {
    /// Section.
    pub section: &'static str,
    /// Form of the energy: as published, or the board's.
    pub form: &'static str,
    /// Samples of the peg's density; charges of the board's form.
    pub samples: usize,
    /// How far the peg is in, mm.
    pub depth_mm: f64,
    /// Lateral distance of the minimum from the hole's axis, µm.
    pub axis_bias_um: f64,
    /// Tilt of the minimum, mrad.
    pub tilt_bias_mrad: f64,
    /// Width of the convex part about the minimum, sideways, mm.
    pub basin_mm: f64,
    /// The same of tilts, degrees.
    pub basin_deg: f64,
    /// Largest number of minima along one of the six curves, up to 20 mm along and 60° about each axis.
    pub minima: usize,
    /// Energy 3 mm aside of the axis less that on it, over the well's depth, with the foot 1 mm above the mouth: negative pushes aside.
    pub above_1_mm: f64,
    /// The same 2 mm above the mouth.
    pub above_2_mm: f64,
    /// The same 5 mm above the mouth.
    pub above_5_mm: f64,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}, {} samples, {:.0} mm in: minimum {:.1} µm and {:.2} mrad off, convex over {:.1} mm and {:.1}°, at most {} along a curve; 3 mm aside above the mouth {:+.4}, {:+.4}, {:+.4} of the well",
            self.section,
            self.form,
            self.samples,
            self.depth_mm,
            self.axis_bias_um,
            self.tilt_bias_mrad,
            self.basin_mm,
            self.basin_deg,
            self.minima,
            self.above_1_mm,
            self.above_2_mm,
            self.above_5_mm,
        )
    }
}

/// Pose of a peg whose foot is at `foot` and that is turned about it.
fn pose(foot: DVec3, turn: DVec3) -> DAffine3 {
    DAffine3::from_rotation_translation(DQuat::from_scaled_axis(turn), foot)
}

/// An energy with what all its values are compared with.
pub(super) struct Measured<'a> {
    form: &'static str,
    samples: usize,
    of: Box<dyn Fn(&DAffine3) -> f64 + 'a>,
    /// Placement of the peg's shape relative to its foot, in the fit.
    shape: DAffine3,
    /// Half the width over which second differences are taken, mm and rad.
    span: [f64; 2],
    /// Energy at the fit, negative.
    well: f64,
}

impl<'a> Measured<'a> {
    fn new(
        form: &'static str,
        samples: usize,
        of: Box<dyn Fn(&DAffine3) -> f64 + 'a>,
        shape: DAffine3,
        span: [f64; 2],
    ) -> Self {
        let mut measured = Self {
            form,
            samples,
            of,
            shape,
            span,
            well: -1.0,
        };
        measured.well = measured.at(DVec3::new(0.0, 0.0, -DEPTH), DVec3::ZERO);
        measured
    }

    /// The energy as published.
    pub fn published(pair: &'a Pair) -> Self {
        let of = Box::new(|pose: &DAffine3| pair.at(pose).energy);
        let span = [STEP_MM, STEP_DEG.to_radians()];
        Self::new("published", pair.samples().len(), of, DAffine3::IDENTITY, span)
    }

    /// The board's energy. It is trilinear in the cells of a lattice, so it is curved over a cell at the least: by translations, and by rotations of the place farthest
    /// from the middle of the fit.
    pub fn board(energy: &'a BakedEnergy, followed: &Followed) -> Self {
        let cell = 1e3 * f64::from(energy.record.step);
        let of = Box::new(|pose: &DAffine3| energy.at(pose, DVec3::ZERO).energy);
        let shape = pose(DVec3::new(0.0, 0.0, DEPTH), DVec3::ZERO) * followed.place(0.0);
        Self::new(
            "board",
            energy.charges.len(),
            of,
            shape,
            [cell, cell / (0.5 * DEPTH)],
        )
    }

    /// Energy over the well's depth.
    pub fn at(&self, foot: DVec3, turn: DVec3) -> f64 {
        let peg = pose(foot, turn) * self.shape;
        -(self.of)(&peg) / self.well
    }

    /// The same of a peg this deep in, translated.
    pub fn slid(&self, depth: f64, by: DVec3) -> f64 {
        self.at(by - DVec3::new(0.0, 0.0, depth), DVec3::ZERO)
    }

    /// The same of a peg this deep in, turned about the middle of what is in the hole.
    pub fn turned(&self, depth: f64, turn: DVec3) -> f64 {
        let middle = DVec3::new(0.0, 0.0, 0.5 * depth);
        let foot = middle - DVec3::new(0.0, 0.0, depth) - DQuat::from_scaled_axis(turn) * middle;
        self.at(foot, turn)
    }

    /// Largest number of minima along one of the six curves from a depth.
    fn minima(&self, depth: f64) -> usize {
        let places = || (0..POINTS).map(|i| 2.0 * i as f64 / (POINTS - 1) as f64 - 1.0);
        let angle = ANGLE_DEG.to_radians();
        let counts = DVec3::AXES.into_iter().flat_map(|axis| {
            let along = places().map(|x| self.slid(depth, SHIFT_MM * x * axis));
            let about = places().map(|x| self.turned(depth, angle * x * axis));
            [minima(along, LEAST_WELL), minima(about, LEAST_WELL)]
        });
        counts.max().unwrap_or(0)
    }

    pub fn entry(&self, section: Section, depth: f64) -> Entry {
        let aside = [DVec3::X, DVec3::Y].map(|axis| least_at(&|by| self.slid(depth, by * axis), SEARCH_MM));
        let tilt = [DVec3::X, DVec3::Y].map(|axis| {
            let of = |angle| self.turned(depth, angle * axis);
            least_at(&of, SEARCH_DEG.to_radians())
        });
        let [above_1_mm, above_2_mm, above_5_mm] = ABOVE_MM.map(|height| {
            let at = |by: f64| self.at(DVec3::new(by, 0.0, height), DVec3::ZERO);
            at(0.5 * ASIDE_MM) - at(0.0)
        });
        let slid = |by: f64| self.slid(depth, by * DVec3::X);
        let turned = |degrees: f64| self.turned(depth, degrees.to_radians() * DVec3::X);
        let [span_mm, span_rad] = self.span;
        Entry {
            section: section.name(),
            form: self.form,
            samples: self.samples,
            depth_mm: depth,
            axis_bias_um: 1e3 * aside[0].hypot(aside[1]),
            tilt_bias_mrad: 1e3 * tilt[0].hypot(tilt[1]),
            basin_mm: convex(&slid, STEP_MM, span_mm, SHIFT_MM),
            basin_deg: convex(&turned, STEP_DEG, span_rad.to_degrees(), ANGLE_DEG),
            minima: self.minima(depth),
            above_1_mm,
            above_2_mm,
            above_5_mm,
        }
    }
}

/// Place of the least value within `reach` of zero, of a function with one minimum there.
fn least_at(of: &dyn Fn(f64) -> f64, reach: f64) -> f64 {
    const HALVINGS: usize = 40;
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let (mut low, mut high) = (-reach, reach);
    for _ in 0..HALVINGS {
        let inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if of(inner[0]) < of(inner[1]) {
            high = inner[1];
        } else {
            low = inner[0];
        }
    }
    0.5 * (low + high)
}

/// Width of the interval about zero over which second differences over `span` to either side are positive, in steps of `step`, at most `most` to either side.
fn convex(of: &dyn Fn(f64) -> f64, step: f64, span: f64, most: f64) -> f64 {
    let side = |sign: f64| {
        let mut at = 0.0;
        while at < most {
            let next = at + step;
            let [a, b, c] = [next - span, next, next + span].map(|x| of(sign * x));
            if a + c <= 2.0 * b {
                break;
            }
            at = next;
        }
        at
    };
    side(1.0) + side(-1.0)
}

/// Number of places within a row of values to which these fall by more than `least` and from which they rise by more than it.
fn minima(values: impl Iterator<Item = f64>, least: f64) -> usize {
    let (mut count, mut falls) = (0, false);
    // The highest value since the last minimum; the lowest since it fell.
    let (mut high, mut low) = (f64::NEG_INFINITY, f64::INFINITY);
    for value in values {
        high = high.max(value);
        low = low.min(value);
        if falls && value - low > least {
            count += 1;
            (falls, high) = (false, value);
        } else if !falls && high - value > least {
            (falls, low) = (true, value);
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_value_and_the_convex_part_of_a_known_function() {
        let of = |x: f64| -(-(x - 0.25) * (x - 0.25)).exp();
        assert!((least_at(&of, 1.0) - 0.25).abs() < 1e-6);
        // Convex between its inflections, 1/√2 to either side of the minimum.
        let width = convex(&of, 1e-3, 1e-3, 10.0);
        assert!((width - 2.0f64.sqrt()).abs() < 5e-3, "{width}");
    }

    /// Straight pieces of length 0.1 between the values of a curve hide it from short differences, and not from long ones.
    #[test]
    fn the_convex_part_of_straight_pieces_is_seen_over_their_length() {
        let of = |x: f64| {
            let (first, share) = ((10.0 * x).floor(), (10.0 * x).rem_euclid(1.0));
            let node = |i: f64| -(-(0.1 * i) * (0.1 * i)).exp();
            node(first) * (1.0 - share) + node(first + 1.0) * share
        };
        assert!(convex(&of, 0.013, 0.013, 10.0) < 0.5);
        let width = convex(&of, 0.013, 0.1, 10.0);
        assert!((width - 2.0f64.sqrt()).abs() < 0.1, "{width}");
    }

    /// Waves on a slope: each has a minimum of its own where it is steeper than the slope, and counts by its depth.
    #[test]
    fn minima_count_by_how_deep_they_are() {
        let waves = |amplitude: f64, slope: f64| {
            (0..=300).map(move |i| {
                let x = f64::from(i) / 100.0;
                slope * x - amplitude * (std::f64::consts::TAU * x).cos()
            })
        };
        // Minima at 0, 1, 2 and 3, of which the first and the last are ends.
        assert_eq!(minima(waves(1.0, 0.0), 1.9), 2);
        assert_eq!(minima(waves(1.0, 0.0), 2.1), 0);
        assert_eq!(minima(waves(-1.0, 0.0), 1.9), 3);
        assert_eq!(minima(waves(0.1, 10.0), 0.0), 0);
        assert_eq!(minima(std::iter::empty(), 0.0), 0);
    }
}
