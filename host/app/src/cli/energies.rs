//! `--energy MOVING:AGAINST` of `mortise bake`: the geometric energies of pairs of parts.

use anyhow::Context as _;
use mortise_bake::BakeReport;
use mortise_brep::CadModel;
use mortise_energy::{BakedEnergy, Placed, of_fit};
use mortise_fit::{FitOptions, find, part_named};

/// Two parts by name.
#[derive(Clone, Debug)]
pub struct Names {
    moving: String,
    against: String,
}

/// `MOVING:AGAINST`.
pub fn names(text: &str) -> Result<Names, String> {
    match text.split_once(':') {
        Some((moving, against)) if !moving.is_empty() && !against.is_empty() => Ok(Names {
            moving: moving.to_owned(),
            against: against.to_owned(),
        }),
        _ => Err("must be the names of two parts, such as peg:block".to_owned()),
    }
}

/// An energy between two parts of the model.
pub struct Found {
    moving: usize,
    against: usize,
    energy: BakedEnergy,
}

/// The energies of these pairs, each along the way in to their best fit.
///
/// # Errors
/// A part has no such name or no closed shape, or the two have no fit with a way in.
pub fn of(model: &CadModel, pairs: &[Names]) -> anyhow::Result<Vec<Found>> {
    pairs.iter().map(|names| one(model, names)).collect()
}

fn one(model: &CadModel, names: &Names) -> anyhow::Result<Found> {
    let Names { moving, against } = names;
    let [moving, against] = [part_named(model, moving)?, part_named(model, against)?];
    let fits = find(model, moving, against, &FitOptions::default())?;
    let energy = fits
        .fits
        .iter()
        .find_map(|fit| of_fit(model, moving, against, fit));
    let energy = energy.with_context(|| {
        format!(
            "{:?} has no fit in {:?} with a way in, so that no energy can lead along it; `mortise fit` lists what fits",
            names.moving, names.against
        )
    })?;
    Ok(Found {
        moving,
        against,
        energy,
    })
}

/// Bytes that the energies take.
pub fn bytes(found: &[Found]) -> u64 {
    let placed: Vec<Placed> = found.iter().map(|found| found.placed(0, 1)).collect();
    if placed.is_empty() {
        0
    } else {
        mortise_energy::bytes(&placed) as u64
    }
}

/// The image with the energies; as it is without any.
///
/// # Errors
/// A part has no surface and is not in the image.
pub fn attach(
    image: Vec<u8>,
    report: &mut BakeReport,
    found: &[Found],
    model: &CadModel,
) -> anyhow::Result<Vec<u8>> {
    if found.is_empty() {
        return Ok(image);
    }
    let index = |part: usize| {
        let index = report.parts.iter().position(|baked| baked.model_part == part);
        (index.and_then(|index| u16::try_from(index).ok())).with_context(|| {
            format!(
                "{:?} has no surface and is not in the image",
                model.parts[part].name
            )
        })
    };
    let placed: anyhow::Result<Vec<Placed>> = (found.iter())
        .map(|found| Ok(found.placed(index(found.moving)?, index(found.against)?)))
        .collect();
    let image = mortise_energy::attach(&image, &placed?)?;
    report.image_bytes = image.len() as _;
    Ok(image)
}

impl Found {
    fn placed(&self, moving: u16, fixed: u16) -> Placed {
        Placed {
            moving,
            fixed,
            energy: self.energy.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_two_names() {
        assert!(names("peg:block").is_ok_and(|pair| pair.moving == "peg" && pair.against == "block"));
        for bad in ["", "peg", ":block", "peg:"] {
            assert!(names(bad).is_err_and(|said| said.contains("two parts")), "{bad}");
        }
    }
}
