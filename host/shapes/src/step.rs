//! Writer of STEP texts (AP214, mm): solids of tubes between two heights and plane caps, moved as a whole.

use std::collections::HashMap;
use std::fmt::Write as _;

use glam::{DAffine3, DVec3};

/// Poles of a bicubic Bézier patch, u round the tube, v up.
pub type Patch = [[DVec3; 4]; 4];

/// A side of a tube, counter-clockwise round it seen from above: lower and upper corners, from and to.
#[derive(Clone, Debug)]
pub enum Side {
    /// Plane through the corners.
    Flat([DVec3; 2], [DVec3; 2]),
    /// Arc of a cylinder about a vertical axis through a point.
    Round([DVec3; 2], [DVec3; 2], DVec3),
    /// Bézier patch.
    Free(Box<Patch>),
}

impl Side {
    fn corners(&self) -> [[DVec3; 2]; 2] {
        match self {
            Self::Flat(low, high) | Self::Round(low, high, _) => [*low, *high],
            Self::Free(p) => [[p[0][0], p[3][0]], [p[0][3], p[3][3]]],
        }
    }
}

/// A tube: its sides in order, and whether the material is inside.
#[derive(Clone, Debug)]
pub struct Tube {
    /// Its sides, counter-clockwise seen from above.
    pub sides: Vec<Side>,
    /// The material is inside.
    pub solid: bool,
}

/// A horizontal cap: whether it faces up, its outer loop and its holes, each the end (0 low, 1 high) of a tube.
#[derive(Clone, Debug)]
pub struct Cap {
    /// It faces up.
    pub up: bool,
    /// Tube and end of its outer loop.
    pub outer: (usize, usize),
    /// Tubes and ends of its holes.
    pub holes: Vec<(usize, usize)>,
}

/// A solid of tubes and caps.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Tubes.
    pub tubes: Vec<Tube>,
    /// Caps of their ends.
    pub caps: Vec<Cap>,
}

/// A text of two parts, `moving` and `fixed`, each moved by its own placement: the geometry itself, not the part.
pub fn pair(moving: &Solid, fixed: &Solid, moved: [DAffine3; 2]) -> String {
    let mut text = Text::default();
    let length = text.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))");
    let angle = text.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
    let solid = text.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
    let uncertainty = text.add(&format!(
        "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),#{length},'accuracy','')"
    ));
    text.context = text.add(&format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty}))\
         GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid}))REPRESENTATION_CONTEXT('',''))"
    ));
    text.application = text.add("APPLICATION_CONTEXT('automotive design')");
    for (name, solid, place) in [("moving", moving, moved[0]), ("fixed", fixed, moved[1])] {
        text.place = place;
        let brep = text.solid(solid);
        text.product(name, brep);
    }
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n\
         FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n{}ENDSEC;\nEND-ISO-10303-21;\n",
        text.data
    )
}

#[derive(Default)]
struct Text {
    data: String,
    next: u64,
    context: u64,
    application: u64,
    place: DAffine3,
}

type Edges = Vec<u64>;

impl Text {
    fn add(&mut self, body: &str) -> u64 {
        self.next += 1;
        let _ = writeln!(self.data, "#{}={body};", self.next);
        self.next
    }

    fn point(&mut self, p: DVec3) -> u64 {
        let p = self.place.transform_point3(p);
        self.add(&format!("CARTESIAN_POINT('',{})", triple(p)))
    }

    fn direction(&mut self, d: DVec3) -> u64 {
        let d = self.place.transform_vector3(d);
        self.add(&format!("DIRECTION('',{})", triple(d)))
    }

    fn axis(&mut self, origin: DVec3, z: DVec3) -> u64 {
        let x = z.any_orthonormal_vector();
        let (origin, z, x) = (self.point(origin), self.direction(z), self.direction(x));
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }

    fn line(&mut self, ends: [u64; 2], [p, q]: [DVec3; 2]) -> u64 {
        let (at, along) = (self.point(p), self.direction((q - p).normalize()));
        let vector = self.add(&format!("VECTOR('',#{along},1.)"));
        let line = self.add(&format!("LINE('',#{at},#{vector})"));
        self.edge(ends, line)
    }

