//! Candidate translations for a rotation, by votes of the walls that then face each other.
//!
//! Opposite planes tie the translation to a plane, a shaft and its bore to a line, cones, balls and tori to a point. Ties are combined to points, and
//! each point is rated by the ties that it satisfies within a window; two that hold it from both sides count double.
//!
//! Cost: at most some thousand points a rotation, each rated by a binary search in every direction.

use glam::{DAffine3, DMat3, DVec3};
use mortise_brep::Surface;

use crate::rotations::{MOST_PLAY, PARALLEL_RAD, axis, shaft_in_bore};
use crate::solid::{Solid, Wall};

/// Directions of planes that are combined, clusters of each, and points of each kind returned for a rotation.
const MOST_GROUPS: usize = 10;
const MOST_CLUSTERS: usize = 10;
const MOST_POINTS: usize = 24;

/// A candidate pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Moving solid's frame to the fixed solid's.
    pub pose: DAffine3,
    /// Clearance that is expected, mm.
    pub gap: f64,
    /// Rating: square roots of areas.
    pub rating: f64,
}

/// Translations tied by parallel planes: t·m ≈ one of the values.
struct Group {
    m: DVec3,
    clusters: Vec<Cluster>,
    total: f64,
}

#[derive(Clone, Copy)]
struct Cluster {
    value: f64,
    /// Clearance to either side there, mm.
    gap: f64,
    rating: f64,
}

/// A line or point to which the translation is tied.
struct Tie {
    at: DVec3,
    /// Direction of the line; `None`: a point.
    along: Option<DVec3>,
    gap: f64,
    rating: f64,
    walls: [usize; 2],
}

/// Candidates of `rotation`; ties within `window` mm are one.
pub(crate) fn translations(moving: &Solid, fixed: &Solid, rotation: DMat3, window: f64) -> Vec<Candidate> {
    let groups = groups(moving, fixed, rotation, window);
    let ties = ties(moving, fixed, rotation);
    let mut points: Vec<(DVec3, f64)> = Vec::new();
    // Tied in two directions only: what else touches by chance would be rated higher.
    let mut slides: Vec<(DVec3, f64)> = Vec::new();
    for tie in &ties {
        match tie.along {
            None => points.push((tie.at, tie.gap)),
            Some(along) => {
                let walls = [&moving.walls[tie.walls[0]], &fixed.walls[tie.walls[1]]];
                for value in seats(walls, rotation, along) {
                    points.push((tie.at + (value - tie.at.dot(along)) * along, tie.gap));
                }
                for group in groups.iter().filter(|group| group.m.dot(along).abs() > 0.3) {
                    for cluster in &group.clusters {
                        let by = (cluster.value - tie.at.dot(group.m)) / along.dot(group.m);
                        points.push((tie.at + by * along, tie.gap.max(cluster.gap)));
                    }
                }
            }
        }
    }
    for (i, a) in groups.iter().take(MOST_GROUPS).enumerate() {
        for (j, b) in groups.iter().take(MOST_GROUPS).enumerate().skip(i + 1) {
            let across = a.m.cross(b.m);
            if across.length() < 0.1 {
                continue;
            }
            for c in groups.iter().take(MOST_GROUPS).skip(j + 1) {
                let rows = DMat3::from_cols(a.m, b.m, c.m).transpose();
                if rows.determinant().abs() < 0.1 {
                    continue;
                }
                let inverse = rows.inverse();
                for x in a.clusters.iter().take(MOST_CLUSTERS) {
                    for y in b.clusters.iter().take(MOST_CLUSTERS) {
                        for z in c.clusters.iter().take(MOST_CLUSTERS) {
                            let gap = x.gap.max(y.gap).max(z.gap);
                            points.push((inverse * DVec3::new(x.value, y.value, z.value), gap));
                        }
                    }
                }
            }
            let along = across.normalize();
            // The third direction may be a slide: the boxes' middles tie it.
            let rows = DMat3::from_cols(a.m, b.m, along).transpose();
            let inverse = rows.inverse();
            let middle = along.dot(fixed.middle() - rotation * moving.middle());
            for x in a.clusters.iter().take(MOST_CLUSTERS) {
                for y in b.clusters.iter().take(MOST_CLUSTERS) {
                    slides.push((inverse * DVec3::new(x.value, y.value, middle), x.gap.max(y.gap)));
                }
            }
        }
    }
    let mut kept: Vec<Candidate> = Vec::new();
    for points in [points, slides] {
        let mut rated: Vec<(f64, DVec3, f64)> = (points.into_iter())
            .map(|(t, gap)| (rating(t, &groups, &ties, window), t, gap))
            .collect();
        rated.sort_by(|a, b| b.0.total_cmp(&a.0));
        let most = kept.len() + MOST_POINTS;
        for (rating, t, gap) in rated {
            if kept.len() == most {
                break;
            }
            let near = |known: &Candidate| known.pose.translation.distance(t) < 0.5 * window;
            if !kept.iter().any(near) {
                kept.push(Candidate {
                    pose: DAffine3::from_mat3_translation(rotation, t),
                    gap,
                    rating,
                });
            }
        }
    }
    kept
}

