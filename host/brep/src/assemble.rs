//! From a file's bytes to a [`CadModel`]: checks the text, passes it to the kernel, names the parts, and accounts for every solid.

use crate::external::{self, Joined, text_error};
use crate::kernel::{self, RawPart, RawResult};
use crate::part21::check::{self, Content};
use crate::part21::structure::Structure;
use crate::part21::{Exchange, operators, pcurves, render, text};
use crate::progress::Progress;
use crate::{BrepError, CadModel, EDGE_TOLERANCE_MM, LoadOptions, Part, free_form, shape};
use glam::{DAffine3, DMat3, DVec3};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Placeholder names that writers use for a body or occurrence without its own name.
const MEANINGLESS: &[&str] = &["", "NONE", "SOLID", "COMPOUND", "COMPSOLID", "SHELL", "SHAPE"];

/// Part of the kernel's reading in the whole: before it the text is read and checked, after it the shapes are described one by one. A text of planes and
/// cylinders takes longer to read than its shapes to describe, splines the reverse.
const KERNEL: Range<f64> = 0.05..0.4;

/// A text that the kernel has read, and the data collected about it.
struct Source {
    file: Exchange,
    content: Content,
    units: Vec<String>,
    files: Vec<PathBuf>,
    document: cxx::UniquePtr<kernel::Document>,
}

/// Checks and rewrites a STEP file and the files it refers to, and passes them to the kernel. The caller holds [`kernel::lock`].
fn read(path: &Path, options: &LoadOptions, progress: &Progress<'_>) -> Result<Source, BrepError> {
    let shown = path.display().to_string();
    let Joined {
        mut file,
        content,
        units,
        files,
        missing,
    } = external::load(path, options)?;
    if content.solids.is_empty() && content.surfaces.is_empty() {
        let mut found = found_instead(&file);
        if !missing.is_empty() {
            found = format!("{found}; missing beside it: {}", missing.join(", "));
        }
        return Err(BrepError::NoShape { path: shown, found });
    }
    // Checked before the kernel reads the text, because the kernel would unfold the assembly.
    let parts = Structure::of(&file).unfolded();
    if parts > options.max_parts as u64 {
        return Err(BrepError::TooManyParts {
            path: shown,
            found: parts,
            limit: options.max_parts,
        });
    }
    operators::split(&mut file).map_err(|e| text_error(&shown, e))?;
    let document = transfer(&shown, &mut file, options, progress)?;
    Ok(Source {
        file,
        content,
        units,
        files,
        document,
    })
}

/// Passes the text to the kernel. By images of edges on faces (pcurves) kernels before version 7.9 can take the wrong side of a face: a ball at the end of a
/// bar becomes a dimple. Where the orientation of faces tells that, the text is read again without them, if that is better.
fn transfer(
    shown: &str,
    file: &mut Exchange,
    options: &LoadOptions,
    progress: &Progress<'_>,
) -> Result<cxx::UniquePtr<kernel::Document>, BrepError> {
    let read = |file: &Exchange| {
        progress.begin(KERNEL);
        kernel::read_document(&render::render(file), options.max_parts, progress)
            .map_err(|e| kernel_error(shown, &e))
    };
    let turned = |document: &kernel::Document| document.results().iter().map(|r| r.turned).sum::<usize>();
    let first = read(file)?;
    let before = turned(&first);
    if before == 0 || !pcurves::drop(file) {
        return Ok(first);
    }
    // What cannot be read without them is kept as first read, with its warning.
    Ok(match read(file) {
        Ok(second) if turned(&second) < before => second,
        _ => first,
    })
}

/// Reads a STEP file and queries the kernel about its shape `shape`, numbered as in [`CadModel::shapes`].
pub fn ask<T>(
    path: &Path,
    options: &LoadOptions,
    shape: usize,
    question: impl FnOnce(&kernel::Document) -> Result<T, cxx::Exception>,
) -> Result<T, BrepError> {
    let _kernel = kernel::lock();
    let document = read(path, options, &Progress::new(&|_| ()))?.document;
    let shown = path.display().to_string();
    let count = document.shape_count();
    if shape >= count {
        return Err(BrepError::NoSuchShape {
            path: shown,
            shape,
            count,
        });
    }
    question(&document).map_err(|e| kernel_error(&shown, &e))
}