    fn edge(&mut self, [from, to]: [u64; 2], curve: u64) -> u64 {
        self.add(&format!("EDGE_CURVE('',#{from},#{to},#{curve},.T.)"))
    }

    fn arc(&mut self, ends: [u64; 2], from: DVec3, center: DVec3) -> u64 {
        let axis = self.axis(center.with_z(from.z), DVec3::Z);
        let circle = self.add(&format!(
            "CIRCLE('',#{axis},{:?})",
            from.distance(center.with_z(from.z))
        ));
        self.edge(ends, circle)
    }

    fn bezier(&mut self, ends: [u64; 2], poles: [DVec3; 4]) -> u64 {
        let poles = poles.map(|p| self.point(p));
        let curve = self.add(&format!(
            "B_SPLINE_CURVE_WITH_KNOTS('',3,{},.UNSPECIFIED.,.F.,.F.,(4,4),(0.,1.),.UNSPECIFIED.)",
            list(&poles)
        ));
        self.edge(ends, curve)
    }

    fn face(&mut self, loops: &[Vec<(u64, bool)>], surface: u64, outward: bool) -> u64 {
        let bounds: Vec<u64> = (loops.iter().enumerate())
            .map(|(index, edges)| {
                let oriented: Vec<u64> = (edges.iter())
                    .map(|&(edge, along)| {
                        self.add(&format!("ORIENTED_EDGE('',*,*,#{edge},{})", logical(along)))
                    })
                    .collect();
                let edge_loop = self.add(&format!("EDGE_LOOP('',{})", list(&oriented)));
                let kind = ["FACE_OUTER_BOUND", "FACE_BOUND"][index.min(1)];
                self.add(&format!("{kind}('',#{edge_loop},.T.)"))
            })
            .collect();
        self.add(&format!(
            "ADVANCED_FACE('',{},#{surface},{})",
            list(&bounds),
            logical(outward)
        ))
    }

    fn plane(&mut self, p: DVec3, normal: DVec3) -> u64 {
        let axis = self.axis(p, normal);
        self.add(&format!("PLANE('',#{axis})"))
    }

