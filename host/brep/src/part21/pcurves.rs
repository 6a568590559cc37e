//! Curves of edges without their images on the faces.

use super::exchange::{Exchange, reference};

/// Kinds of curves that contain a curve in space, their argument 1, and its images in the parameters of surfaces.
const WITH_IMAGES: [&str; 3] = ["SURFACE_CURVE", "SEAM_CURVE", "INTERSECTION_CURVE"];

/// Gives every edge its curve in space alone: the images on faces (pcurves) repeat it, and a reader can compute them. Returns whether any edge had them.
pub fn drop(file: &mut Exchange) -> bool {
    let mut dropped = false;
    for edge in 0..file.entities.len() {
        if file.kind(edge) != "EDGE_CURVE" {
            continue;
        }
        if let Some(body) = in_space(file, edge) {
            file.replace(edge, body);
            dropped = true;
        }
    }
    dropped
}

/// Body of the edge with its curve in space; `None` when it has no other.
fn in_space(file: &Exchange, edge: usize) -> Option<String> {
    let arguments = file.arguments(edge);
    let [name, start, end, curve, same] = arguments.as_slice() else {
        return None;
    };
    let curve = file.find(reference(curve)?)?;
    if !WITH_IMAGES.contains(&file.kind(curve)) {
        return None;
    }
    let space = *file.arguments(curve).get(1)?;
    file.find(reference(space)?)?;
    let parts = [*name, *start, *end, space, *same].map(String::from_utf8_lossy);
    Some(format!("EDGE_CURVE({})", parts.join(",")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part21::parse;

    #[test]
    fn edges_refer_to_the_curve_in_space() {
        let text = "ISO-10303-21;HEADER;ENDSEC;DATA;#1=EDGE_CURVE('a,b',#2,#3,#4,.T.);#2=VERTEX_POINT('',#9);#3=VERTEX_POINT('',#9);\
                    #4=SEAM_CURVE('',#5,(#6,#7),.PCURVE_S1.);#5=LINE('',#9,#8);#6=PCURVE('',#9,#8);#7=PCURVE('',#9,#8);#8=VECTOR('',#9,1.);\
                    #9=CARTESIAN_POINT('',(0.,0.,0.));#10=EDGE_CURVE('',#2,#3,#5,.F.);ENDSEC;END-ISO-10303-21;";
        let mut file = parse(text.as_bytes()).expect("a sound text");
        assert!(drop(&mut file));
        assert_eq!(file.body(0), b"EDGE_CURVE('a,b',#2,#3,#5,.T.)");
        assert_eq!(file.body(9), b"EDGE_CURVE('',#2,#3,#5,.F.)");
        assert!(!drop(&mut file));
    }
}