/// Coordinates along `along` that lay the walls' middles, or one pair of ends, on each other.
fn seats(walls: [&Wall; 2], rotation: DMat3, along: DVec3) -> [f64; 3] {
    let [a, b] = [
        walls[0].extent(along, |p| rotation * p),
        walls[1].extent(along, |p| p),
    ];
    [(b[0] + b[1] - a[0] - a[1]) / 2.0, b[0] - a[0], b[1] - a[1]]
}

fn rating(t: DVec3, groups: &[Group], ties: &[Tie], window: f64) -> f64 {
    let planes: f64 = (groups.iter())
        .map(|group| {
            let v = t.dot(group.m);
            (group.clusters.iter())
                .filter(|cluster| (cluster.value - v).abs() < window)
                .map(|cluster| cluster.rating)
                .fold(0.0, f64::max)
        })
        .sum();
    let rounds: f64 = (ties.iter())
        .filter(|tie| {
            let d = t - tie.at;
            match tie.along {
                Some(along) => d.reject_from_normalized(along).length() < window,
                None => d.length() < window,
            }
        })
        .map(|tie| tie.rating)
        .sum();
    planes + rounds
}

fn groups(moving: &Solid, fixed: &Solid, rotation: DMat3, window: f64) -> Vec<Group> {
    // Value and rating of every pair of opposite planes, by direction.
    let mut raw: Vec<(DVec3, Vec<Opposite>)> = Vec::new();
    for a in &moving.walls {
        let Surface::Plane { frame: f } = a.surface else {
            continue;
        };
        let n = rotation * f.z;
        for b in &fixed.walls {
            let Surface::Plane { frame: g } = b.surface else {
                continue;
            };
            if n.dot(g.z) > 0.0 || n.cross(g.z).length() > 2.0 * PARALLEL_RAD {
                continue;
            }
            let index = match raw
                .iter()
                .position(|(m, _)| m.cross(g.z).length() < 2.0 * PARALLEL_RAD)
            {
                Some(index) => index,
                None => {
                    raw.push((g.z, Vec::new()));
                    raw.len() - 1
                }
            };
            let m = raw[index].0;
            raw[index].1.push(Opposite {
                value: m.dot(g.origin - rotation * f.origin),
                own: m.dot(rotation * f.origin),
                rating: a.area.min(b.area).sqrt(),
                up: m.dot(g.z) > 0.0,
            });
        }
    }
    let mut out: Vec<Group> = raw
        .into_iter()
        .map(|(m, values)| group(m, values, window))
        .collect();
    out.sort_by(|a, b| b.total.total_cmp(&a.total));
    out
}

/// Two planes that face each other: the translation along the group's direction at which they touch.
#[derive(Clone, Copy)]
struct Opposite {
    value: f64,
    /// Place of the moving plane along that direction, before the translation.
    own: f64,
    rating: f64,
    /// Whether the fixed one's outward normal is along the group's direction.
    up: bool,
}

