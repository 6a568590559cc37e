//! Random pairs of parts that fit, with their designed pose and its alternatives.

use std::f64::consts::TAU;

use fastrand::Rng;
use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::step::{Cap, Patch, Side, Solid, Tube, pair};

/// What the designed pose leaves free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Free {
    /// Nothing.
    Nothing,
    /// A slide along z.
    SlideZ,
    /// A turn about z.
    Spin,
}

/// A pair whose parts fit at the identity, were they not moved.
pub struct Designed {
    /// Name of the kind.
    pub kind: &'static str,
    moving: Solid,
    fixed: Solid,
    /// Displacements of the moving part, beside the identity, at which it fits too.
    pub alternatives: Vec<DAffine3>,
    /// What the designed pose leaves free.
    pub free: Free,
    /// Points of the mating faces, or of the axis, mm.
    points: Vec<DVec3>,
    /// Normals at these points along which alone displacements count; empty: every direction counts.
    normals: Vec<DVec3>,
    /// Largest displacement at which the designed pose is reached, mm.
    pub within: f64,
    /// How the geometry of the moving and of the fixed part is moved.
    moved: [DAffine3; 2],
    /// Gap between the mating faces, mm.
    pub clearance: f64,
}

/// Number of kinds.
pub const KINDS: usize = 11;

impl Designed {
    /// The pair of a seed; the kinds take turns.
    pub fn random(seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let r = &mut rng;
        let mut designed = match seed as usize % KINDS {
            0 => round_flange(r),
            1 => d_plug(r),
            2 => keyed_shaft(r),
            3 => polygon_plug(r),
            4 => star_flange(r),
            5 => regular_flange(r),
            6 => dovetail(r),
            7 => pins(r),
            8 => taper(r),
            9 => lobed(r),
            _ => equal_holes(r),
        };
        designed.moved = [motion(r), motion(r)];
        designed
    }

    /// Its STEP text.
    pub fn text(&self) -> String {
        pair(&self.moving, &self.fixed, self.moved)
    }

    /// Designed pose of the moving part, in the fixed part's frame.
    pub fn pose(&self) -> DAffine3 {
        self.moved[1] * self.moved[0].inverse()
    }

    /// Largest displacement of a mating point from where alternative `index` puts it, free motions apart, mm; `pose` is the moving part's
    /// in the fixed part's frame.
    pub fn error(&self, pose: &DAffine3, index: usize) -> f64 {
        let design = self.moved[1].inverse() * *pose * self.moved[0];
        let rest = self.alternatives[index].inverse() * design;
        let off = |(k, p): (usize, &DVec3)| {
            let d = rest.transform_point3(*p) - *p;
            match (self.free, self.normals.get(k)) {
                (_, Some(n)) => n.dot(d).abs(),
                (Free::SlideZ, _) => d.with_z(0.0).length(),
                (Free::Nothing | Free::Spin, _) => d.length(),
            }
        };
        self.points.iter().enumerate().map(off).fold(0.0, f64::max)
    }
}

fn within(r: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * r.f64()
}

/// 0.02 to 0.1 mm.
fn clearance(r: &mut Rng) -> f64 {
    0.02 * 5f64.powf(r.f64())
}

fn motion(r: &mut Rng) -> DAffine3 {
    let mut number = || 2.0 * r.f64() - 1.0;
    let q = loop {
        let q = DQuat::from_xyzw(number(), number(), number(), number());
        if (0.1..1.0).contains(&q.length()) {
            break q.normalize();
        }
    };
    DAffine3::from_rotation_translation(q, 150.0 * DVec3::new(number(), number(), number()))
}

/// Corner of a profile, and the centre of the arc to the next one.
type Profile = Vec<(DVec2, Option<DVec2>)>;

fn polygon(corners: &[DVec2]) -> Profile {
    corners.iter().map(|&p| (p, None)).collect()
}

fn circle(center: DVec2, radius: f64) -> Profile {
    [1.0, -1.0]
        .map(|sign| (center + DVec2::X * sign * radius, Some(center)))
        .to_vec()
}

/// Corners moved outward so that every side of the polygon moves by `by`.
fn offset(corners: &[DVec2], by: f64) -> Vec<DVec2> {
    let n = corners.len();
    let normal = |k: usize| -(corners[(k + 1) % n] - corners[k]).normalize().perp();
    (0..n)
        .map(|k| {
            let (a, b) = (normal((k + n - 1) % n), normal(k));
            corners[k] + by * (a + b) / (1.0 + a.dot(b))
        })
        .collect()
}

