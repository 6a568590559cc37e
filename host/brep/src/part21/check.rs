//! Checks that the text is valid in all entities on which shapes depend.
//!
//! An entity *matters* when a shape, a placement or the product structure reaches it through references. Faults in entities that matter are errors,
//! because the kernel would drop a solid or crash on them; the same faults in styles, notes and the like are warnings. Cost: a few passes over the
//! entities.

use super::exchange::{Exchange, LARGEST_LENGTH, Part21Error, reference, references};
use super::schema;

/// Types of solids, each of which the kernel turns into a solid.
pub const SOLIDS: &[&str] = &[
    "MANIFOLD_SOLID_BREP",
    "BREP_WITH_VOIDS",
    "FACETED_BREP",
    "FACETED_BREP_AND_BREP_WITH_VOIDS",
];
/// Types of surface models, which a file without solids may contain.
pub const SURFACES: &[&str] = &["SHELL_BASED_SURFACE_MODEL", "FACE_BASED_SURFACE_MODEL"];

/// Largest number of any other kind, such as a knot or a vector's length: its square and cube are still finite.
const LARGEST_NUMBER: f64 = 1e30;

/// Content of a valid text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Content {
    /// Solids that belong to a shape representation, by entity.
    pub solids: Vec<usize>,
    /// Surface models that belong to a shape representation, by entity.
    pub surfaces: Vec<usize>,
    /// Irregularities, as text.
    pub warnings: Vec<String>,
}

/// Checks the text and lists its solids.
///
/// # Errors
/// [`Part21Error::Invalid`] for a dangling, cyclic or mistyped reference, a number that is not a finite double or exceeds the largest size, a radius
/// that is not positive, or an assembly that contains itself.
pub fn check(file: &Exchange) -> Result<Content, Part21Error> {
    let matters = reachable(file, |kinds| kinds.iter().any(|kind| is_root(kind)));
    let mut warnings = Vec::new();
    bad_numbers(file, &matters, &mut warnings)?;
    large_numbers(file, &matters)?;
    dangling(file, &matters, &mut warnings)?;
    cycles(file, &matters)?;
    schema::check(file, &matters)?;
    radii(file, &matters)?;
    assembly_cycles(file)?;
    let represented = reachable(file, |kinds| {
        kinds.iter().any(|kind| kind.ends_with("SHAPE_REPRESENTATION"))
    });
    let of = |list: &[&str]| -> Vec<usize> {
        let is_one = |entity: &usize| {
            represented[*entity] && file.kinds(*entity).iter().any(|kind| list.contains(kind))
        };
        (0..file.entities.len()).filter(is_one).collect()
    };
    let solids = of(SOLIDS);
    let orphans = (0..file.entities.len())
        .filter(|&e| !represented[e] && file.kinds(e).iter().any(|kind| SOLIDS.contains(kind)))
        .map(|e| file.label(e))
        .collect::<Vec<_>>();
    if let Some(first) = orphans.first() {
        warnings.push(format!(
            "{} solids belong to no product and are left out, first {first}",
            orphans.len()
        ));
    }
    Ok(Content {
        solids,
        surfaces: of(SURFACES),
        warnings,
    })
}

/// Types at the roots of shapes, placements and product structure.
fn is_root(kind: &str) -> bool {
    SOLIDS.contains(&kind)
        || SURFACES.contains(&kind)
        || matches!(
            kind,
            "MAPPED_ITEM" | "REPRESENTATION_MAP" | "NEXT_ASSEMBLY_USAGE_OCCURRENCE"
        )
        || matches!(
            kind,
            "SHAPE_DEFINITION_REPRESENTATION" | "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION"
        )
        || kind.ends_with("SHAPE_REPRESENTATION")
}

fn reachable(file: &Exchange, is_start: impl Fn(&[&str]) -> bool) -> Vec<bool> {
    let mut seen = vec![false; file.entities.len()];
    let mut stack: Vec<usize> = (0..seen.len()).filter(|&e| is_start(&file.kinds(e))).collect();
    stack.iter().for_each(|&e| seen[e] = true);
    while let Some(entity) = stack.pop() {
        for next in file.references_of(entity).iter().filter_map(|&id| file.find(id)) {
            if !std::mem::replace(&mut seen[next], true) {
                stack.push(next);
            }
        }
    }
    seen
}

fn bad_numbers(file: &Exchange, matters: &[bool], warnings: &mut Vec<String>) -> Result<(), Part21Error> {
    for (entity, number) in &file.bad_numbers {
        let Some(&counts) = matters.get(*entity as usize) else {
            continue;
        };
        let what = format!(
            "{} has the number {number}, which is not a finite value",
            file.label(*entity as usize)
        );
        if counts {
            return Err(at(file, *entity as usize, what));
        }
        warnings.push(what);
    }
    Ok(())
}

