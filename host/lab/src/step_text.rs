//! Writer of small STEP texts (AP214, mm): solids of planes and cylinders, placed in one assembly.
//!
//! Numbers are written so that they read back to the same bits.

use std::collections::HashMap;
use std::fmt::Write as _;

use glam::{DAffine3, DVec2, DVec3};
use tempfile::NamedTempFile;

use crate::error::LabError;
use crate::guided;

/// A text under construction.
pub(crate) struct StepText {
    data: String,
    next: u64,
    application: u64,
    context: u64,
    /// Definition and representation of the assembly.
    root: [u64; 2],
}

impl StepText {
    /// An empty assembly.
    pub fn new() -> Self {
        let mut text = Self {
            data: String::new(),
            next: 0,
            application: 0,
            context: 0,
            root: [0; 2],
        };
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
        text.root = text.product("pair", "SHAPE_REPRESENTATION", None);
        text
    }

    /// Adds an entity.
    pub fn add(&mut self, body: &str) -> u64 {
        self.next += 1;
        // Writing to a string does not fail.
        let _ = writeln!(self.data, "#{}={body};", self.next);
        self.next
    }

    /// A point, mm.
    pub fn point(&mut self, p: DVec3) -> u64 {
        self.add(&format!("CARTESIAN_POINT('',{})", triple(p)))
    }

    fn direction(&mut self, d: DVec3) -> u64 {
        self.add(&format!("DIRECTION('',{})", triple(d)))
    }

    /// A frame.
    pub fn axis(&mut self, origin: DVec3, z: DVec3, x: DVec3) -> u64 {
        let (origin, z, x) = (self.point(origin), self.direction(z), self.direction(x));
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }

    /// A vertex.
    pub fn vertex(&mut self, p: DVec3) -> u64 {
        let p = self.point(p);
        self.add(&format!("VERTEX_POINT('',#{p})"))
    }

    /// A straight edge between two vertices at `p` and `q`.
    pub fn straight(&mut self, ends: [u64; 2], [p, q]: [DVec3; 2]) -> u64 {
        let (at, along) = (self.point(p), self.direction((q - p).normalize()));
        let vector = self.add(&format!("VECTOR('',#{along},1.)"));
        let line = self.add(&format!("LINE('',#{at},#{vector})"));
        self.edge(ends, line)
    }

    /// An edge along a curve, in its sense.
    pub fn edge(&mut self, [from, to]: [u64; 2], curve: u64) -> u64 {
        self.add(&format!("EDGE_CURVE('',#{from},#{to},#{curve},.T.)"))
    }

    /// A face of one loop, counter-clockwise seen from outside, on a surface with outward normal.
    pub fn face(&mut self, edges: &[(u64, bool)], surface: u64) -> u64 {
        self.face_of(&[edges], surface, true)
    }

    /// A face of several loops, the outer one first; `outward`: the surface's own normal points outward.
    pub fn face_of(&mut self, loops: &[&[(u64, bool)]], surface: u64, outward: bool) -> u64 {
        let bounds: Vec<u64> = (loops.iter().enumerate())
            .map(|(index, edges)| {
                let oriented: Vec<u64> = (edges.iter())
                    .map(|&(edge, along)| {
                        self.add(&format!("ORIENTED_EDGE('',*,*,#{edge},{})", logical(along)))
                    })
                    .collect();
                let edge_loop = self.add(&format!("EDGE_LOOP('',{})", list(&oriented)));
                let kind = if index == 0 {
                    "FACE_OUTER_BOUND"
                } else {
                    "FACE_BOUND"
                };
                self.add(&format!("{kind}('',#{edge_loop},.T.)"))
            })
            .collect();
        self.add(&format!(
            "ADVANCED_FACE('',{},#{surface},{})",
            list(&bounds),
            logical(outward)
        ))
    }

    /// A plane through `p`.
    pub fn plane(&mut self, p: DVec3, normal: DVec3) -> u64 {
        let axis = self.axis(p, normal, normal.any_orthonormal_vector());
        self.add(&format!("PLANE('',#{axis})"))
    }

    /// A polyhedron: vertices, and the loop of each planar face, counter-clockwise seen from outside.
    pub fn polyhedron(&mut self, corners: &[DVec3], loops: &[Vec<usize>]) -> u64 {
        self.polyhedron_with(corners, loops, &vec![Vec::new(); loops.len()], Vec::new())
    }

    /// The same with holes in each planar face, closed edges clockwise seen from outside, and with further `faces`.
    pub fn polyhedron_with(
        &mut self,
        corners: &[DVec3],
        loops: &[Vec<usize>],
        holes: &[Vec<(u64, bool)>],
        mut faces: Vec<u64>,
    ) -> u64 {
        let vertices: Vec<u64> = corners.iter().map(|&p| self.vertex(p)).collect();
        let mut edges = HashMap::new();
        for (corner, holes) in loops.iter().zip(holes) {
            let next = corner.iter().cycle().skip(1);
            let sides: Vec<(u64, bool)> = (corner.iter().zip(next))
                .map(|(&a, &b)| {
                    let [p, q] = [a.min(b), a.max(b)];
                    let edge = *edges.entry([p, q]).or_insert_with(|| {
                        self.straight([vertices[p], vertices[q]], [corners[p], corners[q]])
                    });
                    (edge, a < b)
                })
                .collect();
            let [p, q, r] = [0, 1, 2].map(|k| corners[corner[k]]);
            let plane = self.plane(p, (q - p).cross(r - q).normalize());
            let bounds: Vec<&[(u64, bool)]> = (std::iter::once(sides.as_slice()))
                .chain(holes.iter().map(std::slice::from_ref))
                .collect();
            faces.push(self.face_of(&bounds, plane, true));
        }
        self.solid(&faces)
    }