fn tube(low: &Profile, high: &Profile, z: [f64; 2], solid: bool) -> Tube {
    let n = low.len();
    let sides = (0..n).map(|k| {
        let m = (k + 1) % n;
        let row = |profile: &Profile, z: f64| [profile[k].0.extend(z), profile[m].0.extend(z)];
        let (a, b) = (row(low, z[0]), row(high, z[1]));
        match low[k].1 {
            Some(center) => Side::Round(a, b, center.extend(0.0)),
            None => Side::Flat(a, b),
        }
    });
    Tube {
        sides: sides.collect(),
        solid,
    }
}

fn prism(profile: &Profile, z: [f64; 2]) -> Solid {
    Solid {
        tubes: vec![tube(profile, profile, z, true)],
        caps: caps_of(0),
    }
}

fn caps_of(tube: usize) -> Vec<Cap> {
    [0, 1]
        .map(|end| Cap {
            up: end == 1,
            outer: (tube, end),
            holes: Vec::new(),
        })
        .to_vec()
}

/// A block below z = 0 with pockets of these depths; a pocket as deep as the block goes through.
fn block(r: &mut Rng, pockets: Vec<Tube>, reach: f64, height: f64, through: bool) -> Solid {
    let mut side = || reach + 4.0 + 10.0 * r.f64();
    let (a, b, c, d) = (side(), side(), side(), side());
    let corners = [[-a, -b], [c, -b], [c, d], [-a, d]].map(DVec2::from_array);
    let outer = polygon(&corners);
    let mut solid = prism(&outer, [-height, 0.0]);
    for pocket in pockets {
        let index = solid.tubes.len();
        solid.tubes.push(pocket);
        solid.caps[1].holes.push((index, 1));
        if through {
            solid.caps[0].holes.push((index, 0));
        } else {
            solid.caps.push(Cap {
                up: true,
                outer: (index, 0),
                holes: Vec::new(),
            });
        }
    }
    solid
}

/// A plate above z = 0 with bosses below.
fn flange(r: &mut Rng, bosses: Vec<Tube>, reach: f64) -> Solid {
    let mut side = || reach + 1.0 + 4.0 * r.f64();
    let (a, b, c, d) = (side(), side(), side(), side());
    let corners = [[-a, -b], [c, -b], [c, d], [-a, d]].map(DVec2::from_array);
    let thick = within(r, 2.0, 6.0);
    let mut solid = prism(&polygon(&corners), [0.0, thick]);
    for boss in bosses {
        let index = solid.tubes.len();
        solid.tubes.push(boss);
        solid.caps[0].holes.push((index, 1));
        solid.caps.push(Cap {
            up: false,
            outer: (index, 0),
            holes: Vec::new(),
        });
    }
    solid
}

fn straight(profile: &Profile, z: [f64; 2], solid: bool) -> Tube {
    tube(profile, profile, z, solid)
}

fn designed(
    kind: &'static str,
    [moving, fixed]: [Solid; 2],
    free: Free,
    points: Vec<DVec3>,
    clearance: f64,
) -> Designed {
    Designed {
        kind,
        moving,
        fixed,
        alternatives: vec![DAffine3::IDENTITY],
        free,
        points,
        normals: Vec::new(),
        within: 1e-3,
        moved: [DAffine3::IDENTITY; 2],
        clearance,
    }
}

fn ends(corners: &[DVec2], depth: f64) -> Vec<DVec3> {
    (corners.iter())
        .flat_map(|p| [p.extend(-depth), p.extend(0.0)])
        .collect()
}

/// Turns about z by `count` equal steps.
fn turns(count: usize) -> Vec<DAffine3> {
    (0..count)
        .map(|k| DAffine3::from_rotation_z(TAU * k as f64 / count as f64))
        .collect()
}

fn round_flange(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 3.0, 12.0), within(r, 8.0, 25.0), clearance(r));
    let boss = straight(&circle(DVec2::ZERO, radius), [-depth, 0.0], true);
    let hole = straight(&circle(DVec2::ZERO, radius + c), [-depth - 0.6, 0.0], false);
    let moving = flange(r, vec![boss], radius);
    let fixed = block(r, vec![hole], radius, depth + 6.0, false);
    let points = vec![DVec3::ZERO, DVec3::new(0.0, 0.0, -depth)];
    designed("round flange", [moving, fixed], Free::Spin, points, c)
}

