//! Solids with exact distances, centred on their centre of mass, metres.

use core::f64::consts::TAU;

use mortise_protocol::image::{FaceRecord, surface_kind};

/// A plane across z at `z`, its outward normal along `sense`·z.
fn plane(z: f64, sense: f32) -> FaceRecord {
    FaceRecord {
        kind: surface_kind::PLANE,
        sense,
        origin: [0.0, 0.0, z as f32],
        axis: [0.0, 0.0, 1.0],
        radius: 0.0,
        second: 0.0,
    }
}

/// A cylinder about z.
fn cylinder(radius: f64, sense: f32) -> FaceRecord {
    FaceRecord {
        kind: surface_kind::CYLINDER,
        radius: radius as f32,
        ..plane(0.0, sense)
    }
}

/// A sample of a surface.
#[derive(Clone, Copy)]
pub struct SurfacePoint {
    pub position: [f64; 3],
    pub normal: [f64; 3],
    pub face: u16,
    pub edge_face: Option<u16>,
}

pub trait Solid {
    /// Exact signed distance, negative inside.
    fn distance(&self, p: [f64; 3]) -> f64;
    /// Nearest face.
    fn face(&self, p: [f64; 3]) -> u16;
    fn face_count(&self) -> u32;
    /// The exact surface under a face, where it has one.
    fn surface(&self, _face: u16) -> Option<FaceRecord> {
        None
    }
    fn half_size(&self) -> [f64; 3];
    fn points(&self) -> Vec<SurfacePoint>;
    /// Volume, and diagonal of the inertia at unit density.
    fn mass_properties(&self) -> (f64, [f64; 3]);
}

/// Cylinder about z. Faces: 0 side, 1 bottom, 2 top.
#[derive(Clone, Copy)]
pub struct Peg {
    pub radius: f64,
    pub half_length: f64,
    /// Points round the circumference.
    pub around: usize,
    /// Rings between the two edges.
    pub rings: usize,
}

impl Solid for Peg {
    fn distance(&self, p: [f64; 3]) -> f64 {
        let radial = p[0].hypot(p[1]) - self.radius;
        let axial = p[2].abs() - self.half_length;
        if radial > 0.0 && axial > 0.0 {
            radial.hypot(axial)
        } else {
            radial.max(axial)
        }
    }

    fn face(&self, p: [f64; 3]) -> u16 {
        let radial = p[0].hypot(p[1]) - self.radius;
        match (radial > p[2].abs() - self.half_length, p[2] < 0.0) {
            (true, _) => 0,
            (false, true) => 1,
            (false, false) => 2,
        }
    }

    fn face_count(&self) -> u32 {
        3
    }

    fn surface(&self, face: u16) -> Option<FaceRecord> {
        Some(match face {
            0 => cylinder(self.radius, 1.0),
            1 => plane(-self.half_length, -1.0),
            _ => plane(self.half_length, 1.0),
        })
    }

    fn half_size(&self) -> [f64; 3] {
        [self.radius, self.radius, self.half_length]
    }

    fn points(&self) -> Vec<SurfacePoint> {
        let mut points = Vec::new();
        for i in 0..self.around {
            let (y, x) = (TAU * i as f64 / self.around as f64).sin_cos();
            for k in 0..self.rings + 2 {
                let t = k as f64 / (self.rings + 1) as f64;
                points.push(SurfacePoint {
                    position: [
                        self.radius * x,
                        self.radius * y,
                        self.half_length * (2.0 * t - 1.0),
                    ],
                    normal: [x, y, 0.0],
                    face: 0,
                    edge_face: if k == 0 {
                        Some(1)
                    } else if k == self.rings + 1 {
                        Some(2)
                    } else {
                        None
                    },
                });
            }
        }
        for (z, face) in [(-1.0, 1), (1.0, 2)] {
            points.push(SurfacePoint {
                position: [0.0, 0.0, z * self.half_length],
                normal: [0.0, 0.0, z],
                face,
                edge_face: None,
            });
        }
        points
    }

