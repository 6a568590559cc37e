//! The few rules of ISO 10303-42 whose violation crashes the kernel instead of causing an error: the number of arguments of an entity of geometry or
//! topology, and the family of each reference.
//!
//! Only certain faults are reported: if a family has types not listed here, they are left to the kernel.

use super::exchange::{Exchange, Part21Error, reference};

/// Family of a type, as far as references distinguish it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Family {
    Point,
    Direction,
    Vector,
    Placement,
    Curve,
    Surface,
    Vertex,
    Edge,
    OrientedEdge,
    Loop,
    Bound,
    Face,
    Shell,
    Solid,
    Other,
}

/// One argument.
#[derive(Clone, Copy, Debug)]
enum Argument {
    /// Text, number, flag: not checked.
    Any,
    /// A reference to one of the family.
    One(Family),
    /// The same, `$` or `*`.
    Maybe(Family),
    /// A list of references to the family.
    List(Family),
}

use Argument::{Any, List, Maybe, One};
use Family::{
    Bound, Curve, Direction, Edge, Face, Loop, OrientedEdge, Placement, Point, Shell, Surface, Vector, Vertex,
};

const RULES: &[(&str, &[Argument])] = &[
    ("CARTESIAN_POINT", &[Any, Any]),
    ("DIRECTION", &[Any, Any]),
    ("VECTOR", &[Any, One(Direction), Any]),
    ("AXIS1_PLACEMENT", &[Any, One(Point), Maybe(Direction)]),
    ("AXIS2_PLACEMENT_2D", &[Any, One(Point), Maybe(Direction)]),
    (
        "AXIS2_PLACEMENT_3D",
        &[Any, One(Point), Maybe(Direction), Maybe(Direction)],
    ),
    ("LINE", &[Any, One(Point), One(Vector)]),
    ("CIRCLE", &[Any, One(Placement), Any]),
    ("ELLIPSE", &[Any, One(Placement), Any, Any]),
    ("PLANE", &[Any, One(Placement)]),
    ("CYLINDRICAL_SURFACE", &[Any, One(Placement), Any]),
    ("CONICAL_SURFACE", &[Any, One(Placement), Any, Any]),
    ("SPHERICAL_SURFACE", &[Any, One(Placement), Any]),
    ("TOROIDAL_SURFACE", &[Any, One(Placement), Any, Any]),
    ("VERTEX_POINT", &[Any, One(Point)]),
    ("EDGE_CURVE", &[Any, One(Vertex), One(Vertex), One(Curve), Any]),
    (
        "ORIENTED_EDGE",
        &[Any, Maybe(Vertex), Maybe(Vertex), One(Edge), Any],
    ),
    ("EDGE_LOOP", &[Any, List(OrientedEdge)]),
    ("POLY_LOOP", &[Any, List(Point)]),
    ("VERTEX_LOOP", &[Any, One(Vertex)]),
    ("FACE_BOUND", &[Any, One(Loop), Any]),
    ("FACE_OUTER_BOUND", &[Any, One(Loop), Any]),
    ("ADVANCED_FACE", &[Any, List(Bound), One(Surface), Any]),
    ("FACE_SURFACE", &[Any, List(Bound), One(Surface), Any]),
    ("CLOSED_SHELL", &[Any, List(Face)]),
    ("OPEN_SHELL", &[Any, List(Face)]),
    ("ORIENTED_CLOSED_SHELL", &[Any, Any, One(Shell), Any]),
    ("MANIFOLD_SOLID_BREP", &[Any, One(Shell)]),
    ("FACETED_BREP", &[Any, One(Shell)]),
    ("BREP_WITH_VOIDS", &[Any, One(Shell), List(Shell)]),
];