fn d_profile(radius: f64, flat: f64) -> Profile {
    let half = (radius * radius - flat * flat).sqrt();
    let (a, b) = (DVec2::new(flat, half), DVec2::new(flat, -half));
    vec![
        (a, Some(DVec2::ZERO)),
        (DVec2::new(-radius, 0.0), Some(DVec2::ZERO)),
        (b, None),
    ]
}

fn d_plug(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 4.0, 12.0), within(r, 8.0, 25.0), clearance(r));
    let flat = radius * within(r, 0.5, 0.85);
    let profile = d_profile(radius, flat);
    let height = within(r, 4.0, 12.0);
    let moving = prism(&profile, [-depth, height]);
    let hole = straight(&d_profile(radius + c, flat + c), [-depth, 0.0], false);
    let fixed = block(r, vec![hole], radius, depth + 5.0, false);
    let corners: Vec<DVec2> = profile.iter().map(|p| p.0).collect();
    let mut out = designed("D plug", [moving, fixed], Free::Nothing, ends(&corners, depth), c);
    // Upside down, turned about the flat's normal: the other end goes in.
    out.alternatives
        .push(DAffine3::from_translation(DVec3::Z * (height - depth)) * DAffine3::from_rotation_x(TAU / 2.0));
    out
}

fn keyed_profile(radius: f64, half: f64, top: f64) -> Profile {
    let y = (radius * radius - half * half).sqrt();
    let at = |x: f64, y: f64| DVec2::new(x, y);
    vec![
        (at(-half, y), Some(DVec2::ZERO)),
        (at(0.0, -radius), Some(DVec2::ZERO)),
        (at(half, y), None),
        (at(half, top), None),
        (at(-half, top), None),
    ]
}

fn keyed_shaft(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 4.0, 12.0), within(r, 8.0, 25.0), clearance(r));
    let (half, top) = (radius * within(r, 0.15, 0.35), radius * within(r, 1.15, 1.4));
    let profile = keyed_profile(radius, half, top);
    let over = within(r, 3.0, 10.0);
    let moving = prism(&profile, [-depth - over, over]);
    let hole = straight(
        &keyed_profile(radius + c, half + c, top + c),
        [-depth, 0.0],
        false,
    );
    let fixed = block(r, vec![hole], top, depth, true);
    let corners: Vec<DVec2> = profile.iter().map(|p| p.0).collect();
    let mut out = designed(
        "keyed shaft",
        [moving, fixed],
        Free::SlideZ,
        ends(&corners, depth),
        c,
    );
    out.alternatives.push(DAffine3::from_rotation_y(TAU / 2.0));
    out
}

fn irregular(r: &mut Rng, count: usize, radius: f64, depth: [f64; 2]) -> Vec<DVec2> {
    (0..count)
        .map(|k| {
            let angle = TAU * (k as f64 + within(r, -0.2, 0.2)) / count as f64;
            DVec2::from_angle(angle) * radius * within(r, depth[0], depth[1])
        })
        .collect()
}

fn polygon_plug(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 5.0, 15.0), within(r, 8.0, 25.0), clearance(r));
    let count = r.usize(3..7);
    let corners = irregular(r, count, radius, [0.85, 1.0]);
    let moving = prism(&polygon(&corners), [-depth, within(r, 4.0, 12.0)]);
    let hole = straight(&polygon(&offset(&corners, c)), [-depth, 0.0], false);
    let fixed = block(r, vec![hole], radius, depth + 5.0, false);
    designed(
        "polygonal plug",
        [moving, fixed],
        Free::Nothing,
        ends(&corners, depth),
        c,
    )
}

fn star_flange(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 6.0, 15.0), within(r, 6.0, 20.0), clearance(r));
    let count = 2 * r.usize(3..6);
    let mut corners = irregular(r, count, radius, [0.85, 1.0]);
    corners.iter_mut().step_by(2).for_each(|p| *p *= 0.6);
    let boss = straight(&polygon(&corners), [-depth, 0.0], true);
    let hole = straight(&polygon(&offset(&corners, c)), [-depth - 0.5, 0.0], false);
    let moving = flange(r, vec![boss], radius);
    let fixed = block(r, vec![hole], radius, depth + 6.0, false);
    designed(
        "star flange",
        [moving, fixed],
        Free::Nothing,
        ends(&corners, depth),
        c,
    )
}