    fn mass_properties(&self) -> (f64, [f64; 3]) {
        let volume = core::f64::consts::PI * self.radius * self.radius * 2.0 * self.half_length;
        let across = self.radius * self.radius / 4.0 + self.half_length * self.half_length / 3.0;
        let along = self.radius * self.radius / 2.0;
        (volume, [across, across, along].map(|x| x * volume))
    }
}

/// Shaft with a head on top, about z; the middle of its height is the origin. Faces: 0 shaft, 1 its end, 2 under the head, 3 round the head, 4 top.
#[derive(Clone, Copy)]
pub struct Bolt {
    pub radius: f64,
    pub head: f64,
    /// Half of the whole height.
    pub half_length: f64,
    /// Height of the head.
    pub head_height: f64,
    /// Points round each circle.
    pub around: usize,
}

impl Bolt {
    /// z of the head's underside.
    pub fn seat(&self) -> f64 {
        self.half_length - self.head_height
    }

    /// Half section, from the axis to the axis: an edge for each face.
    fn section(&self) -> [([f64; 2], [f64; 2], u16); 5] {
        let (low, seat, high) = (-self.half_length, self.seat(), self.half_length);
        [
            ([self.radius, low], [self.radius, seat], 0),
            ([0.0, low], [self.radius, low], 1),
            ([self.radius, seat], [self.head, seat], 2),
            ([self.head, seat], [self.head, high], 3),
            ([0.0, high], [self.head, high], 4),
        ]
    }

    /// Distance to the nearest edge of the section, and its face.
    fn nearest(&self, p: [f64; 3]) -> (f64, u16) {
        let q = [p[0].hypot(p[1]), p[2]];
        let edges = self.section().map(|(a, b, face)| {
            let d = [b[0] - a[0], b[1] - a[1]];
            let t = ((q[0] - a[0]) * d[0] + (q[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]);
            let t = t.clamp(0.0, 1.0);
            ((q[0] - a[0] - t * d[0]).hypot(q[1] - a[1] - t * d[1]), face)
        });
        edges.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    }
}

impl Solid for Bolt {
    fn distance(&self, p: [f64; 3]) -> f64 {
        let r = p[0].hypot(p[1]);
        let radius = if p[2] > self.seat() {
            self.head
        } else {
            self.radius
        };
        let inside = r < radius && p[2].abs() < self.half_length;
        self.nearest(p).0 * if inside { -1.0 } else { 1.0 }
    }

    fn face(&self, p: [f64; 3]) -> u16 {
        self.nearest(p).1
    }

    fn face_count(&self) -> u32 {
        5
    }

    fn surface(&self, face: u16) -> Option<FaceRecord> {
        Some(match face {
            0 => cylinder(self.radius, 1.0),
            1 => plane(-self.half_length, -1.0),
            2 => plane(self.seat(), -1.0),
            3 => cylinder(self.head, 1.0),
            _ => plane(self.half_length, 1.0),
        })
    }

    fn half_size(&self) -> [f64; 3] {
        [self.head, self.head, self.half_length]
    }

    fn points(&self) -> Vec<SurfacePoint> {
        let (low, seat, high) = (-self.half_length, self.seat(), self.half_length);
        let circles = [
            (self.radius, low, 0, Some(1)),
            (self.radius, 0.5 * (low + seat), 0, None),
            (0.5 * (self.radius + self.head), seat, 2, None),
            (self.head, seat, 2, Some(3)),
            (self.head, high, 4, Some(3)),
        ];
        let mut points = Vec::new();
        for i in 0..self.around {
            let (y, x) = (TAU * i as f64 / self.around as f64).sin_cos();
            points.extend(circles.map(|(r, z, face, edge_face)| SurfacePoint {
                position: [r * x, r * y, z],
                normal: match face {
                    0 => [x, y, 0.0],
                    2 => [0.0, 0.0, -1.0],
                    _ => [0.0, 0.0, 1.0],
                },
                face,
                edge_face,
            }));
        }
        points
    }

