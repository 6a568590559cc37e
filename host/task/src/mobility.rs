//! Freedoms of a part or group: directions and axes along which it moves, and how far.
//!
//! 1. The normals of its contacts leave a cone of translations (`cone`): free both ways along its lines, one way along its extreme rays. A complete
//!    bore leaves its axis, a part of one a wedge, a plane a half-space (Iacob, Mitrouchev & Léon 2008 call the first kind joints, the others fits).
//! 2. Candidates are those lines and rays, the axes and normals of the surfaces beside it, and the axes about which it could turn.
//! 3. Each candidate must hold over a finite step of the exact distance, [`STEP_MM`]: a freedom to first order alone is none. It is then followed until it
//!    meets another part or leaves.
//!
//! Cost: a sweep of the group against every other part, for each candidate.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::Serialize;

use crate::assembly::{Assembly, Moved, SEARCH_STEP_MM};
use crate::cone::{Cone, cone};
use crate::directions::{candidates, contact_normals};
use crate::line::{Line, same_direction};
use crate::motion::Motion;

/// Step by which a freedom is confirmed, mm of travel of the farthest point.
pub const STEP_MM: f64 = 0.1;
/// Farthest range that counts as play of a fit, mm.
pub const PLAY_MM: f64 = 0.5;

/// How far a motion goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reach {
    /// The part leaves the others.
    Out,
    /// All the way around.
    Full,
    /// It meets another part farther than the play of a fit.
    Limited,
    /// It meets another part within the play of a fit.
    Play,
}

/// A translation that is free one way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Translation {
    /// Unit direction in the assembly's frame.
    pub direction: [f64; 3],
    /// Whether the opposite direction is in the list, too.
    pub two_sided: bool,
    /// How far it goes.
    pub reach: Reach,
    /// Travel until it meets another part, mm; `None` when it leaves.
    pub range_mm: Option<f64>,
    /// The part that it meets.
    pub meets: Option<usize>,
}

/// A turn in place that is free one way or both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rotation {
    /// Point on the axis, mm, in the assembly's frame.
    pub point: [f64; 3],
    /// Unit direction of the axis.
    pub direction: [f64; 3],
    /// How far it goes.
    pub reach: Reach,
    /// Angles until it meets another part, backwards and forwards, degrees.
    pub range_deg: [f64; 2],
}

/// Freedoms of a group.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Freedoms {
    /// Number of dimensions of translation that the contacts leave both ways, to first order.
    pub lines: usize,
    /// Number of extreme rays that they leave one way, to first order.
    pub rays: usize,
    /// Confirmed translations, those that leave first.
    pub translations: Vec<Translation>,
    /// Confirmed turns.
    pub rotations: Vec<Rotation>,
}

impl Freedoms {
    /// Directions in which it leaves straight.
    pub fn ways_out(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.translations
            .iter()
            .filter(|t| t.reach == Reach::Out)
            .map(|t| DVec3::from_array(t.direction))
    }
}

/// The cone that the contacts of a moved group with `others` leave.
pub fn contact_cone(assembly: &Assembly, group: &Moved<'_>, others: &[usize]) -> Cone {
    cone(&contact_normals(assembly, group, others))
}

/// Freedoms of a moved group against `others`. `extra`: more directions to try, each way.
pub fn freedoms(assembly: &Assembly, group: &Moved<'_>, others: &[usize], extra: &[DVec3]) -> Freedoms {
    let cone = contact_cone(assembly, group, others);
    let found = candidates(assembly, group, others);
    let (mut cone, rays) = (cone.clone(), cone.rays.len());
    few(&mut cone.rays);
    let mut directions: Vec<DVec3> = Vec::new();
    for d in (cone.rays.iter().copied()).chain(
        [&cone.lines[..], &found.directions, extra]
            .concat()
            .into_iter()
            .flat_map(|d| [d, -d]),
    ) {
        if directions
            .iter()
            .all(|e| e.dot(d) < 0.0 || !same_direction(*e, d))
        {
            directions.push(d);
        }
    }
    let mut translations: Vec<Translation> = directions
        .iter()
        .filter_map(|&d| translation(assembly, group, others, d))
        .collect();
    for i in 0..translations.len() {
        let d = DVec3::from_array(translations[i].direction);
        translations[i].two_sided = translations
            .iter()
            .any(|t| DVec3::from_array(t.direction).dot(d) < -0.999_999);
    }
    translations.sort_by_key(|t| t.reach as u8);
    let rotations = found
        .axes
        .iter()
        .filter_map(|axis| rotation(assembly, group, others, axis))
        .collect();
    Freedoms {
        lines: cone.lines.len(),
        rays,
        translations,
        rotations,
    }
}