/// Rejects absurdly large lengths: the kernel would compute for minutes and return nothing useful.
fn large_numbers(file: &Exchange, matters: &[bool]) -> Result<(), Part21Error> {
    for &(entity, number) in &file.large_numbers {
        let entity = entity as usize;
        if !matters.get(entity).copied().unwrap_or(false) {
            continue;
        }
        let kind = file.kind(entity);
        let is_length = kind == "CARTESIAN_POINT"
            || kind == "CIRCLE"
            || kind == "ELLIPSE"
            || (kind.ends_with("_SURFACE") && !kind.contains("SPLINE"));
        let largest = if is_length { LARGEST_LENGTH } else { LARGEST_NUMBER };
        if number.abs() > largest {
            let what = format!(
                "{} has the number {number:e}, beyond the largest that is read, {largest:e}",
                file.label(entity)
            );
            return Err(at(file, entity, what));
        }
    }
    Ok(())
}

fn dangling(file: &Exchange, matters: &[bool], warnings: &mut Vec<String>) -> Result<(), Part21Error> {
    let mut harmless = 0;
    let mut first = None;
    for (entity, &counts) in matters.iter().enumerate() {
        for id in file.references_of(entity) {
            if file.find(*id).is_some() {
                continue;
            }
            let what = format!("{} refers to #{id}, which does not exist", file.label(entity));
            if counts {
                return Err(at(file, entity, what));
            }
            harmless += 1;
            first.get_or_insert(what);
        }
    }
    if let Some(first) = first {
        warnings.push(format!(
            "{harmless} dangling references outside the shapes: {first}"
        ));
    }
    Ok(())
}