    fn mass_properties(&self) -> (f64, [f64; 3]) {
        // Those of the shaft at full length: the law sets an object's mass and bounds its inertia.
        Peg {
            radius: self.radius,
            half_length: self.half_length,
            around: 0,
            rings: 0,
        }
        .mass_properties()
    }
}

/// Box with an optional through hole along z. Faces: 0 top, 1 bottom, 2 sides, 3 hole.
#[derive(Clone, Copy)]
pub struct Block {
    pub half: [f64; 3],
    /// Radius of the hole, 0 for none.
    pub hole: f64,
    /// Points round each rim of the hole.
    pub around: usize,
    /// Points along x and y of top and bottom, edges included.
    pub across: usize,
}

impl Block {
    fn out(&self, p: [f64; 3]) -> [f64; 3] {
        core::array::from_fn(|a| p[a].abs() - self.half[a])
    }
}

impl Solid for Block {
    fn distance(&self, p: [f64; 3]) -> f64 {
        let d = self.out(p);
        let r = p[0].hypot(p[1]);
        let shell = d[0].max(d[1]).max(d[2]);
        if r < self.hole {
            // In the hole's column: the wall, or the rim above and below it.
            (self.hole - r).hypot(d[2].max(0.0))
        } else if shell > 0.0 {
            d.iter().map(|x| x.max(0.0).powi(2)).sum::<f64>().sqrt()
        } else if self.hole > 0.0 {
            shell.max(self.hole - r)
        } else {
            shell
        }
    }

    fn face(&self, p: [f64; 3]) -> u16 {
        let d = self.out(p);
        let r = p[0].hypot(p[1]);
        let wall = if self.hole > 0.0 { self.hole - r } else { f64::MIN };
        let side = d[0].max(d[1]);
        if wall >= d[2] && wall >= side {
            3
        } else if side > d[2] {
            2
        } else if p[2] > 0.0 {
            0
        } else {
            1
        }
    }

    fn face_count(&self) -> u32 {
        4
    }

    fn surface(&self, face: u16) -> Option<FaceRecord> {
        match face {
            0 => Some(plane(self.half[2], 1.0)),
            1 => Some(plane(-self.half[2], -1.0)),
            3 => Some(cylinder(self.hole, -1.0)),
            // Four planes share one face id: no single surface.
            _ => None,
        }
    }

    fn half_size(&self) -> [f64; 3] {
        self.half
    }

    fn points(&self) -> Vec<SurfacePoint> {
        let mut points = Vec::new();
        for (z, face) in [(1.0, 0), (-1.0, 1)] {
            let normal = [0.0, 0.0, z];
            for i in 0..self.around {
                let (y, x) = (TAU * i as f64 / self.around as f64).sin_cos();
                if self.hole > 0.0 {
                    points.push(SurfacePoint {
                        position: [self.hole * x, self.hole * y, z * self.half[2]],
                        normal,
                        face,
                        edge_face: Some(3),
                    });
                }
            }
            let last = self.across - 1;
            for i in 0..=last {
                for j in 0..=last {
                    let [x, y] =
                        [(i, 0), (j, 1)].map(|(k, a)| self.half[a] * (2.0 * k as f64 / last as f64 - 1.0));
                    let edge = i == 0 || j == 0 || i == last || j == last;
                    if edge || x.hypot(y) > self.hole {
                        points.push(SurfacePoint {
                            position: [x, y, z * self.half[2]],
                            normal,
                            face,
                            edge_face: edge.then_some(2),
                        });
                    }
                }
            }
        }
        points
    }

    fn mass_properties(&self) -> (f64, [f64; 3]) {
        let [x, y, z] = self.half;
        let volume = 8.0 * x * y * z;
        let square = [y * y + z * z, x * x + z * z, x * x + y * y];
        // Without the hole: only fixed parts have one here.
        (volume, square.map(|s| volume * s / 3.0))
    }
}