/// Clusters of values within `window`; a cluster held from both sides counts double.
fn group(m: DVec3, mut values: Vec<Opposite>, window: f64) -> Group {
    values.sort_by(|a, b| a.value.total_cmp(&b.value));
    let mut clusters = Vec::new();
    let mut start = 0;
    while start < values.len() {
        let mut end = start + 1;
        while end < values.len() && values[end].value - values[start].value < window {
            end += 1;
        }
        let members = &values[start..end];
        let side = |up: bool| -> (f64, f64) {
            let mut weight = 0.0;
            let mut sum = 0.0;
            for member in members.iter().filter(|member| member.up == up) {
                weight += member.rating;
                sum += member.rating * member.value;
            }
            (weight, sum)
        };
        let [(up, up_sum), (down, down_sum)] = [side(true), side(false)];
        let (value, rating) = if up > 0.0 && down > 0.0 {
            ((up_sum / up + down_sum / down) / 2.0, 2.0 * (up + down))
        } else {
            ((up_sum + down_sum) / (up + down), up + down)
        };
        clusters.push(Cluster {
            value,
            gap: 0.0,
            rating,
        });
        start = end;
    }
    clusters.extend(between(&values, window));
    clusters.sort_by(|a, b| b.rating.total_cmp(&a.rating));
    Group {
        m,
        total: clusters.iter().take(3).map(|cluster| cluster.rating).sum(),
        clusters,
    }
}

/// Values half-way between two planes of the fixed solid that hold two of the moving one from both sides with more play than `window`, as a key has in its
/// slot: at most [`MOST_PLAY`] of its width.
fn between(values: &[Opposite], window: f64) -> impl Iterator<Item = Cluster> {
    let pairs = (values.iter().enumerate()).flat_map(|(i, low)| {
        // From the lower value a plane keeps the part from going lower, from the higher one from going higher.
        values[i + 1..].iter().map(move |high| (low, high))
    });
    pairs.filter_map(move |(low, high)| {
        let play = high.value - low.value;
        let held = low.up && !high.up && play >= window;
        (held && play < MOST_PLAY * (high.own - low.own).abs()).then(|| {
            let gap = play / 2.0;
            Cluster {
                value: low.value + gap,
                gap,
                // A looser fit counts less.
                rating: 2.0 * (low.rating + high.rating) / (1.0 + gap),
            }
        })
    })
}

fn ties(moving: &Solid, fixed: &Solid, rotation: DMat3) -> Vec<Tie> {
    let mut out = Vec::new();
    for (i, a) in moving.walls.iter().enumerate() {
        for (j, b) in fixed.walls.iter().enumerate() {
            if a.side == b.side {
                continue;
            }
            if let (Some(x), Some(y)) = (axis(&a.surface), axis(&b.surface))
                && (rotation * x).cross(y).length() > 2.0 * PARALLEL_RAD
            {
                continue;
            }
            let tied = match (a.surface, b.surface) {
                (Surface::Cylinder { frame: f, .. }, Surface::Cylinder { frame: g, .. }) => {
                    shaft_in_bore(a, b).map(|gap| (g.origin - rotation * f.origin, Some(g.z), gap))
                }
                (
                    Surface::Cone {
                        frame: f,
                        radius: r,
                        half_angle: x,
                    },
                    Surface::Cone {
                        frame: g,
                        radius: s,
                        half_angle: y,
                    },
                ) => {
                    let same = (rotation * f.z).dot(g.z).signum();
                    let apex = |origin: DVec3, z: DVec3, radius: f64, angle: f64| {
                        origin - z * (radius / angle.tan())
                    };
                    ((x * same - y).abs() < 2e-3 && x.abs() > 1e-3).then(|| {
                        (
                            apex(g.origin, g.z, s, y) - rotation * apex(f.origin, f.z, r, x),
                            None,
                            0.0,
                        )
                    })
                }
                (Surface::Sphere { frame: f, radius: r }, Surface::Sphere { frame: g, radius: s }) => {
                    let play = if a.side == mortise_mating::Side::Convex {
                        s - r
                    } else {
                        r - s
                    };
                    (play > -1e-3 && play < 0.05 * r.min(s))
                        .then(|| (g.origin - rotation * f.origin, None, play))
                }
                (
                    Surface::Torus {
                        frame: f,
                        major: r,
                        minor: x,
                    },
                    Surface::Torus {
                        frame: g,
                        major: s,
                        minor: y,
                    },
                ) => ((r - s).abs() < 0.02 * r && (x - y).abs() < 0.1 * x)
                    .then(|| (g.origin - rotation * f.origin, None, (x - y).abs())),
                _ => None,
            };
            if let Some((at, along, gap)) = tied {
                // A looser fit counts less.
                let closeness = 1.0 / (1.0 + gap);
                out.push(Tie {
                    at,
                    along,
                    gap,
                    rating: 4.0 * closeness * a.area.min(b.area).sqrt(),
                    walls: [i, j],
                });
            }
        }
    }
    out
}