/// Family of a simple type; `None` when it is not listed here.
fn family(kind: &str) -> Option<Family> {
    Some(match kind {
        "CARTESIAN_POINT" => Point,
        "DIRECTION" => Direction,
        "VECTOR" => Vector,
        "AXIS1_PLACEMENT" | "AXIS2_PLACEMENT_2D" | "AXIS2_PLACEMENT_3D" => Placement,
        "LINE"
        | "CIRCLE"
        | "ELLIPSE"
        | "PARABOLA"
        | "HYPERBOLA"
        | "POLYLINE"
        | "B_SPLINE_CURVE_WITH_KNOTS"
        | "TRIMMED_CURVE"
        | "COMPOSITE_CURVE"
        | "SURFACE_CURVE"
        | "SEAM_CURVE"
        | "INTERSECTION_CURVE"
        | "BEZIER_CURVE"
        | "QUASI_UNIFORM_CURVE"
        | "UNIFORM_CURVE"
        | "OFFSET_CURVE_3D"
        | "PCURVE" => Curve,
        "PLANE"
        | "CYLINDRICAL_SURFACE"
        | "CONICAL_SURFACE"
        | "SPHERICAL_SURFACE"
        | "TOROIDAL_SURFACE"
        | "DEGENERATE_TOROIDAL_SURFACE"
        | "B_SPLINE_SURFACE_WITH_KNOTS"
        | "SURFACE_OF_LINEAR_EXTRUSION"
        | "SURFACE_OF_REVOLUTION"
        | "OFFSET_SURFACE"
        | "BEZIER_SURFACE"
        | "RECTANGULAR_TRIMMED_SURFACE"
        | "CURVE_BOUNDED_SURFACE"
        | "QUASI_UNIFORM_SURFACE"
        | "UNIFORM_SURFACE" => Surface,
        "VERTEX_POINT" => Vertex,
        "EDGE_CURVE" => Edge,
        "ORIENTED_EDGE" => OrientedEdge,
        "EDGE_LOOP" | "POLY_LOOP" | "VERTEX_LOOP" => Loop,
        "FACE_BOUND" | "FACE_OUTER_BOUND" => Bound,
        "ADVANCED_FACE" | "FACE_SURFACE" | "ORIENTED_FACE" => Face,
        "CLOSED_SHELL" | "OPEN_SHELL" | "ORIENTED_CLOSED_SHELL" | "ORIENTED_OPEN_SHELL" => Shell,
        "MANIFOLD_SOLID_BREP" | "BREP_WITH_VOIDS" | "FACETED_BREP" => Family::Solid,
        "PRODUCT"
        | "PRODUCT_DEFINITION"
        | "SHAPE_REPRESENTATION"
        | "ADVANCED_BREP_SHAPE_REPRESENTATION"
        | "COLOUR_RGB"
        | "STYLED_ITEM"
        | "NEXT_ASSEMBLY_USAGE_OCCURRENCE"
        | "PRODUCT_DEFINITION_SHAPE" => Family::Other,
        _ => return None,
    })
}

/// Whether the types listed here are the only ones of the family that the kernel knows.
fn is_closed(family: Family) -> bool {
    matches!(
        family,
        Point | Direction | Vector | Placement | OrientedEdge | Bound | Vertex
    )
}

fn noun(family: Family) -> &'static str {
    match family {
        Point => "cartesian point",
        Direction => "direction",
        Vector => "vector",
        Placement => "placement",
        Curve => "curve",
        Surface => "surface",
        Vertex => "vertex",
        Edge => "edge",
        OrientedEdge => "oriented edge",
        Loop => "loop",
        Bound => "face bound",
        Face => "face",
        Shell => "shell",
        Family::Solid => "solid",
        Family::Other => "entity",
    }
}

/// Checks the entities that matter.
///
/// # Errors
/// [`Part21Error::Invalid`] for the first entity with a wrong number of arguments or a reference to another family.
pub fn check(file: &Exchange, matters: &[bool]) -> Result<(), Part21Error> {
    let rules: std::collections::HashMap<&str, &[Argument]> = RULES.iter().copied().collect();
    for entity in (0..file.entities.len()).filter(|&e| matters[e]) {
        let Some(rule) = rules.get(file.kind(entity)) else {
            continue;
        };
        let arguments = file.arguments(entity);
        let fault = if arguments.len() != rule.len() {
            Some(format!(
                "has {} arguments where {} are due",
                arguments.len(),
                rule.len()
            ))
        } else {
            arguments
                .iter()
                .zip(*rule)
                .find_map(|(given, rule)| fault(file, given, *rule))
        };
        if let Some(fault) = fault {
            let what = format!("{} {fault}", file.label(entity));
            return Err(Part21Error::Invalid {
                line: file.entities[entity].line,
                what,
            });
        }
    }
    Ok(())
}

