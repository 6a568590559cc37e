//! Where a mechanism's handle can be: filled, with the curves on which it is while a joint is at its limit, in each view; and its extent in the world.
//!
//! A paddle's handle is on an arc, a pantograph's in a region of its plane. That of a serial arm is in a region of the arm's own plane, which the yaw
//! turns about z; from above it is in sectors between the least and the largest distance from the yaw axis.

use glam::DVec2;
use mortise_protocol::limits::MAX_JOINTS;

use super::extremes::{cells as cells_of, largest};
use super::links::{Angles, Links, View};
use super::region::{Cell, Place, Region, distance_to_segment};

/// Points of a curve.
const POINTS: usize = 97;
/// Steps of the grid of postures for the extent of the links.
const GRID: u32 = 8;
/// Steps of the grid of each joint in a search, for one, two and three joints.
const STEPS: [u32; MAX_JOINTS] = [64, 24, 12];

/// Where the handle is while a joint is at an end of its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// The joint, from 0.
    pub joint: usize,
    /// Its angle, rad.
    pub angle: f64,
    /// The curve, in pieces where links cannot always be connected; a single point for a mechanism of one joint. mm.
    pub pieces: Vec<Vec<DVec2>>,
}

/// The reach in a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The view.
    pub view: View,
    /// What is filled.
    pub region: Region,
    /// With a joint at its limit.
    pub limits: Vec<Limit>,
    /// Other lines at which the reach ends, mm.
    pub edges: Vec<Vec<DVec2>>,
    /// Corners of what reach, links and the world's origin take in any posture of a grid, mm.
    pub bounds: [DVec2; 2],
}

impl Seen {
    fn new(view: View) -> Self {
        Self {
            view,
            region: Region::default(),
            limits: Vec::new(),
            edges: Vec::new(),
            bounds: [DVec2::ZERO; 2],
        }
    }

    /// Every drawn line.
    pub fn lines(&self) -> impl Iterator<Item = &[DVec2]> {
        let limits = self.limits.iter().flat_map(|limit| &limit.pieces);
        limits.chain(&self.edges).map(Vec::as_slice)
    }

    /// Whether a point is in the drawn reach, or nearer to it than `tolerance`, mm.
    pub fn contains(&self, point: DVec2, tolerance: f64) -> bool {
        self.region.contains(point, tolerance)
            || self
                .lines()
                .any(|line| distance_to_line(line, point) <= tolerance)
    }
}

