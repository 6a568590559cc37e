//! Files and processes, tested on the program itself: what it must not destroy, and what it must refuse to read.

use std::f64::consts::PI;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use glam::{DAffine3, DQuat, DVec3};
use mortise_brep::{CadModel, load_step};

use super::{Plan, Row};
use crate::LabError;

/// Longest a refusal may take, s.
const REFUSAL_S: f64 = 5.0;

/// Measures every row.
pub(super) fn measure(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (place, text) = (folder()?, pair(plan)?);
    let (kept, tried) = outputs(plan.program, place.path(), &text)?;
    out(Row::exactly(
        format!("outputs refused that would have destroyed something, of {tried}"),
        f64::from(kept),
        "outputs",
        f64::from(tried),
    ));
    for (what, text) in [
        ("an assembly of 2²⁴ parts", bomb(&text)),
        ("a coordinate of 1e308", huge(&text)),
    ] {
        let took = refusal(plan.program, place.path(), text)?;
        let row = Row::at_most(
            format!("{what} refused in one line after (infinite: not refused)"),
            took,
            "s",
            REFUSAL_S,
        );
        out(row.varies());
    }
    external_set(plan, out)
}

fn folder() -> Result<tempfile::TempDir, LabError> {
    tempfile::tempdir().map_err(|source| LabError::Unwritable {
        path: std::env::temp_dir(),
        source,
    })
}

/// Text of the thesis pair.
fn pair(plan: &Plan<'_>) -> Result<String, LabError> {
    std::fs::read_to_string(plan.pair).map_err(|source| LabError::Unreadable {
        path: plan.pair.to_owned(),
        source,
    })
}

/// Inches per millimetre.
const INCH: f64 = 1.0 / 25.4;
/// Number of placements of the pair.
const PLACES: usize = 8;
/// Distance along a part's axes of the points whose positions are compared, mm.
const REACH_MM: f64 = 100.0;

/// The pair placed several times in an assembly in inches, each time by a rotated and translated axis placement of its own: in one file, and from an
/// external file. Both must have all parts, each where item 2 · (item 1)⁻¹ of ISO 10303-43 places it.
///
/// # Errors
/// When the pair or a file made from it cannot be read.
pub fn external_set(plan: &Plan<'_>, out: &mut dyn FnMut(Row)) -> Result<(), LabError> {
    let (place, text) = (folder()?, pair(plan)?);
    let (place, text) = (place.path(), text.as_str());
    let write = |name: &str, text: &str| {
        let path = place.join(name);
        std::fs::write(&path, text)
            .map(|()| path.clone())
            .map_err(|source| LabError::Unwritable { path, source })
    };
    let alone = load_step(write("pair.step", text)?)?;
    let mut models = Vec::new();
    for (name, text) in [("flat.step", flat(text)), ("set.step", Some(set()))] {
        models.push(match text {
            Some(text) => load_step(write(name, &text)?)?,
            None => CadModel::default(),
        });
    }
    let wanted: Vec<(&str, DAffine3)> = (0..PLACES)
        .flat_map(|i| {
            let motion = given(i) * own(i).inverse();
            alone
                .parts
                .iter()
                .map(move |part| (part.name.as_str(), motion * part.placement))
        })
        .collect();
    let right = |model: &CadModel| {
        let shapes = |model: &CadModel| model.shapes.len();
        model.parts.len() == wanted.len() && shapes(model) == shapes(&alone) && !alone.parts.is_empty()
    };
    let what =
        format!("external set in another unit, placed {PLACES} times by axes of its own, and the flat file");
    let sound = models.iter().all(right);
    out(Row::exactly(
        format!("{what}: parts of the set"),
        if sound {
            models[1].parts.len() as f64
        } else {
            f64::NAN
        },
        "parts",
        wanted.len() as f64,
    ));
    let mut farthest = if sound { 0.0f64 } else { f64::NAN };
    for model in &models {
        let mut left: Vec<&(&str, DAffine3)> = wanted.iter().collect();
        for part in &model.parts {
            // The nearest of the parts of this name, each used once.
            let far = |wanted: &DAffine3| {
                let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|point| REACH_MM * point);
                let apart = |p: DVec3| {
                    part.placement
                        .transform_point3(p)
                        .distance(wanted.transform_point3(p))
                };
                points.map(apart).into_iter().fold(0.0, f64::max)
            };
            let nearest = (0..left.len())
                .filter(|&i| part.name.starts_with(left[i].0))
                .min_by(|&a, &b| far(&left[a].1).total_cmp(&far(&left[b].1)));
            farthest = match nearest {
                Some(nearest) => farthest.max(far(&left.swap_remove(nearest).1)),
                None => f64::NAN,
            };
            if farthest.is_nan() {
                break;
            }
        }
        if !left.is_empty() {
            farthest = f64::NAN;
        }
    }
    out(Row::at_most(
        format!("{what}: farthest that a point of a part lies from where ISO 10303-43 puts it"),
        farthest,
        "mm",
        1e-6,
    ));
    Ok(())
}