/// Depth-first search with an explicit stack: a text may chain a million entities.
fn cycles(file: &Exchange, matters: &[bool]) -> Result<(), Part21Error> {
    const NEW: u8 = 0;
    const OPEN: u8 = 1;
    const DONE: u8 = 2;
    let mut state = vec![NEW; file.entities.len()];
    for start in (0..file.entities.len()).filter(|&e| matters[e]) {
        if state[start] != NEW {
            continue;
        }
        let mut stack = vec![(start, 0)];
        state[start] = OPEN;
        while let Some((entity, next)) = stack.last_mut() {
            let Some(&id) = file.references_of(*entity).get(*next) else {
                state[*entity] = DONE;
                stack.pop();
                continue;
            };
            *next += 1;
            let Some(target) = file.find(id) else { continue };
            match state[target] {
                NEW => {
                    state[target] = OPEN;
                    stack.push((target, 0));
                }
                OPEN => {
                    let from = *entity;
                    let what = format!(
                        "{} and {} refer to each other",
                        file.label(target),
                        file.label(from)
                    );
                    return Err(at(file, from, what));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

fn radii(file: &Exchange, matters: &[bool]) -> Result<(), Part21Error> {
    for entity in (0..file.entities.len()).filter(|&e| matters[e]) {
        // Zero is accepted here: some writers close a cone or a loop with a circle of radius zero.
        if !matches!(
            file.kind(entity),
            "CYLINDRICAL_SURFACE" | "SPHERICAL_SURFACE" | "CIRCLE" | "CONICAL_SURFACE"
        ) {
            continue;
        }
        let arguments = file.arguments(entity);
        let radius = arguments
            .get(2)
            .and_then(|a| std::str::from_utf8(a).ok())
            .and_then(|a| a.parse::<f64>().ok());
        if radius.is_none_or(|radius| radius < 0.0) {
            let given = arguments
                .get(2)
                .map_or("nothing".into(), |a| String::from_utf8_lossy(a));
            return Err(at(
                file,
                entity,
                format!("{} has the radius {given}", file.label(entity)),
            ));
        }
    }
    Ok(())
}

/// Rejects a product that contains itself through its components, which would unfold without end.
fn assembly_cycles(file: &Exchange) -> Result<(), Part21Error> {
    use std::collections::HashMap;
    let mut children: HashMap<u64, Vec<(u64, usize)>> = HashMap::new();
    for entity in 0..file.entities.len() {
        if file.kind(entity) != "NEXT_ASSEMBLY_USAGE_OCCURRENCE" {
            continue;
        }
        let arguments = file.arguments(entity);
        let end = |i: usize| arguments.get(i).and_then(|a| reference(a));
        if let (Some(parent), Some(child)) = (end(3), end(4)) {
            children.entry(parent).or_default().push((child, entity));
        }
    }
    // Kahn's algorithm: products without parents are removed until none is left; the remaining ones are in or below a cycle.
    let mut parents: HashMap<u64, usize> = HashMap::new();
    children
        .values()
        .flatten()
        .for_each(|(child, _)| *parents.entry(*child).or_default() += 1);
    let mut free: Vec<u64> = children
        .keys()
        .copied()
        .filter(|p| !parents.contains_key(p))
        .collect();
    while let Some(parent) = free.pop() {
        for (child, _) in children.remove(&parent).unwrap_or_default() {
            if let Some(count) = parents.get_mut(&child) {
                *count -= 1;
                if *count == 0 {
                    free.push(child);
                }
            }
        }
    }
    match children.values().flatten().map(|(_, entity)| *entity).min() {
        Some(entity) => Err(at(
            file,
            entity,
            format!("{} puts an assembly into itself", file.label(entity)),
        )),
        None => Ok(()),
    }
}

/// Number of faces in the shells of a solid or surface model, or `None` when it does not list them directly.
pub fn faces_listed(file: &Exchange, entity: usize) -> Option<usize> {
    let mut shells = file.references_of(entity).to_vec();
    let (mut faces, mut looked_at) = (0, 0);
    while let Some(shell) = shells.pop().and_then(|id| file.find(id)) {
        looked_at += 1;
        // A solid has a handful of shells; a larger number is not a tree of shells.
        if looked_at > 10_000 {
            return None;
        }
        match file.kind(shell) {
            "CLOSED_SHELL" | "OPEN_SHELL" => faces += references(file.arguments(shell).get(1)?).len(),
            "ORIENTED_CLOSED_SHELL" | "ORIENTED_OPEN_SHELL" => {
                shells.extend(file.arguments(shell).get(2).and_then(|a| reference(a)));
            }
            _ => return None,
        }
    }
    Some(faces)
}

fn at(file: &Exchange, entity: usize, what: String) -> Part21Error {
    Part21Error::Invalid {
        line: file.entities[entity].line,
        what,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(data: &str) -> Result<Content, Part21Error> {
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        check(&super::super::parse(text.as_bytes()).unwrap())
    }

    fn fault(data: &str) -> String {
        match checked(data) {
            Err(Part21Error::Invalid { what, .. }) => what,
            other => panic!("{other:?}"),
        }
    }

    const SOLID: &str = "#1=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#2),#9);#2=MANIFOLD_SOLID_BREP('',#3);\
                         #3=CLOSED_SHELL('',(#4));#9=CONTEXT();";

    #[test]
    fn faults_that_reach_a_shape_are_errors() {
        let with = |face: &str| format!("{SOLID}#4=ADVANCED_FACE('',(),#5,.T.);{face}");
        assert!(
            checked(&with(
                "#5=PLANE('',#6);#6=AXIS2_PLACEMENT_3D('',#7,$,$);#7=CARTESIAN_POINT('',(0.,0.,0.));"
            ))
            .is_ok()
        );
        assert!(fault(&with("")).contains("#4 ADVANCED_FACE refers to #5, which does not exist"));
        assert!(fault(&with("#5=CYLINDRICAL_SURFACE('',#6,-5.);#6=AXIS2_PLACEMENT_3D('',#7,$,$);#7=CARTESIAN_POINT('',(0.,0.,0.));")).contains("radius -5."));
        assert!(fault(&with("#5=CYLINDRICAL_SURFACE('',#6,1.E999);#6=AXIS2_PLACEMENT_3D('',#7,$,$);#7=CARTESIAN_POINT('',(0.,0.,0.));")).contains("1.E999"));
        assert!(
            fault(&with("#5=PLANE('',#6);#6=AXIS2_PLACEMENT_3D('',#5,$,$);")).contains("refer to each other")
        );
    }

    #[test]
    fn numbers_beyond_all_sizes_are_named() {
        let with = |x: &str| {
            format!(
                "{SOLID}#4=ADVANCED_FACE('',(),#5,.T.);#5=PLANE('',#6);#6=AXIS2_PLACEMENT_3D('',#7,$,$);\
                 #7=CARTESIAN_POINT('',({x},0.,0.));"
            )
        };
        assert!(checked(&with("-1.E9")).is_ok());
        assert!(fault(&with("1.E308")).contains("#7 CARTESIAN_POINT has the number 1e308"));
        assert!(fault(&with("-1.1E9")).contains("beyond the largest"));
        assert!(checked(&format!("{SOLID}#4=FACE();#20=NOTE(1.E308);")).is_ok());
    }

    #[test]
    fn the_same_faults_in_a_style_are_warnings() {
        let data = format!("{SOLID}#4=FACE();#20=STYLED_ITEM('',(#21),#2);#22=COLOUR(1.E999);");
        assert_eq!(checked(&data).unwrap().warnings.len(), 2);
    }

    #[test]
    fn an_assembly_within_itself_is_named() {
        let data = "#1=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#11,#12,$);#2=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#12,#13,$);\
                    #3=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#13,#12,$);#11=P();#12=P();#13=P();";
        assert!(fault(data).contains("puts an assembly into itself"));
        assert!(checked(&data.replace("#13,#12,$", "#11,#13,$")).is_ok());
    }

    #[test]
    fn solids_and_their_faces_are_counted() {
        let data = format!(
            "{SOLID}#4=FACE();#30=BREP_WITH_VOIDS('',#3,(#31));#31=ORIENTED_CLOSED_SHELL('',*,#3,.F.);"
        );
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        let file = super::super::parse(text.as_bytes()).unwrap();
        let content = check(&file).unwrap();
        assert_eq!(content.solids.len(), 1);
        assert_eq!(
            content.warnings.len(),
            1,
            "the second solid belongs to no representation"
        );
        assert_eq!(faces_listed(&file, file.find(30).unwrap()), Some(2));
    }
}