fn fault(file: &Exchange, given: &[u8], rule: Argument) -> Option<String> {
    let wrong = |given: &[u8], want: Family| {
        let shown = String::from_utf8_lossy(&given[..given.len().min(40)]).into_owned();
        let Some(target) = reference(given) else {
            return Some(format!("has {shown}, which is no reference to a {}", noun(want)));
        };
        // A dangling reference is reported by another check.
        let target = file.find(target)?;
        let found = match family(file.kind(target)) {
            // A misspelt type, unless the entity is complex: types of complex entities are not checked here.
            None if is_closed(want) && !file.kind(target).is_empty() => Family::Other,
            found => found?,
        };
        (found != want).then(|| format!("refers to {}, which is no {}", file.label(target), noun(want)))
    };
    match rule {
        Any => None,
        Maybe(_) if given == b"$" || given == b"*" => None,
        One(want) | Maybe(want) => wrong(given, want),
        List(want) => match given.strip_prefix(b"(").and_then(|g| g.strip_suffix(b")")) {
            None => Some("has no list where one is required".into()),
            Some(b"") => None,
            Some(list) => list.split(|&b| b == b',').find_map(|item| wrong(item, want)),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault_of(data: &str) -> Option<String> {
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        let file = super::super::parse(text.as_bytes()).unwrap();
        match check(&file, &vec![true; file.entities.len()]) {
            Err(Part21Error::Invalid { what, .. }) => Some(what),
            Ok(()) => None,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn wrong_families_and_counts_are_named() {
        let base = "#1=CARTESIAN_POINT('',(0.,0.,0.));#2=DIRECTION('',(0.,0.,1.));";
        assert_eq!(
            fault_of(&format!("{base}#3=AXIS2_PLACEMENT_3D('',#1,#2,$);")),
            None
        );
        let fault = fault_of(&format!("{base}#3=AXIS2_PLACEMENT_3D('',#2,#2,$);")).unwrap();
        assert_eq!(
            fault,
            "#3 AXIS2_PLACEMENT_3D refers to #2 DIRECTION, which is no cartesian point"
        );
        let fault = fault_of(&format!("{base}#3=AXIS2_PLACEMENT_3D('',#1);")).unwrap();
        assert_eq!(fault, "#3 AXIS2_PLACEMENT_3D has 2 arguments where 4 are due");
        let fault = fault_of(&format!("{base}#3=AXIS2_PLACEMENT_3D('',0.,#2,$);")).unwrap();
        assert!(fault.contains("has 0., which is no reference to a cartesian point"));
        let fault = fault_of("#1=EDGE_LOOP('',(#2));#2=FACE_BOUND('',#1,.T.);").unwrap();
        assert_eq!(
            fault,
            "#1 EDGE_LOOP refers to #2 FACE_BOUND, which is no oriented edge"
        );
        let fault = fault_of("#1=VERTEX_POINT('',#2);#2=CARTESAN_POINT('',(0.,0.,0.));").unwrap();
        assert_eq!(
            fault,
            "#1 VERTEX_POINT refers to #2 CARTESAN_POINT, which is no cartesian point"
        );
    }

    #[test]
    fn what_is_not_known_is_left_to_the_kernel() {
        assert_eq!(
            fault_of(
                "#1=EDGE_CURVE('',#2,#2,#3,.T.);#2=VERTEX_POINT('',#4);#3=SPIRAL();#4=CARTESIAN_POINT('',());"
            ),
            None
        );
        assert_eq!(
            fault_of("#1=VERTEX_POINT('',#2);#2=(CARTESIAN_POINT()POINT());"),
            None
        );
    }
}