fn regular_flange(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 5.0, 12.0), within(r, 6.0, 20.0), clearance(r));
    let count = r.usize(3..9);
    let corners: Vec<DVec2> = (0..count)
        .map(|k| DVec2::from_angle(TAU * k as f64 / count as f64) * radius)
        .collect();
    let boss = straight(&polygon(&corners), [-depth, 0.0], true);
    let hole = straight(&polygon(&offset(&corners, c)), [-depth - 0.5, 0.0], false);
    let moving = flange(r, vec![boss], radius);
    let fixed = block(r, vec![hole], radius, depth + 6.0, false);
    let mut out = designed(
        "regular flange",
        [moving, fixed],
        Free::Nothing,
        ends(&corners, depth),
        c,
    );
    out.alternatives = turns(count);
    out
}

/// A slider with undercut flanks in a rail along z: both prisms.
fn dovetail(r: &mut Rng) -> Designed {
    let c = clearance(r);
    let (wide, high) = (within(r, 6.0, 15.0), within(r, 4.0, 10.0));
    let [left, right] = [0, 1].map(|_| high * within(r, 0.3, 0.7));
    let at = DVec2::new;
    let slider = [
        at(-wide, 0.0),
        at(wide, 0.0),
        at(wide - right, high),
        at(wide - right - 1.0, high + 6.0),
        at(-wide + left + 1.5, high + 6.0),
        at(-wide + left, high),
    ];
    let groove = offset(&[slider[0], slider[1], slider[2], slider[5]], c);
    let (over, deep) = (within(r, 5.0, 12.0), within(r, 4.0, 9.0));
    // The groove's flanks end at the rail's top, half a millimetre below the slider's waist.
    let top = high - 0.5;
    let on = |p: DVec2, q: DVec2| p.lerp(q, (top - p.y) / (q.y - p.y));
    let (a, b) = (on(groove[1], groove[2]), on(groove[0], groove[3]));
    let rail = [
        at(-wide - over, -deep),
        at(wide + over, -deep),
        at(wide + over, top),
        a,
        groove[1],
        groove[0],
        b,
        at(-wide - over, top),
    ];
    let (long, longer) = (within(r, 15.0, 30.0), within(r, 30.0, 50.0));
    let moving = prism(&polygon(&slider), [-long / 2.0, long / 2.0]);
    let fixed = prism(&polygon(&rail), [-longer / 2.0, longer / 2.0]);
    let corners = [slider[0], slider[1], a, b];
    designed(
        "dovetail",
        [moving, fixed],
        Free::SlideZ,
        ends(&corners, long / 3.0),
        c,
    )
}

fn pins(r: &mut Rng) -> Designed {
    let (depth, c) = (within(r, 6.0, 18.0), clearance(r));
    let count = r.usize(2..5);
    let mut places: Vec<(DVec2, f64)> = Vec::new();
    while places.len() < count {
        let p = DVec2::new(within(r, -20.0, 20.0), within(r, -20.0, 20.0));
        let radius = 2.0 + 0.7 * places.len() as f64;
        if places.iter().all(|(q, s)| q.distance(p) > 3.0 + radius + s) {
            places.push((p, radius));
        }
    }
    let bosses = (places.iter())
        .map(|&(p, radius)| straight(&circle(p, radius), [-depth, 0.0], true))
        .collect();
    let holes = (places.iter())
        .map(|&(p, radius)| straight(&circle(p, radius + c), [-depth - 1.0, 0.0], false))
        .collect();
    let moving = flange(r, bosses, 25.0);
    let fixed = block(r, holes, 25.0, depth + 6.0, false);
    let centers: Vec<DVec2> = places.iter().map(|p| p.0).collect();
    designed("pins", [moving, fixed], Free::Nothing, ends(&centers, depth), c)
}

fn taper(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 7.0, 15.0), within(r, 8.0, 15.0), clearance(r));
    let slope = within(r, 3.0, 8.0f64).to_radians();
    let count = r.usize(3..6);
    let corners = irregular(r, count, radius, [0.85, 1.0]);
    // The same gap everywhere along the normals: floor and sides.
    let at = |z: f64, by: f64| polygon(&offset(&corners, z * slope.tan() + by / slope.cos()));
    let over = 5.0;
    let moving = Solid {
        tubes: vec![tube(&at(0.0, 0.0), &at(depth + over, 0.0), [-depth, over], true)],
        caps: caps_of(0),
    };
    let hole = tube(&at(-c, c), &at(depth, c), [-depth - c, 0.0], false);
    let fixed = block(r, vec![hole], radius + 4.0, depth + 6.0, false);
    designed(
        "taper plug",
        [moving, fixed],
        Free::Nothing,
        ends(&corners, depth),
        c,
    )
}