/// Distance of a point from a line of one or more points.
pub fn distance_to_line(line: &[DVec2], point: DVec2) -> f64 {
    let ends = line.first().map_or(f64::INFINITY, |first| first.distance(point));
    let sides = line
        .windows(2)
        .map(|pair| distance_to_segment(pair[0], pair[1], point));
    sides.fold(ends, f64::min)
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reach {
    /// In each view.
    pub seen: Vec<Seen>,
    /// Smallest and largest x, y and z of the handle in the world, mm.
    pub world: [[f64; 2]; 3],
    /// Whether there are angles within the joints' ranges at which the links cannot be connected.
    pub has_gaps: bool,
}

impl Reach {
    /// The reach of a mechanism.
    pub fn new(links: &Links) -> Self {
        let ranges = links.ranges();
        let mut seen = match ranges.len() {
            1 => vec![arc(links)],
            2 => vec![plane(links, View::Top, [0, 1])],
            _ => vec![plane(links, View::Side, [1, 2]), sectors(links)],
        };
        for seen in &mut seen {
            seen.bounds = bounds(links, seen);
        }
        let steps = STEPS[ranges.len().clamp(1, MAX_JOINTS) - 1];
        let world = [0, 1, 2].map(|axis| {
            [-1.0, 1.0].map(|sign| {
                let found = largest(ranges, steps, |angles| {
                    Some(sign * links.handle_in_world(angles)?[axis])
                });
                found.map_or(0.0, |(_, value)| sign * value)
            })
        });
        let gap = largest(ranges, steps, |angles| {
            links.handle_in_world(angles).is_none().then_some(0.0)
        });
        Self {
            seen,
            world,
            has_gaps: gap.is_some(),
        }
    }

    /// The reach in a view.
    pub fn in_view(&self, view: View) -> Option<&Seen> {
        self.seen.iter().find(|seen| seen.view == view)
    }
}

/// Corners of what a view shows in the postures of a grid.
fn bounds(links: &Links, seen: &Seen) -> [DVec2; 2] {
    let cells = seen.region.cells.iter().flat_map(|cell| &cell.corners);
    let mut points: Vec<DVec2> = cells.chain(seen.lines().flatten()).copied().collect();
    for cell in cells_of(links.ranges().len(), GRID + 1) {
        let mut angles = links.home();
        for ((angle, [from, to]), place) in angles.iter_mut().zip(links.ranges()).zip(cell) {
            *angle = from + (to - from) * f64::from(place) / f64::from(GRID);
        }
        let skeleton = links.skeleton(angles);
        let ends = skeleton.links.iter().flatten().chain(&skeleton.joints);
        points.extend(ends.map(|end| links.seen(seen.view, skeleton.yaw, *end)));
        points.push(links.world_axes(seen.view, skeleton.yaw).0);
    }
    let ends = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let (low, high) = (points.iter()).fold(ends, |(low, high), point| (low.min(*point), high.max(*point)));
    [low, high]
}

/// The curve of the handle while one joint runs over its range, in pieces.
fn curve(links: &Links, view: View, joint: usize, angles: Angles, [from, to]: [f64; 2]) -> Vec<Vec<DVec2>> {
    let mut pieces = vec![Vec::new()];
    for point in 0..POINTS {
        let mut angles = angles;
        angles[joint] = from + (to - from) * point as f64 / (POINTS - 1) as f64;
        match links.handle(angles) {
            Some(handle) => {
                let yaw = if view == View::Side { angles[0] } else { 0.0 };
                pieces.extend(pieces.is_empty().then(Vec::new));
                if let Some(piece) = pieces.last_mut() {
                    piece.push(links.seen(view, yaw, handle));
                }
            }
            None => pieces.push(Vec::new()),
        }
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

fn arc(links: &Links) -> Seen {
    let range = links.ranges()[0];
    let mut seen = Seen::new(View::Top);
    seen.edges = curve(links, View::Top, 0, links.home(), range);
    seen.limits = range
        .map(|angle| {
            let ends = curve(links, View::Top, 0, links.home(), [angle, angle]);
            let pieces = ends.into_iter().map(|piece| vec![piece[0]]).collect();
            Limit {
                joint: 0,
                angle,
                pieces,
            }
        })
        .to_vec();
    seen
}

/// The region of two joints, with the curves on which one of them is at a limit.
fn plane(links: &Links, view: View, joints: [usize; 2]) -> Seen {
    let ranges = joints.map(|joint| links.ranges()[joint]);
    let home = links.home();
    let mut seen = Seen::new(view);
    seen.region = Region::new(ranges, |values| {
        let mut angles = home;
        for (joint, value) in joints.into_iter().zip(values) {
            angles[joint] = value;
        }
        let posture = links.posture(angles)?;
        let yaw = if view == View::Side { angles[0] } else { 0.0 };
        let moves = joints.map(|joint| {
            let world = posture.jacobian.col(joint).as_dvec3();
            links.seen(view, yaw, links.to_own(world))
        });
        Some(Place {
            at: links.seen(view, yaw, links.handle(angles)?),
            sense: moves[0].perp_dot(moves[1]),
            share: f64::from(posture.share()),
        })
    });
    for (place, joint) in joints.into_iter().enumerate() {
        for angle in ranges[place] {
            let mut angles = home;
            angles[joint] = angle;
            let pieces = curve(links, view, joints[1 - place], angles, ranges[1 - place]);
            seen.limits.push(Limit { joint, angle, pieces });
        }
    }
    seen
}

/// A serial arm from above.
fn sectors(links: &Links) -> Seen {
    let (yaw, home) = (links.ranges()[0], links.home());
    let outward = |angles: Angles| {
        let handle = links.handle(angles)?;
        Some(links.seen(View::Side, angles[0], handle).x)
    };
    let at = |sign: f64| {
        let found = largest(&links.ranges()[1..], STEPS[1], |[upper, lower, _]| {
            Some(sign * outward([home[0], upper, lower])?)
        });
        found.map(|([upper, lower, _], _)| [home[0], upper, lower])
    };
    let mut seen = Seen::new(View::Top);
    let Some((near, far)) = at(-1.0).zip(at(1.0)) else {
        return seen;
    };
    let arcs = [near, far].map(|angles| curve(links, View::Top, 0, angles, yaw));
    let [Some(inner), Some(outer)] = [0, 1].map(|arc: usize| arcs[arc].first().cloned()) else {
        return seen;
    };
    // What is behind the yaw axis is in the opposite sector.
    let behind = outward(near).is_some_and(|distance| distance < 0.0)
        && outward(far).is_some_and(|distance| distance > 0.0);
    let axis = vec![DVec2::ZERO; inner.len()];
    let bands = match behind {
        true => vec![[&axis, &outer], [&axis, &inner]],
        false => vec![[&inner, &outer]],
    };
    for [a, b] in bands {
        let strips = a.windows(2).zip(b.windows(2));
        seen.region.cells.extend(strips.map(|(a, b)| Cell {
            corners: vec![a[0], b[0], b[1], a[1]],
            shares: vec![1.0; 4],
        }));
    }
    let ends = [0, inner.len() - 1];
    seen.limits = (yaw.into_iter().zip(ends))
        .map(|(angle, end)| Limit {
            joint: 0,
            angle,
            pieces: vec![vec![inner[end], outer[end]]],
        })
        .collect();
    seen.edges = vec![inner, outer];
    seen
}

#[cfg(test)]
mod tests {
    use mortise_protocol::rig::Rig;
    use mortise_rig::EXAMPLES;
    use proptest::prelude::*;

    use super::super::links::tests::{example, loose, within};
    use super::*;

    /// Chords of the drawn curves and cells: a cell is 2° of the longest link at most.
    const DRAWN: f64 = 0.3;

    /// A mechanism with its reach.
    struct Both {
        links: Links,
        reach: Reach,
    }

    fn both(rig: &Rig) -> Both {
        let links = Links::new(rig).expect("a mechanism");
        let reach = Reach::new(&links);
        Both { links, reach }
    }

    fn mechanisms() -> Vec<Both> {
        let all = (0..EXAMPLES.len()).map(|number| both(&example(number)));
        all.collect()
    }

    #[test]
    fn the_reach_of_a_paddle_is_its_arc() {
        let mechanism = &mechanisms()[0];
        let r = 65.659;
        let [x, y, z] = mechanism.reach.world;
        let side = r * 40f64.to_radians().sin();
        // The world's origin is at the upright handle.
        for (found, expected) in [
            (x, [-side, side]),
            (y, [r * (40f64.to_radians().cos() - 1.0), 0.0]),
            (z, [0.0; 2]),
        ] {
            assert!(
                (found[0] - expected[0]).abs() < 1e-3 && (found[1] - expected[1]).abs() < 1e-3,
                "{found:?}"
            );
        }
        let [seen] = &mechanism.reach.seen[..] else {
            panic!()
        };
        assert!(seen.region.cells.is_empty() && seen.limits.len() == 2 && seen.edges.len() == 1);
        assert!(!mechanism.reach.has_gaps && both(&loose()).reach.has_gaps);
    }

    /// Without limits of its upper and lower link the arm reaches what lies between a ball and a smaller one about its shoulder.
    #[test]
    fn folds_end_the_reach_where_links_are_in_line() {
        let mut rig = example(2);
        for joint in [1, 2] {
            rig.joints[joint].range = [-3.2, 3.2];
        }
        let mechanism = both(&rig);
        let side = mechanism.reach.in_view(View::Side).expect("a side view");
        let shoulder = DVec2::new(0.0, 80.0);
        assert!(side.region.folds.len() > 100);
        for [a, b] in &side.region.folds {
            for end in [a, b] {
                let distance = end.distance(shoulder);
                assert!(
                    (distance - 450.0).abs() < 0.01 || (distance - 40.0).abs() < 0.01,
                    "{distance}"
                );
            }
        }
        assert!(
            side.contains(shoulder + DVec2::new(0.0, 449.0), DRAWN)
                && !side.contains(shoulder + DVec2::new(0.0, 451.0), DRAWN)
        );
        assert!(!side.contains(shoulder + DVec2::new(38.0, 0.0), DRAWN));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1500))]

        /// With its joints within their limits the handle is in the drawn reach, and in its extent in the world.
        #[test]
        fn a_handle_is_within_the_drawn_reach(shares in prop::array::uniform3(0.0..=1.0f64)) {
            thread_local!(static ALL: Vec<Both> = { let mut all = mechanisms(); all.push(both(&loose())); all });
            ALL.with(|all| {
                for mechanism in all {
                    let angles = within(&mechanism.links, shares);
                    let Some((handle, world)) = mechanism.links.handle(angles).zip(mechanism.links.handle_in_world(angles)) else { continue };
                    for seen in &mechanism.reach.seen {
                        let at = mechanism.links.seen(seen.view, angles[0], handle);
                        prop_assert!(seen.contains(at, DRAWN), "{:?} {at}", seen.view);
                    }
                    for (value, [low, high]) in world.to_array().into_iter().zip(mechanism.reach.world) {
                        prop_assert!(value >= low - 0.02 && value <= high + 0.02, "{value} not in {low} to {high}");
                    }
                }
                Ok(())
            })?;
        }

        /// With a joint at an end of its range the handle is on that joint's curve in the view that shows the joint.
        #[test]
        fn a_handle_at_a_limit_is_on_its_curve(shares in prop::array::uniform3(0.0..=1.0f64), which in 0usize..3, end in 0usize..2) {
            thread_local!(static ALL: Vec<Both> = mechanisms());
            ALL.with(|all| {
                for mechanism in all {
                    let joint = which % mechanism.links.ranges().len();
                    let mut angles = within(&mechanism.links, shares);
                    angles[joint] = mechanism.links.ranges()[joint][end];
                    let Some(handle) = mechanism.links.handle(angles) else { continue };
                    let shown = mechanism.reach.seen.iter().flat_map(|seen| seen.limits.iter().map(move |limit| (seen, limit)));
                    let mut own = shown.filter(|(_, limit)| limit.joint == joint && limit.angle == angles[joint]);
                    let (seen, limit) = own.next().expect("each end of each joint has its curve");
                    let at = mechanism.links.seen(seen.view, angles[0], handle);
                    let away = limit.pieces.iter().map(|piece| distance_to_line(piece, at)).fold(f64::INFINITY, f64::min);
                    prop_assert!(away < DRAWN, "{joint}: {away}");
                }
                Ok(())
            })?;
        }
    }
}
