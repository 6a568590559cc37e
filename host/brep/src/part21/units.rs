//! The length unit of a STEP file, by name. Conversion to millimetres is the kernel's work.

use super::{Exchange, reference, references, text};

/// Names of the length units that the file's representation contexts use, each once, in file order.
pub fn length_units(file: &Exchange) -> Vec<String> {
    let mut names = Vec::new();
    for entity in 0..file.entities.len() {
        let Some(units) = file.arguments_as(entity, "GLOBAL_UNIT_ASSIGNED_CONTEXT") else {
            continue;
        };
        for unit in units.first().map(|list| references(list)).unwrap_or_default() {
            if let Some(name) = file.find(unit).and_then(|unit| length_unit(file, unit))
                && !names.contains(&name)
            {
                names.push(name);
            }
        }
    }
    names
}

fn length_unit(file: &Exchange, unit: usize) -> Option<String> {
    if !file.kinds(unit).contains(&"LENGTH_UNIT") {
        return None;
    }
    if let Some(arguments) = file.arguments_as(unit, "CONVERSION_BASED_UNIT") {
        let name = text::decode(arguments.first()?)?.to_lowercase();
        return Some(match name.trim() {
            // Some writers leave the name empty and give the factor only.
            "" => format!("conversion #{}", reference(arguments.get(1)?)?),
            "in" | "inches" => "inch".into(),
            "mm" => "millimetre".into(),
            "m" => "metre".into(),
            other => other.into(),
        });
    }
    let arguments = file.arguments_as(unit, "SI_UNIT")?;
    let word = |i: usize| {
        arguments
            .get(i)
            .map(|a| String::from_utf8_lossy(a).replace('.', "").to_lowercase())
    };
    let prefix = word(0).filter(|p| p != "$" && p != "*").unwrap_or_default();
    Some(format!("{prefix}{}", word(1)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn si_and_converted_units_have_names() {
        let data = "#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));#2=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.));\
            #3=(CONVERSION_BASED_UNIT('INCH',#9)LENGTH_UNIT()NAMED_UNIT(#9));#9=X();#8=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));\
            #4=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#1,#8))REPRESENTATION_CONTEXT('',''));\
            #5=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#8,#2)));#6=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#3)));#7=(GLOBAL_UNIT_ASSIGNED_CONTEXT((#1)));";
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        assert_eq!(
            length_units(&super::super::parse(text.as_bytes()).unwrap()),
            ["millimetre", "metre", "inch"]
        );
    }
}