fn kernel_error(path: &str, e: &cxx::Exception) -> BrepError {
    let reason = match e.what() {
        "std::bad_alloc" => "out of the memory it may use",
        what => what,
    };
    BrepError::Kernel {
        path: path.into(),
        reason: one_line(reason),
    }
}

/// Reads a STEP file and the files it refers to.
pub fn assemble(path: &Path, options: &LoadOptions, progress: &Progress<'_>) -> Result<CadModel, BrepError> {
    let _kernel = kernel::lock();
    let Source {
        file,
        content,
        units,
        files,
        document,
    } = read(path, options, progress)?;
    let path = path.display().to_string();
    let path = path.as_str();

    let mut warnings = file.warnings.clone();
    warnings.extend(content.warnings.iter().cloned());
    let unit = unit(units, &mut warnings);
    let raw_parts = document.parts();
    let results: HashMap<usize, RawResult> = document
        .results()
        .into_iter()
        .map(|r| (r.entity.wrapping_sub(1), r))
        .collect();
    account(path, &file, &content, &results, options, &mut warnings)?;
    if raw_parts.is_empty() {
        let reason = "it transferred no shape from a text that is sound".into();
        return Err(BrepError::Kernel {
            path: path.into(),
            reason,
        });
    }

    let parts = name_parts(&file, &raw_parts);
    let mut shapes = Vec::with_capacity(document.shape_count());
    let effort: Vec<usize> = (0..document.shape_count())
        .map(|index| document.effort(index))
        .collect();
    let all = effort.iter().sum::<usize>().max(1) as f64;
    let reached = |done: usize| KERNEL.end + (1.0 - KERNEL.end) * done as f64 / all;
    let mut done = 0;
    for (index, effort) in effort.into_iter().enumerate() {
        progress.begin(reached(done)..reached(done + effort));
        done += effort;
        let linear = options.linear_deflection_mm.unwrap_or(0.0);
        let raw = document
            .shape(
                index,
                linear,
                options.relative_deflection,
                options.angular_deflection_rad,
                progress,
            )
            .map_err(|e| kernel_error(path, &e))?;
        let mut notes = Vec::new();
        let free = document
            .free_forms(index, EDGE_TOLERANCE_MM)
            .map_err(|e| kernel_error(path, &e))?;
        let mut shape = shape::convert(raw, options.recognise_mm, &mut notes);
        free_form::add(&mut shape, free);
        shapes.push(shape);
        let owner = parts.iter().find(|p| p.shape == index).map_or("?", |p| &p.name);
        warnings.extend(notes.into_iter().map(|note| format!("{owner}: {note}")));
    }
    for (part, raw) in parts
        .iter()
        .zip(&raw_parts)
        .filter(|(_, raw)| raw.loose_faces > 0)
    {
        let product = part.path.last().unwrap_or(&part.name);
        warnings.push(format!(
            "{product}: {} faces outside its solids are left out",
            raw.loose_faces
        ));
    }
    Ok(CadModel {
        unit,
        shapes,
        parts,
        warnings,
        files,
    })
}

fn found_instead(file: &Exchange) -> String {
    match file.entities.len() {
        0 => "no entities".into(),
        n => {
            let mut counts: HashMap<&str, usize> = HashMap::new();
            (0..n)
                .flat_map(|e| file.kinds(e))
                .filter(|k| k.ends_with("REPRESENTATION"))
                .for_each(|k| {
                    *counts.entry(k).or_default() += 1;
                });
            let most = counts.into_iter().max_by_key(|&(kind, count)| (count, kind));
            most.map_or(format!("{n} entities"), |(kind, count)| {
                format!("{n} entities, {count} {kind}")
            })
        }
    }
}

/// The file's length unit as text for people; every length is already in millimetres.
fn unit(names: Vec<String>, warnings: &mut Vec<String>) -> String {
    if names.len() > 1 {
        warnings.push(format!(
            "length units differ within the file: {}",
            names.join(", ")
        ));
    }
    names.into_iter().next().unwrap_or_else(|| {
        warnings.push("the file names no length unit; millimetre is assumed".into());
        "millimetre".into()
    })
}