/// Axis placement of the pair, mm.
fn own(i: usize) -> DAffine3 {
    let i = i as f64;
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4 * i - PI, 0.3 * i, 0.2 + 0.7 * i);
    DAffine3::from_rotation_translation(turn, DVec3::new(7.0 - 3.0 * i, 11.0 * i, -5.0))
}

/// Axis placement in the assembly onto which that of the pair is mapped, mm.
fn given(i: usize) -> DAffine3 {
    let i = i as f64;
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 1.1 * i, 0.5 - 0.2 * i, 0.9 * i);
    DAffine3::from_rotation_translation(turn, DVec3::new(150.0 * i, 20.0, 30.0 - 40.0 * i))
}

/// An assembly in inches of the product definition `#child` with the representation `#shape`, in whose unit a millimetre is `scale`. Entity numbers
/// start at `first`.
fn assembly(first: u64, child: u64, shape: u64, scale: f64) -> String {
    let mut data = String::new();
    let mut next = first;
    let mut add = |body: String| {
        data += &format!("#{next}={body};\n");
        next += 1;
        next - 1
    };
    let context = inches(&mut add);
    let axes: Vec<[u64; 2]> = (0..PLACES)
        .map(|i| [(own(i), scale), (given(i), INCH)].map(|(motion, scale)| axis(&mut add, motion, scale)))
        .collect();
    let origin = axis(&mut add, DAffine3::IDENTITY, 1.0);
    let (definition, root) = product(&mut add, "assembly", context, origin);
    for (i, [own, given]) in axes.into_iter().enumerate() {
        let occurrence = add(format!(
            "NEXT_ASSEMBLY_USAGE_OCCURRENCE('{i}','pair {i}','',#{definition},#{child},$)"
        ));
        let placed = add(format!("PRODUCT_DEFINITION_SHAPE('','',#{occurrence})"));
        let motion = add(format!("ITEM_DEFINED_TRANSFORMATION('','',#{own},#{given})"));
        let relation = add(format!(
            "(REPRESENTATION_RELATIONSHIP('','',#{shape},#{root})REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{motion})\
             SHAPE_REPRESENTATION_RELATIONSHIP())"
        ));
        add(format!(
            "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{placed})"
        ));
    }
    data
}

/// A representation context in inches.
fn inches(add: &mut impl FnMut(String) -> u64) -> u64 {
    let metre = add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))".into());
    let measure = add(format!(
        "LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.0254),#{metre})"
    ));
    let inch = add(format!(
        "(CONVERSION_BASED_UNIT('INCH',#{measure})LENGTH_UNIT()NAMED_UNIT(#{metre}))"
    ));
    let angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))".into());
    let solid = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())".into());
    add(format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{inch},#{angle},#{solid}))\
         REPRESENTATION_CONTEXT('',''))"
    ))
}