/// Most extreme rays of which each is followed.
const MOST_RAYS: usize = 8;

/// Leaves of many rays (those of a round cone) the ones farthest from each other, and adds their middle.
fn few(rays: &mut Vec<DVec3>) {
    if rays.len() <= MOST_RAYS {
        return;
    }
    let middle = rays.iter().sum::<DVec3>().try_normalize();
    let mut kept = vec![rays[0]];
    while kept.len() < MOST_RAYS {
        let far = |r: &DVec3| kept.iter().map(|k| k.dot(*r)).fold(-1.0, f64::max);
        match rays.iter().min_by(|a, b| far(a).total_cmp(&far(b))) {
            Some(&farthest) => kept.push(farthest),
            None => break,
        }
    }
    kept.extend(middle);
    *rays = kept;
}

/// Travel after which the group is beyond all of `others` along `direction`, mm.
pub fn leaving_mm(assembly: &Assembly, group: &Moved<'_>, others: &[usize], direction: DVec3) -> f64 {
    let reach = |parts: &[usize], by, sign: f64| {
        parts
            .iter()
            .map(|&p| {
                let (low, high) = assembly.bounds(p, by);
                let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
                sign * center.dot(direction) + half.dot(direction.abs())
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    (reach(others, glam::DAffine3::IDENTITY, 1.0) + reach(group.parts, group.by, -1.0)).max(0.0) + 1.0
}

fn translation(
    assembly: &Assembly,
    group: &Moved<'_>,
    others: &[usize],
    direction: DVec3,
) -> Option<Translation> {
    if assembly
        .free_share(group, others, &Motion::slide(direction * STEP_MM), STEP_MM / 4.0)
        .0
        < 1.0
    {
        return None;
    }
    let far = leaving_mm(assembly, group, others, direction);
    let (share, pair) = assembly.touch_share(group, others, &Motion::slide(direction * far), SEARCH_STEP_MM);
    let range = share * far;
    Some(Translation {
        direction: direction.to_array(),
        two_sided: false,
        reach: match pair {
            None => Reach::Out,
            Some(_) if range <= PLAY_MM => Reach::Play,
            Some(_) => Reach::Limited,
        },
        range_mm: pair.map(|_| range),
        meets: pair.map(|[_, other]| other),
    })
}

fn rotation(assembly: &Assembly, group: &Moved<'_>, others: &[usize], axis: &Line) -> Option<Rotation> {
    let arm = group
        .parts
        .iter()
        .map(|&p| {
            let pose = group.by * assembly.placement(p);
            let far = |q: DVec3| {
                (pose.transform_point3(q) - axis.point)
                    .reject_from_normalized(axis.direction)
                    .length()
            };
            assembly
                .body(p)
                .samples()
                .iter()
                .map(|s| far(s.position))
                .fold(0.0, f64::max)
        })
        .fold(0.0, f64::max);
    if arm < 1e-6 {
        return None;
    }
    let turn = |angle: f64| Motion::turn(axis.point, axis.direction, angle);
    let step = STEP_MM / arm;
    let free = [-1.0, 1.0].map(|s| {
        assembly
            .free_share(group, others, &turn(s * step), STEP_MM / 4.0)
            .0
            >= 1.0
    });
    if !free[0] && !free[1] {
        return None;
    }
    let mut range = [0.0; 2];
    for (i, sign) in [-1.0, 1.0].into_iter().enumerate() {
        if !free[i] {
            continue;
        }
        let (share, pair) = assembly.touch_share(group, others, &turn(sign * TAU), SEARCH_STEP_MM);
        if pair.is_none() {
            range = [TAU; 2];
            break;
        }
        range[i] = share * TAU;
    }
    let reach = if range == [TAU; 2] {
        Reach::Full
    } else if (range[0] + range[1]) * arm <= PLAY_MM * 2.0 {
        Reach::Play
    } else {
        Reach::Limited
    };
    Some(Rotation {
        point: axis.point.to_array(),
        direction: axis.direction.to_array(),
        reach,
        range_deg: range.map(f64::to_degrees),
    })
}