fn equal_holes(r: &mut Rng) -> Designed {
    let (radius, depth, c) = (within(r, 2.5, 5.0), within(r, 8.0, 15.0), clearance(r));
    let count = r.usize(3..7);
    let pitch = 2.0 * radius + within(r, 4.0, 8.0);
    let places: Vec<DVec2> = (0..count).map(|k| DVec2::new(pitch * k as f64, 0.0)).collect();
    let boss = straight(&circle(DVec2::ZERO, radius), [-depth, 0.0], true);
    let holes = (places.iter())
        .map(|&p| straight(&circle(p, radius + c), [-depth - 1.0, 0.0], false))
        .collect();
    let moving = flange(r, vec![boss], radius);
    let fixed = block(r, holes, pitch * count as f64, depth + 6.0, false);
    let points = vec![DVec3::ZERO, DVec3::new(0.0, 0.0, -depth)];
    let mut out = designed("equal holes", [moving, fixed], Free::Spin, points, c);
    out.alternatives = places
        .iter()
        .map(|p| DAffine3::from_translation(p.extend(0.0)))
        .collect();
    out
}

/// Bulged sides of Bézier patches, through a plate: twisted and tapered without clearance, or straight with one along the radius, which is not the same
/// along every normal, so that the evenest pose is a little beside the designed one.
fn lobed(r: &mut Rng) -> Designed {
    let sides = r.usize(3..7);
    let (radius, height, c) = (
        within(r, 8.0, 18.0),
        within(r, 15.0, 30.0),
        if r.bool() { clearance(r) } else { 0.0 },
    );
    let exact = if c == 0.0 { 1.0 } else { 0.0 };
    let (twist, narrower) = (exact * within(r, -0.3, 0.3), exact * within(r, 0.03, 0.1));
    let chord = 2.0 * radius * (TAU / 2.0 / sides as f64).sin();
    let bulges: Vec<f64> = (0..sides).map(|_| chord * within(r, 0.05, 0.25)).collect();
    let corner = |k: usize, j: usize| {
        let v = j as f64 / 3.0;
        DVec2::from_angle(TAU * k as f64 / sides as f64 + twist * v) * radius * (1.0 + narrower * v)
    };
    let patch = |k: usize| -> Patch {
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let (from, to) = (corner(k, j), corner((k + 1) % sides, j));
                let out = -(to - from).perp().normalize();
                let by = if (1..3).contains(&i) { bulges[k] } else { 0.0 };
                (from.lerp(to, i as f64 / 3.0) + out * by).extend(height * (j as f64 / 3.0 - 1.0) + 5.0)
            })
        })
    };
    let patches: Vec<Patch> = (0..sides).map(patch).collect();
    let span = [within(r, 0.15, 0.35), within(r, 0.6, 0.8)];
    let hole: Vec<Patch> = (patches.iter())
        .map(|patch| patch.map(|row| cut(row, span).map(|p| p + (p.truncate().normalize() * c).extend(0.0))))
        .collect();
    let free = |patches: &[Patch], solid: bool| Tube {
        sides: patches.iter().map(|p| Side::Free(Box::new(*p))).collect(),
        solid,
    };
    let moving = Solid {
        tubes: vec![free(&patches, true)],
        caps: caps_of(0),
    };
    let half = 1.6 * radius + 5.0;
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]].map(DVec2::from_array);
    let z = span.map(|v| height * (v - 1.0) + 5.0);
    let mut fixed = prism(&polygon(&corners), z);
    fixed.tubes.push(free(&hole, false));
    fixed.caps[0].holes.push((1, 0));
    fixed.caps[1].holes.push((1, 1));
    // Near the middle of each patch: the mean of the inner poles, and the normal to the directions between them.
    let points = (hole.iter())
        .map(|p| (p[1][1] + p[1][2] + p[2][1] + p[2][2]) / 4.0)
        .collect();
    let normals = (hole.iter()).map(|p| (p[2][1] - p[1][2]).cross(p[2][2] - p[1][1]).normalize());
    let normals = normals.collect();
    let out = designed("lobed", [moving, fixed], Free::Nothing, points, c);
    Designed {
        normals,
        within: 1e-3 + 0.1 * c,
        ..out
    }
}

/// The part of a cubic Bézier curve between two parameters, by blossoms.
fn cut(p: [DVec3; 4], [from, to]: [f64; 2]) -> [DVec3; 4] {
    let blossom = |t: [f64; 3]| {
        let mut q = p;
        for (level, t) in t.into_iter().enumerate() {
            for k in 0..3 - level {
                q[k] = q[k].lerp(q[k + 1], t);
            }
        }
        q[0]
    };
    [[from, from, from], [from, from, to], [from, to, to], [to, to, to]].map(blossom)
}