fn axis(add: &mut impl FnMut(String) -> u64, motion: DAffine3, scale: f64) -> u64 {
    let triple = |v: DVec3| format!("({:?},{:?},{:?})", v.x, v.y, v.z).to_uppercase();
    let origin = add(format!(
        "CARTESIAN_POINT('',{})",
        triple(scale * motion.translation)
    ));
    let z = add(format!("DIRECTION('',{})", triple(motion.matrix3.z_axis)));
    let x = add(format!("DIRECTION('',{})", triple(motion.matrix3.x_axis)));
    add(format!("AXIS2_PLACEMENT_3D('',#{origin},#{z},#{x})"))
}

/// A product without a shape of its own: its definition and its representation.
fn product(add: &mut impl FnMut(String) -> u64, name: &str, context: u64, origin: u64) -> (u64, u64) {
    let application = add("APPLICATION_CONTEXT('automotive design')".into());
    let mechanical = add(format!("PRODUCT_CONTEXT('',#{application},'mechanical')"));
    let product = add(format!("PRODUCT('{name}','{name}','',(#{mechanical}))"));
    let formation = add(format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"));
    let design = add(format!(
        "PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')"
    ));
    let definition = add(format!("PRODUCT_DEFINITION('design','',#{formation},#{design})"));
    let shape = add(format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"));
    let representation = add(format!("SHAPE_REPRESENTATION('',(#{origin}),#{context})"));
    add(format!(
        "SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})"
    ));
    (definition, representation)
}

/// The pair's text with the assembly added.
fn flat(text: &str) -> Option<String> {
    let (child, shape) = (
        number(text, "PRODUCT_DEFINITION(")?,
        number(text, "SHAPE_REPRESENTATION(")?,
    );
    let end = text.rfind("ENDSEC;")?;
    // The pair is in millimetres.
    let assembly = assembly(1 + largest(text)?, child, shape, 1.0);
    Some(format!("{}{assembly}{}", &text[..end], &text[end..]))
}

/// The assembly alone; the parts that it places are in `pair.step`.
fn set() -> String {
    let mut data = String::new();
    let mut next = 1;
    let mut add = |body: String| {
        data += &format!("#{next}={body};\n");
        next += 1;
        next - 1
    };
    let context = inches(&mut add);
    let origin = axis(&mut add, DAffine3::IDENTITY, 1.0);
    let (child, shape) = product(&mut add, "pair", context, origin);
    let kind = add("DOCUMENT_TYPE('geometry')".into());
    let document = add(format!("DOCUMENT_FILE('pair.step','','',#{kind},'',$)"));
    let source = add("EXTERNAL_SOURCE(IDENTIFIER(''))".into());
    let role = add("IDENTIFICATION_ROLE('external document id and location',$)".into());
    add(format!(
        "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('pair.step',#{role},#{source},(#{document}))"
    ));
    let tie = add(format!("APPLIED_DOCUMENT_REFERENCE(#{document},'',(#{child}))"));
    let assembly = assembly(tie + 1, child, shape, INCH);
    format!(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n\
         FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n{data}{assembly}ENDSEC;\nEND-ISO-10303-21;\n"
    )
}

/// Number of the first entity whose text after the number begins with `before`.
fn number(text: &str, before: &str) -> Option<u64> {
    let at = text
        .find(&format!("= {before}"))
        .or_else(|| text.find(&format!("={before}")))?;
    let start = text[..at].rfind('#')?;
    text[start + 1..at].trim().parse().ok()
}

/// Largest entity number.
fn largest(text: &str) -> Option<u64> {
    let numbers = text.lines().filter_map(|line| {
        let number = line.strip_prefix('#')?.split(['=', ' ']).next()?;
        number.parse().ok()
    });
    numbers.max()
}

/// How many of the dangerous outputs are refused with every file unchanged, and how many there are.
fn outputs(program: &Path, place: &Path, text: &str) -> Result<(u32, u32), LabError> {
    let write = |name: &str, bytes: &[u8]| {
        let path = place.join(name);
        std::fs::write(&path, bytes).map_err(|source| LabError::Unwritable { path, source })
    };
    write("x.step", text.as_bytes())?;
    write("victim", b"precious")?;
    let mut cases = vec![("x.step", true), ("victim", false)];
    #[cfg(unix)]
    {
        let made = std::os::unix::fs::symlink("victim", place.join("link"))
            .and_then(|()| std::fs::hard_link(place.join("x.step"), place.join("hard.step")));
        made.map_err(|source| LabError::Unwritable {
            path: place.to_owned(),
            source,
        })?;
        cases.extend([("link", true), ("hard.step", true), ("/dev/null", true)]);
    }
    let mut kept = 0;
    for &(name, force) in &cases {
        let mut command = Command::new(program);
        command
            .current_dir(place)
            .args(["bake", "x.step", "--cell", "2", "-o", name]);
        command.args(force.then_some("--force"));
        let output = run(command)?;
        let same = |name: &str, bytes: &[u8]| std::fs::read(place.join(name)).is_ok_and(|now| now == bytes);
        let whole = same("x.step", text.as_bytes()) && same("victim", b"precious");
        kept += u32::from(whole && is_refusal(&output));
    }
    Ok((kept, u32::try_from(cases.len()).unwrap_or(u32::MAX)))
}

/// Time until `text` is refused, s; infinite when it is not within a multiple of the bound.
fn refusal(program: &Path, place: &Path, text: Option<String>) -> Result<f64, LabError> {
    let Some(text) = text else {
        return Ok(f64::INFINITY);
    };
    let path = place.join("refused.step");
    std::fs::write(&path, text).map_err(|source| LabError::Unwritable {
        path: path.clone(),
        source,
    })?;
    let begun = Instant::now();
    let mut command = Command::new(program);
    // Its own limit ends a run that would not be refused.
    command.args(["inspect", "--timeout", "20"]).arg(&path);
    let output = run(command)?;
    let words = String::from_utf8_lossy(&output.stderr).contains("not read within");
    let took = begun.elapsed();
    Ok(
        if is_refusal(&output) && !words && took < Duration::from_secs(20) {
            took.as_secs_f64()
        } else {
            f64::INFINITY
        },
    )
}

fn run(mut command: Command) -> Result<Output, LabError> {
    command.output().map_err(|source| LabError::Program {
        program: command.get_program().to_string_lossy().into_owned(),
        source,
    })
}

/// Exit code 2 and one line.
fn is_refusal(output: &Output) -> bool {
    output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).lines().count() == 1
}

/// The text with its first coordinate at 1e308.
fn huge(text: &str) -> Option<String> {
    let start = text.find("CARTESIAN_POINT('',(")? + "CARTESIAN_POINT('',(".len();
    let end = start + text[start..].find(',')?;
    Some(format!("{}1.E308{}", &text[..start], &text[end..]))
}

/// The text with its first product placed twice in an assembly, that twice in the next, 24 levels deep.
fn bomb(text: &str) -> Option<String> {
    let mut child = number(text, "PRODUCT_DEFINITION(")?;
    let mut next = 1 + largest(text)?;
    let mut data = String::new();
    for _ in 0..24 {
        let parent = next;
        data += &format!("#{parent}=PRODUCT_DEFINITION('','',$,$);\n");
        for id in [parent + 1, parent + 2] {
            data += &format!("#{id}=NEXT_ASSEMBLY_USAGE_OCCURRENCE('','','',#{parent},#{child},$);\n");
        }
        child = parent;
        next += 3;
    }
    let end = text.rfind("ENDSEC;")?;
    Some(format!("{}{data}{}", &text[..end], &text[end..]))
}
