//! The length unit of a STEP file, by name. The kernel converts to millimetres.

use super::exchange::{Exchange, Part21Error, reference, references};
use super::text;

/// Names of the length units that the file's representation contexts use, each once, in file order.
///
/// # Errors
/// [`Part21Error::Invalid`] for a unit whose size the file does not give: the kernel would assume another.
pub fn length_units(file: &Exchange) -> Result<Vec<String>, Part21Error> {
    let mut names = Vec::new();
    for entity in 0..file.entities.len() {
        let Some(units) = file.arguments_as(entity, "GLOBAL_UNIT_ASSIGNED_CONTEXT") else {
            continue;
        };
        for unit in units.first().map(|list| references(list)).unwrap_or_default() {
            let Some(unit) = file
                .find(unit)
                .filter(|&unit| file.kinds(unit).contains(&"LENGTH_UNIT"))
            else {
                continue;
            };
            let name = length_unit(file, unit).ok_or_else(|| Part21Error::Invalid {
                line: file.entities[unit].line,
                what: format!("{} is a length unit of unknown size", file.label(unit)),
            })?;
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    Ok(names)
}

fn length_unit(file: &Exchange, unit: usize) -> Option<String> {
    if let Some(arguments) = file.arguments_as(unit, "CONVERSION_BASED_UNIT") {
        // The factor determines the size; the name is for people.
        let measure = file.find(reference(arguments.get(1)?)?)?;
        let (factor, base) = factor(file, measure)?;
        si_unit(file, base)?;
        let name = text::decode(arguments.first()?)?.to_lowercase();
        return Some(match name.trim() {
            "" => format!("unit of {factor} {}", si_unit(file, base)?),
            "in" | "inches" => "inch".into(),
            "mm" => "millimetre".into(),
            "m" => "metre".into(),
            other => other.into(),
        });
    }
    si_unit(file, unit)
}

/// Factor and base unit of `LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#1)`, which may be part of a complex entity.
fn factor(file: &Exchange, measure: usize) -> Option<(f64, usize)> {
    let kinds = ["LENGTH_MEASURE_WITH_UNIT", "MEASURE_WITH_UNIT"];
    let arguments = kinds
        .iter()
        .find_map(|kind| file.arguments_as(measure, kind).filter(|a| a.len() == 2))?;
    let value = std::str::from_utf8(arguments[0]).ok()?;
    let value = value
        .split_once('(')
        .map_or(value, |(_, rest)| rest.trim_end_matches(')'));
    let value: f64 = value.parse().ok()?;
    (value > 0.0 && value.is_finite()).then_some((value, file.find(reference(arguments[1])?)?))
}

/// Millimetres per length unit of a representation's context.
pub fn millimetres(file: &Exchange, representation: usize) -> Option<f64> {
    let context = file.find(reference(file.arguments(representation).get(2)?)?)?;
    let units = file.arguments_as(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT")?;
    let unit = references(units.first()?)
        .into_iter()
        .filter_map(|id| file.find(id))
        .find(|&unit| file.kinds(unit).contains(&"LENGTH_UNIT"))?;
    let Some(arguments) = file.arguments_as(unit, "CONVERSION_BASED_UNIT") else {
        return si_millimetres(file, unit);
    };
    let measure = file.find(reference(arguments.get(1)?)?)?;
    let (factor, base) = factor(file, measure)?;
    Some(factor * si_millimetres(file, base)?)
}

fn si_millimetres(file: &Exchange, unit: usize) -> Option<f64> {
    let name = si_unit(file, unit)?;
    let exponent = match name.strip_suffix("metre")? {
        "" => 0,
        "deci" => -1,
        "centi" => -2,
        "milli" => -3,
        "micro" => -6,
        "nano" => -9,
        "pico" => -12,
        "deca" => 1,
        "hecto" => 2,
        "kilo" => 3,
        "mega" => 6,
        _ => return None,
    };
    Some(10f64.powi(exponent + 3))
}

fn si_unit(file: &Exchange, unit: usize) -> Option<String> {
    let arguments = file.arguments_as(unit, "SI_UNIT")?;
    let word = |i: usize| {
        arguments
            .get(i)
            .map(|a| String::from_utf8_lossy(a).replace('.', "").to_lowercase())
    };
    let prefix = word(0).filter(|p| p != "$" && p != "*").unwrap_or_default();
    Some(format!("{prefix}{}", word(1).filter(|name| name == "metre")?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(data: &str) -> Result<Vec<String>, Part21Error> {
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        length_units(&super::super::parse(text.as_bytes()).unwrap())
    }

    #[test]
    fn si_and_converted_units_have_names() {
        let data = "#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));\
            #3=(CONVERSION_BASED_UNIT('INCH',#9)LENGTH_UNIT()NAMED_UNIT(#9));#9=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#1);\
            #8=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));\
            #4=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#1,#8))REPRESENTATION_CONTEXT('',''));\
            #5=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#8,#2)));#6=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#3)));#7=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#1)));";
        assert_eq!(units(data).unwrap(), ["millimetre", "metre", "inch"]);
    }

    #[test]
    fn a_unit_without_a_size_is_refused() {
        let context =
            "#5=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#3)));#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));";
        for unit in [
            "#3=(CONTEXT_DEPENDENT_UNIT('user')LENGTH_UNIT()NAMED_UNIT(#1));",
            "#3=(CONVERSION_BASED_UNIT('ELL',#9)LENGTH_UNIT()NAMED_UNIT(#9));#9=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.),#1);",
            "#3=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.PARSEC.));",
        ] {
            let error = units(&format!("{context}{unit}"));
            assert!(
                matches!(&error, Err(Part21Error::Invalid { what, .. }) if what.contains("unknown size")),
                "{error:?}"
            );
        }
    }
}