    /// A cylinder about z, middle at the origin.
    pub fn cylinder(&mut self, radius: f64, half: f64) -> u64 {
        let ends = [-half, half].map(|z| DVec3::new(radius, 0.0, z));
        let vertices = ends.map(|p| self.vertex(p));
        let circles = [0, 1].map(|end: usize| {
            let axis = self.axis(DVec3::new(0.0, 0.0, ends[end].z), DVec3::Z, DVec3::X);
            let circle = self.add(&format!("CIRCLE('',#{axis},{})", number(radius)));
            self.edge([vertices[end]; 2], circle)
        });
        let seam = self.straight(vertices, ends);
        let axis = self.axis(DVec3::ZERO, DVec3::Z, DVec3::X);
        let side = self.add(&format!("CYLINDRICAL_SURFACE('',#{axis},{})", number(radius)));
        let side = self.face(
            &[
                (circles[0], true),
                (seam, true),
                (circles[1], false),
                (seam, false),
            ],
            side,
        );
        let [bottom, top] = [0, 1].map(|end: usize| {
            let plane = self.plane(DVec3::new(0.0, 0.0, ends[end].z), DVec3::Z * [-1.0, 1.0][end]);
            self.face(&[(circles[end], end == 1)], plane)
        });
        self.solid(&[bottom, side, top])
    }

    /// A ball about the origin.
    pub fn ball(&mut self, radius: f64) -> u64 {
        let pole = self.vertex(DVec3::Z * radius);
        let pole = self.add(&format!("VERTEX_LOOP('',#{pole})"));
        let bound = self.add(&format!("FACE_BOUND('',#{pole},.T.)"));
        let axis = self.axis(DVec3::ZERO, DVec3::Z, DVec3::X);
        let sphere = self.add(&format!("SPHERICAL_SURFACE('',#{axis},{})", number(radius)));
        let face = self.add(&format!("ADVANCED_FACE('',(#{bound}),#{sphere},.T.)"));
        self.solid(&[face])
    }

    /// A solid of these faces.
    pub fn solid(&mut self, faces: &[u64]) -> u64 {
        let shell = self.add(&format!("CLOSED_SHELL('',{})", list(faces)));
        self.add(&format!("MANIFOLD_SOLID_BREP('',#{shell})"))
    }

    /// Adds a part of one solid to the assembly.
    pub fn part(&mut self, name: &str, solid: u64, placement: DAffine3) {
        let [definition, representation] =
            self.product(name, "ADVANCED_BREP_SHAPE_REPRESENTATION", Some(solid));
        let [root, assembly] = self.root;
        let occurrence = self.add(&format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{root},#{definition},$)"
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        let from = self.axis(DVec3::ZERO, DVec3::Z, DVec3::X);
        let to = self.axis(
            placement.translation,
            placement.matrix3.z_axis,
            placement.matrix3.x_axis,
        );
        let transformation = self.add(&format!("ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to})"));
        let relation = self.add(&format!(
            "(REPRESENTATION_RELATIONSHIP('','',#{representation},#{assembly})\
             REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{transformation})SHAPE_REPRESENTATION_RELATIONSHIP())"
        ));
        self.add(&format!(
            "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})"
        ));
    }

    fn product(&mut self, name: &str, kind: &str, solid: Option<u64>) -> [u64; 2] {
        let origin = self.axis(DVec3::ZERO, DVec3::Z, DVec3::X);
        let items: Vec<u64> = solid.into_iter().chain([origin]).collect();
        let (application, context) = (self.application, self.context);
        let representation = self.add(&format!("{kind}('',{},#{context})", list(&items)));
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
        [definition, representation]
    }

    /// A temporary file of the text, removed when dropped: the CAD kernel reads files only.
    ///
    /// # Errors
    /// `Unwritable`.
    pub fn file(&self) -> Result<NamedTempFile, LabError> {
        guided::file(&format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n\
             FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n{}ENDSEC;\nEND-ISO-10303-21;\n",
            self.data
        ))
    }
}

/// Vertices and loops of a prism along z, for [`StepText::polyhedron`]: its outline, counter-clockwise seen from above, and its two heights. Loop 0 is the lower end,
/// loop 1 the upper one, loop 2 + i the side from corner i to the next.
pub(crate) fn prism(outline: &[DVec2], heights: [f64; 2]) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let count = outline.len();
    let corners = (heights.iter())
        .flat_map(|&z| outline.iter().map(move |p| p.extend(z)))
        .collect();
    let low = (0..count).rev().collect();
    let high = (count..2 * count).collect();
    let sides = (0..count).map(|i| {
        let next = (i + 1) % count;
        vec![i, next, count + next, count + i]
    });
    (corners, [low, high].into_iter().chain(sides).collect())
}

/// A number that always has a point or an exponent.
pub(crate) fn number(value: f64) -> String {
    format!("{value:?}").to_uppercase()
}

fn triple(v: DVec3) -> String {
    format!("({},{},{})", number(v.x), number(v.y), number(v.z))
}

/// `(#1,#2)`.
pub(crate) fn list(entities: &[u64]) -> String {
    let names: Vec<String> = entities.iter().map(|entity| format!("#{entity}")).collect();
    format!("({})", names.join(","))
}

fn logical(yes: bool) -> &'static str {
    if yes { ".T." } else { ".F." }
}