    fn solid(&mut self, solid: &Solid) -> u64 {
        let mut faces = Vec::new();
        let mut vertices: HashMap<[u64; 3], u64> = HashMap::new();
        let mut rings: Vec<[Edges; 2]> = Vec::new();
        for tube in &solid.tubes {
            let count = tube.sides.len();
            let ends: Vec<[[u64; 2]; 2]> = (tube.sides.iter())
                .map(|side| {
                    side.corners()
                        .map(|row| row.map(|p| self.vertex(&mut vertices, p)))
                })
                .collect();
            let posts: Edges = (0..count)
                .map(|k| match &tube.sides[k] {
                    Side::Free(p) => self.bezier([ends[k][0][0], ends[k][1][0]], p[0]),
                    side => {
                        let [low, high] = side.corners();
                        self.line([ends[k][0][0], ends[k][1][0]], [low[0], high[0]])
                    }
                })
                .collect();
            let ring = [0, 1].map(|end: usize| -> Edges {
                (0..count)
                    .map(|k| {
                        let corners = tube.sides[k].corners()[end];
                        match &tube.sides[k] {
                            Side::Flat(..) => self.line(ends[k][end], corners),
                            Side::Round(_, _, center) => self.arc(ends[k][end], corners[0], *center),
                            Side::Free(p) => self.bezier(ends[k][end], p.map(|row| row[3 * end])),
                        }
                    })
                    .collect()
            });
            for (k, side) in tube.sides.iter().enumerate() {
                let [low, high] = side.corners();
                let surface = match side {
                    Side::Flat(..) => {
                        let out = (low[1] - low[0]).cross(high[0] - low[0]).normalize();
                        self.plane(low[0], if tube.solid { out } else { -out })
                    }
                    Side::Round(_, _, center) => {
                        let axis = self.axis(center.with_z(low[0].z), DVec3::Z);
                        let radius = low[0].distance(center.with_z(low[0].z));
                        self.add(&format!("CYLINDRICAL_SURFACE('',#{axis},{radius:?})"))
                    }
                    Side::Free(p) => self.patch(p),
                };
                let mut edges = vec![
                    (ring[0][k], true),
                    (posts[(k + 1) % count], true),
                    (ring[1][k], false),
                    (posts[k], false),
                ];
                if !tube.solid {
                    edges.reverse();
                    edges.iter_mut().for_each(|edge| edge.1 = !edge.1);
                }
                let natural = matches!(side, Side::Flat(..)) || tube.solid;
                faces.push(self.face(&[edges], surface, natural));
            }
            rings.push(ring);
        }
        for cap in &solid.caps {
            let at = solid.tubes[cap.outer.0].sides[0].corners()[cap.outer.1][0];
            let plane = self.plane(at, if cap.up { DVec3::Z } else { DVec3::NEG_Z });
            let ring = |(tube, end): (usize, usize), forward: bool| -> Vec<(u64, bool)> {
                let edges = rings[tube][end].iter().map(|&edge| (edge, forward));
                if forward {
                    edges.collect()
                } else {
                    edges.rev().collect()
                }
            };
            let mut loops = vec![ring(cap.outer, cap.up)];
            loops.extend(cap.holes.iter().map(|&hole| ring(hole, !cap.up)));
            faces.push(self.face(&loops, plane, true));
        }
        let shell = self.add(&format!("CLOSED_SHELL('',{})", list(&faces)));
        self.add(&format!("MANIFOLD_SOLID_BREP('',#{shell})"))
    }

    fn vertex(&mut self, known: &mut HashMap<[u64; 3], u64>, p: DVec3) -> u64 {
        let key = p.to_array().map(|v| (v * 1e7).round() as i64 as u64);
        if let Some(&vertex) = known.get(&key) {
            return vertex;
        }
        let point = self.point(p);
        let vertex = self.add(&format!("VERTEX_POINT('',#{point})"));
        known.insert(key, vertex);
        vertex
    }

    fn patch(&mut self, patch: &Patch) -> u64 {
        let rows: Vec<String> = (patch.iter())
            .map(|row| list(&row.map(|p| self.point(p))))
            .collect();
        self.add(&format!(
            "B_SPLINE_SURFACE_WITH_KNOTS('',3,3,({}),.UNSPECIFIED.,.F.,.F.,.F.,(4,4),(4,4),(0.,1.),(0.,1.),.UNSPECIFIED.)",
            rows.join(",")
        ))
    }

    fn product(&mut self, name: &str, solid: u64) {
        self.place = DAffine3::IDENTITY;
        let (application, context) = (self.application, self.context);
        let origin = self.axis(DVec3::ZERO, DVec3::Z);
        let representation = self.add(&format!(
            "ADVANCED_BREP_SHAPE_REPRESENTATION('',(#{solid},#{origin}),#{context})"
        ));
        let context = self.add(&format!("PRODUCT_CONTEXT('',#{application},'mechanical')"));
        let product = self.add(&format!("PRODUCT('{name}','{name}','',(#{context}))"));
        let formation = self.add(&format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"));
        let context = self.add(&format!(
            "PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')"
        ));
        let definition = self.add(&format!(
            "PRODUCT_DEFINITION('design','',#{formation},#{context})"
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"));
        self.add(&format!(
            "SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})"
        ));
    }
}

fn triple(v: DVec3) -> String {
    format!("({:?},{:?},{:?})", v.x, v.y, v.z).to_uppercase()
}

fn list(entities: &[u64]) -> String {
    let names: Vec<String> = entities.iter().map(|entity| format!("#{entity}")).collect();
    format!("({})", names.join(","))
}

fn logical(yes: bool) -> &'static str {
    if yes { ".T." } else { ".F." }
}