/// Checks that every solid of the text became a placed solid of the kernel.
fn account(
    path: &str,
    file: &Exchange,
    content: &Content,
    results: &HashMap<usize, RawResult>,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<(), BrepError> {
    let label = |entity: usize| {
        let name = file
            .arguments(entity)
            .first()
            .and_then(|a| text::decode(a))
            .unwrap_or_default();
        let line = file.entities[entity].line;
        if name.trim().is_empty() {
            format!("{} at line {line}", file.label(entity))
        } else {
            format!("{} {name:?} at line {line}", file.label(entity))
        }
    };
    let mut lost = Vec::new();
    for &entity in content.solids.iter().chain(&content.surfaces) {
        let is_solid = content.solids.contains(&entity);
        let listed = check::faces_listed(file, entity);
        if let Some(result) = results.get(&entity).filter(|result| result.turned > 0) {
            warnings.push(format!(
                "{}: the kernel took {} faces for the other side of their edges; compare the volume with that of the CAD system",
                label(entity),
                result.turned
            ));
        }
        match results.get(&entity) {
            Some(result) if result.placed && (result.solids > 0 || !is_solid) => {
                if let Some(listed) = listed.filter(|&listed| result.faces < listed) {
                    let missing = listed - result.faces;
                    warnings.push(format!(
                        "{}: the kernel dropped {missing} of {listed} faces",
                        label(entity)
                    ));
                }
            }
            Some(result) if result.placed => {
                warnings.push(format!(
                    "{}: the kernel made {} open faces of it",
                    label(entity),
                    result.faces
                ));
            }
            // Faces beside solids are skipped; the part beside them reports their number.
            Some(result) if !is_solid && result.faces > 0 && !content.solids.is_empty() => {}
            result => {
                let why = result.map(|r| one_line(&r.message)).filter(|m| !m.is_empty());
                lost.push(why.map_or(label(entity), |why| format!("{} ({why})", label(entity))));
            }
        }
    }
    let Some(first) = lost.first() else { return Ok(()) };
    if options.allow_lost_solids {
        warnings.extend(lost.iter().map(|which| format!("the kernel lost {which}")));
        return Ok(());
    }
    let total = content.solids.len() + content.surfaces.len();
    Err(BrepError::SolidsLost {
        path: path.into(),
        lost: lost.len(),
        total,
        which: first.clone(),
    })
}

/// Joins the kernel's message, which may have several lines, into one.
fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn name_parts(file: &Exchange, raw: &[RawPart]) -> Vec<Part> {
    let mut taken = HashSet::new();
    raw.iter()
        .map(|raw| {
            let mut names = Vec::with_capacity(raw.path.len());
            for link in &raw.path {
                let above = names.last();
                names.push(link_name(file, &link.instance, &link.product, above));
            }
            let mut name = names.pop().unwrap_or_else(|| "part".into());
            if raw.solids > 1 {
                name = format!("{name}.{}", raw.solid + 1);
            }
            // The root is the file's own product: it is above every part and so does not distinguish them.
            let path = names.into_iter().skip(1).collect();
            Part {
                name: unique(name, &mut taken),
                path,
                shape: raw.shape,
                placement: placement(&raw.placement),
                color: raw.has_color.then_some(raw.color),
            }
        })
        .collect()
}

/// The occurrence's name, else the product's, else its identifier, else the name above.
fn link_name(file: &Exchange, instance: &str, product: &str, above: Option<&String>) -> String {
    let candidates = [
        render::name(file, instance),
        render::name(file, product),
        render::product_id(file, product).unwrap_or_default(),
    ];
    let says_something =
        |name: &&String| !MEANINGLESS.contains(&name.to_uppercase().as_str()) && !name.starts_with("=>[");
    let found = candidates.iter().find(says_something);
    found.or(above).cloned().unwrap_or_else(|| "part".into())
}

fn unique(name: String, taken: &mut HashSet<String>) -> String {
    let mut candidate = name.clone();
    let mut number = 1;
    while !taken.insert(candidate.clone()) {
        number += 1;
        candidate = format!("{name} ({number})");
    }
    candidate
}

fn placement(rows: &[f64; 12]) -> DAffine3 {
    let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
    DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_numbered() {
        let mut taken = HashSet::new();
        let names = ["nut", "nut", "nut (2)", "nut"].map(|n| unique(n.into(), &mut taken));
        assert_eq!(names, ["nut", "nut (2)", "nut (2) (2)", "nut (3)"]);
    }

    #[test]
    fn a_placement_maps_points_as_its_rows_say() {
        let rows = [0.0, -1.0, 0.0, 5.0, 1.0, 0.0, 0.0, 6.0, 0.0, 0.0, 1.0, 7.0];
        let moved = placement(&rows).transform_point3(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(moved, DVec3::new(3.0, 7.0, 10.0));
    }
}
