//! Common code of the tests: the location of the sample files, and a writer of small STEP texts.

#![allow(dead_code, reason = "each test binary uses its own part of this")]

pub mod check;

use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};

/// The shared test parts, if this machine has them.
pub fn shared() -> Option<PathBuf> {
    let path = match std::env::var_os("MORTISE_SHARED") {
        Some(path) => PathBuf::from(path),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
    };
    let cad = path.join("cad");
    cad.is_dir().then_some(cad)
}

/// A file of `tests/data`.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// A product: its definition and its shape representation.
#[derive(Clone, Copy)]
pub struct Product {
    pub definition: u64,
    pub representation: u64,
}

/// Writes entities one by one; the text is complete at [`StepText::finish`].
pub struct StepText {
    data: String,
    next: u64,
    application: u64,
    context: u64,
}

impl StepText {
    /// A text with lengths in `unit`: the body of a length unit entity, in which `#SI` stands for the metre.
    pub fn new(unit: &str) -> Self {
        let mut text = Self {
            data: String::new(),
            next: 0,
            application: 0,
            context: 0,
        };
        text.context = text.context_in(unit);
        text.application = text.add("APPLICATION_CONTEXT('automotive design')");
        text
    }

    fn context_in(&mut self, unit: &str) -> u64 {
        let metre = self.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))");
        let unit = unit.replace("#SI", &format!("#{metre}"));
        let length = match unit.split_once(';') {
            // A conversion: first the measure, then the unit with #MEASURE for it.
            Some((measure, unit)) => {
                let measure = self.add(measure);
                self.add(&unit.replace("#MEASURE", &format!("#{measure}")))
            }
            None => self.add(&unit),
        };
        let angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
        let solid_angle = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
        let uncertainty = self.add(&format!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),#{length},'accuracy','')"
        ));
        self.add(&format!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty}))\
             GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid_angle}))REPRESENTATION_CONTEXT('',''))"
        ))
    }

    pub fn millimetres() -> Self {
        Self::new("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    }

    pub fn add(&mut self, body: &str) -> u64 {
        self.next += 1;
        self.data += &format!("#{}={body};\n", self.next);
        self.next
    }

    pub fn finish(self) -> String {
        format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n\
             FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n{}ENDSEC;\nEND-ISO-10303-21;\n",
            self.data
        )
    }

    fn triple(v: DVec3) -> String {
        // {:?} of a double always has a point or an exponent, and parses back to the same bits.
        format!("({:?},{:?},{:?})", v.x, v.y, v.z).to_uppercase()
    }

    pub fn point(&mut self, p: DVec3) -> u64 {
        self.add(&format!("CARTESIAN_POINT('',{})", Self::triple(p)))
    }

    pub fn direction(&mut self, d: DVec3) -> u64 {
        self.add(&format!("DIRECTION('',{})", Self::triple(d)))
    }

    pub fn axis(&mut self, origin: DVec3, z: DVec3, x: DVec3) -> u64 {
        let (origin, z, x) = (self.point(origin), self.direction(z), self.direction(x));
        self.add(&format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
    }

    pub fn origin(&mut self) -> u64 {
        self.axis(DVec3::ZERO, DVec3::Z, DVec3::X)
    }

    /// A box from the origin to `size`. With `outward` false its faces point inward.
    pub fn solid_box(&mut self, name: &str, size: DVec3, outward: bool) -> u64 {
        let faces = self.box_faces(size, outward);
        let shell = self.add(&format!("CLOSED_SHELL('',{})", list(&faces)));
        self.add(&format!("MANIFOLD_SOLID_BREP('{name}',#{shell})"))
    }

    /// The faces of a box, the bottom (z = 0) first, without a shell.
    pub fn box_faces(&mut self, size: DVec3, outward: bool) -> Vec<u64> {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64) * size;
        let vertices: Vec<u64> = (0..8)
            .map(|i| {
                let p = self.point(corner(i));
                self.add(&format!("VERTEX_POINT('',#{p})"))
            })
            .collect();
        let mut edges = std::collections::HashMap::new();
        // Corners of each face, counter-clockwise seen from outside.
        const FACES: [[usize; 4]; 6] = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let mut faces = Vec::new();
        for face in FACES {
            let mut oriented = Vec::new();
            for k in 0..4 {
                let (a, b) = (face[k], face[(k + 1) % 4]);
                let key = (a.min(b), a.max(b));
                let edge = match edges.get(&key) {
                    Some(&edge) => edge,
                    None => {
                        let (p, q) = (corner(key.0), corner(key.1));
                        let at = self.point(p);
                        let along = self.direction((q - p).normalize());
                        let vector = self.add(&format!("VECTOR('',#{along},1.)"));
                        let line = self.add(&format!("LINE('',#{at},#{vector})"));
                        let edge = self.add(&format!(
                            "EDGE_CURVE('',#{},#{},#{line},.T.)",
                            vertices[key.0], vertices[key.1]
                        ));
                        edges.insert(key, edge);
                        edge
                    }
                };
                let sense = if a < b { "T" } else { "F" };
                oriented.push(format!(
                    "#{}",
                    self.add(&format!("ORIENTED_EDGE('',*,*,#{edge},.{sense}.)"))
                ));
            }
            let edge_loop = self.add(&format!("EDGE_LOOP('',({}))", oriented.join(",")));
            let sense = if outward { "T" } else { "F" };
            let bound = self.add(&format!("FACE_OUTER_BOUND('',#{edge_loop},.{sense}.)"));
            let [p, q, r] = [corner(face[0]), corner(face[1]), corner(face[2])];
            let axis = self.axis(p, (q - p).cross(r - q).normalize(), (q - p).normalize());
            let plane = self.add(&format!("PLANE('',#{axis})"));
            faces.push(self.add(&format!("ADVANCED_FACE('',(#{bound}),#{plane},.{sense}.)")));
        }
        faces
    }

    /// Colours an item (a face, a solid), sRGB.
    pub fn color(&mut self, item: u64, rgb: [f64; 3]) {
        let [r, g, b] = rgb;
        let color = self.add(&format!("COLOUR_RGB('',{r:?},{g:?},{b:?})"));
        let color = self.add(&format!("FILL_AREA_STYLE_COLOUR('',#{color})"));
        let area = self.add(&format!("FILL_AREA_STYLE('',(#{color}))"));
        let fill = self.add(&format!("SURFACE_STYLE_FILL_AREA(#{area})"));
        let side = self.add(&format!("SURFACE_SIDE_STYLE('',(#{fill}))"));
        let usage = self.add(&format!("SURFACE_STYLE_USAGE(.BOTH.,#{side})"));
        let style = self.add(&format!("PRESENTATION_STYLE_ASSIGNMENT((#{usage}))"));
        let styled = self.add(&format!("STYLED_ITEM('color',(#{style}),#{item})"));
        let context = self.context;
        self.add(&format!(
            "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#{styled}),#{context})"
        ));
    }

    /// A representation of these items.
    pub fn representation(&mut self, kind: &str, items: &[u64]) -> u64 {
        let origin = self.origin();
        let items: Vec<String> = items.iter().chain([&origin]).map(|i| format!("#{i}")).collect();
        let context = self.context;
        self.add(&format!("{kind}('',({}),#{context})", items.join(",")))
    }

    /// A product whose shape is a representation. `name` is written unchanged, including escapes.
    pub fn product(&mut self, name: &str, representation: u64) -> Product {
        let application = self.application;
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
        Product {
            definition,
            representation,
        }
    }

    /// A product of solids.
    pub fn part(&mut self, name: &str, solids: &[u64]) -> Product {
        let representation = self.representation("ADVANCED_BREP_SHAPE_REPRESENTATION", solids);
        self.product(name, representation)
    }

    /// A product without its own shape, for components.
    pub fn assembly(&mut self, name: &str) -> Product {
        let representation = self.representation("SHAPE_REPRESENTATION", &[]);
        self.product(name, representation)
    }

    /// Places `child` in `parent` with a rigid motion.
    pub fn component(&mut self, name: &str, parent: Product, child: Product, motion: DAffine3) {
        let occurrence = self.add(&format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{},#{},$)",
            parent.definition, child.definition
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        let from = self.origin();
        let to = self.axis(motion.translation, motion.matrix3.z_axis, motion.matrix3.x_axis);
        let transformation = self.add(&format!("ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to})"));
        self.related(shape, parent, child, transformation);
    }

    /// Places `child` in `parent` so that the axis `from` of the child coincides with `to` of the parent.
    pub fn component_by_axes(&mut self, name: &str, parent: Product, child: Product, axes: [DAffine3; 2]) {
        let axes = axes.map(|motion| self.axis_of(motion));
        self.component_by_entities(name, parent, child, axes);
    }

    /// The axis placement to which `motion` takes the identity.
    pub fn axis_of(&mut self, motion: DAffine3) -> u64 {
        self.axis(motion.translation, motion.matrix3.z_axis, motion.matrix3.x_axis)
    }

    /// The same for axes that are already written.
    pub fn component_by_entities(&mut self, name: &str, parent: Product, child: Product, axes: [u64; 2]) {
        let occurrence = self.add(&format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{},#{},$)",
            parent.definition, child.definition
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        let [from, to] = axes;
        let transformation = self.add(&format!("ITEM_DEFINED_TRANSFORMATION('','',#{from},#{to})"));
        self.related(shape, parent, child, transformation);
    }

    /// Places `child` in `parent` with the two representations, and their axes, listed in reverse order.
    pub fn component_reversed(&mut self, name: &str, parent: Product, child: Product, [from, to]: [u64; 2]) {
        let occurrence = self.add(&format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{},#{},$)",
            parent.definition, child.definition
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        let transformation = self.add(&format!("ITEM_DEFINED_TRANSFORMATION('','',#{to},#{from})"));
        self.related(shape, child, parent, transformation);
    }

    /// Starts a new length unit for all following entities: the body of a length unit entity, in which `#SI` stands for the metre.
    pub fn change_unit(&mut self, unit: &str) {
        self.context = self.context_in(unit);
    }

    /// States that the shape of `product` is in the file `name`, in the form that CATIA writes.
    pub fn in_file(&mut self, product: Product, name: &str) {
        let kind = self.add("DOCUMENT_TYPE('geometry')");
        let document = self.add(&format!("DOCUMENT_FILE('{name}','','',#{kind},'',$)"));
        let source = self.add("EXTERNAL_SOURCE(IDENTIFIER(''))");
        let role = self.add("IDENTIFICATION_ROLE('external document id and location',$)");
        self.add(&format!(
            "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('{name}',#{role},#{source},(#{document}))"
        ));
        self.add(&format!("DOCUMENT_REPRESENTATION_TYPE('digital',#{document})"));
        self.add(&format!(
            "APPLIED_DOCUMENT_REFERENCE(#{document},'',(#{}))",
            product.definition
        ));
    }

    /// Places `child` in `parent` with a transformation operator.
    pub fn component_by_operator(&mut self, name: &str, parent: Product, child: Product, operator: u64) {
        let occurrence = self.add(&format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{},#{},$)",
            parent.definition, child.definition
        ));
        let shape = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        self.related(shape, parent, child, operator);
    }

    fn related(&mut self, shape: u64, parent: Product, child: Product, transformation: u64) {
        let relation = self.add(&format!(
            "(REPRESENTATION_RELATIONSHIP('','',#{},#{})REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{transformation})\
             SHAPE_REPRESENTATION_RELATIONSHIP())",
            child.representation, parent.representation
        ));
        self.add(&format!(
            "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})"
        ));
    }

    /// An item that maps `child` to `target` (an axis placement or a transformation operator).
    pub fn mapped(&mut self, child: Product, target: u64) -> u64 {
        let origin = self.origin();
        self.mapped_from(child, origin, target)
    }

    /// The same, with the axis `origin` of `child` that is placed on `target`.
    pub fn mapped_from(&mut self, child: Product, origin: u64, target: u64) -> u64 {
        let map = self.add(&format!(
            "REPRESENTATION_MAP(#{origin},#{})",
            child.representation
        ));
        self.add(&format!("MAPPED_ITEM('',#{map},#{target})"))
    }

    /// The same as [`Self::operator`], written as a complex entity.
    pub fn complex_operator(&mut self, axes: [DVec3; 3], origin: DVec3, scale: f64) -> u64 {
        let [a, b, c] = axes.map(|d| self.direction(d));
        let origin = self.point(origin);
        self.add(&format!(
            "(CARTESIAN_TRANSFORMATION_OPERATOR(#{a},#{b},#{origin},{scale:?})CARTESIAN_TRANSFORMATION_OPERATOR_3D(#{c})\
             FUNCTIONALLY_DEFINED_TRANSFORMATION('','')GEOMETRIC_REPRESENTATION_ITEM()REPRESENTATION_ITEM(''))"
        ))
    }

    /// x ↦ origin + scale · (axis1 axis2 axis3) x.
    pub fn operator(&mut self, axes: [DVec3; 3], origin: DVec3, scale: f64) -> u64 {
        let [a, b, c] = axes.map(|d| self.direction(d));
        let origin = self.point(origin);
        self.add(&format!(
            "CARTESIAN_TRANSFORMATION_OPERATOR_3D('',#{a},#{b},#{origin},{scale:?},#{c})"
        ))
    }
}

/// `(#1,#2)`.
pub fn list(entities: &[u64]) -> String {
    format!(
        "({})",
        entities
            .iter()
            .map(|e| format!("#{e}"))
            .collect::<Vec<_>>()
            .join(",")
    )
}

/// Writes the text to a temporary file, which exists as long as the returned path.
pub fn file(text: &str) -> tempfile::TempPath {
    let file = tempfile::Builder::new()
        .suffix(".step")
        .tempfile()
        .expect("a temporary file");
    std::fs::write(file.path(), text).expect("writing the temporary file");
    file.into_temp_path()
}
