//! References from a text to other files that contain the shape of a product (ISO 10303-214, external references).
//!
//! A `DOCUMENT_FILE` represents the file; `APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT` names it; `APPLIED_DOCUMENT_REFERENCE` assigns it to a product
//! definition, or the definition lists it itself (`PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS`).

use super::exchange::{Exchange, references};
use super::structure::{argument, is_definition, of_kind};
use super::text;
use std::collections::HashMap;

/// A product whose shape is in another file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    /// Product definition, by entity.
    pub definition: usize,
    /// Name of the file, as written.
    pub name: String,
    /// Line of the reference.
    pub line: u32,
}

/// All products whose shape is in another file, in file order of the files' entities.
pub fn documents(file: &Exchange) -> Vec<Document> {
    let names = names(file);
    let mut found = Vec::new();
    let mut add = |document: usize, definitions: Vec<usize>| {
        let Some(name) = names.get(&document) else { return };
        for definition in definitions {
            let line = file.entities[document].line;
            let name = name.clone();
            let entry = Document {
                definition,
                name,
                line,
            };
            if !found.contains(&entry) {
                found.push(entry);
            }
        }
    };
    for tie in of_kind(file, "APPLIED_DOCUMENT_REFERENCE") {
        let definitions: Vec<usize> = list(file, tie, 2)
            .into_iter()
            .flat_map(|item| definitions(file, item))
            .collect();
        for document in argument(file, tie, 0)
            .into_iter()
            .flat_map(|document| files(file, document))
        {
            add(document, definitions.clone());
        }
    }
    for definition in of_kind(file, "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS") {
        // A document managed as a product of its own has no shape; the product that refers to it has one.
        let managed = of_kind(file, "DOCUMENT_PRODUCT_EQUIVALENCE")
            .any(|e| argument(file, e, 3) == argument(file, definition, 2));
        if !managed {
            for document in list(file, definition, 4) {
                add(document, vec![definition]);
            }
        }
    }
    found.sort_by_key(|document| (document.line, document.definition));
    found
}

/// Removes the external references once the documents are known: the kernel would open the named files by itself, in any folder.
pub fn forget(file: &mut Exchange) {
    for entity in 0..file.entities.len() {
        match file.kind(entity) {
            "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT" => {
                file.replace(entity, "DESCRIPTIVE_REPRESENTATION_ITEM('','')".into());
            }
            "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS" => {
                let arguments = file.arguments(entity);
                let kept = arguments[..arguments.len().min(4)].join(&b","[..]);
                let body = format!("PRODUCT_DEFINITION({})", String::from_utf8_lossy(&kept));
                file.replace(entity, body);
            }
            _ => {}
        }
    }
}

/// Name of each `DOCUMENT_FILE`: the first candidate text that names a STEP file, else the first candidate.
fn names(file: &Exchange) -> HashMap<usize, String> {
    let decoded = |entity: usize, index: usize| {
        let argument = *file.arguments(entity).get(index)?;
        // An external source wraps the text in its type name.
        let start = argument.iter().position(|&byte| byte == b'\'')?;
        let end = argument.iter().rposition(|&byte| byte == b'\'')?;
        text::decode(argument.get(start..=end)?).map(|name| name.trim().to_owned())
    };
    let mut candidates: HashMap<usize, Vec<String>> = HashMap::new();
    for naming in of_kind(file, "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT") {
        let source = argument(file, naming, 2).and_then(|source| decoded(source, 0));
        for document in list(file, naming, 3) {
            let entry = candidates.entry(document).or_default();
            entry.extend(decoded(naming, 0));
            entry.extend(decoded(document, 0));
            entry.extend(source.clone());
        }
    }
    for document in of_kind(file, "DOCUMENT_FILE") {
        let entry = candidates.entry(document).or_default();
        entry.extend(decoded(document, 0));
        entry.extend(decoded(document, 1));
    }
    candidates.retain(|&document, names| {
        names.retain(|name| !name.is_empty());
        file.kind(document) == "DOCUMENT_FILE" && !names.is_empty()
    });
    candidates
        .into_iter()
        .map(|(document, names)| {
            let step = names.iter().position(|name| is_step(name)).unwrap_or(0);
            (document, names[step].clone())
        })
        .collect()
}

/// Whether a name has the extension of a STEP file.
pub fn is_step(name: &str) -> bool {
    let kind = name.rsplit_once('.').map(|(_, kind)| kind.to_ascii_lowercase());
    matches!(kind.as_deref(), Some("step" | "stp" | "p21"))
}

/// `DOCUMENT_FILE`s of a document: itself, or those of the product as which it is managed.
fn files(file: &Exchange, document: usize) -> Vec<usize> {
    if file.kind(document) == "DOCUMENT_FILE" {
        return vec![document];
    }
    let managed: Vec<usize> = of_kind(file, "DOCUMENT_PRODUCT_EQUIVALENCE")
        .filter(|&e| argument(file, e, 2) == Some(document))
        .filter_map(|e| argument(file, e, 3))
        .collect();
    of_kind(file, "PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS")
        .filter(|&e| argument(file, e, 2).is_some_and(|of| managed.contains(&of)))
        .flat_map(|e| list(file, e, 4))
        .filter(|&e| file.kind(e) == "DOCUMENT_FILE")
        .collect()
}

/// Product definitions that an item of a reference represents.
fn definitions(file: &Exchange, item: usize) -> Vec<usize> {
    let kind = file.kind(item);
    if is_definition(kind) {
        return vec![item];
    }
    let above = |parent: usize, is: fn(&str) -> bool| -> Vec<usize> {
        (0..file.entities.len())
            .filter(|&e| is(file.kind(e)) && argument(file, e, 2) == Some(parent))
            .collect()
    };
    let is_formation = |kind: &str| kind.starts_with("PRODUCT_DEFINITION_FORMATION");
    match kind {
        "PRODUCT" => above(item, is_formation)
            .into_iter()
            .flat_map(|formation| above(formation, is_definition))
            .collect(),
        "PRODUCT_DEFINITION_SHAPE" => argument(file, item, 2)
            .filter(|&e| is_definition(file.kind(e)))
            .into_iter()
            .collect(),
        _ if is_formation(kind) => above(item, is_definition),
        _ => Vec::new(),
    }
}

fn list(file: &Exchange, entity: usize, index: usize) -> Vec<usize> {
    let arguments = file.arguments(entity);
    let numbers = arguments
        .get(index)
        .map(|list| references(list))
        .unwrap_or_default();
    numbers.into_iter().filter_map(|id| file.find(id)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(data: &str) -> Vec<(usize, String)> {
        let text = format!("ISO-10303-21;HEADER;ENDSEC;DATA;{data}ENDSEC;END-ISO-10303-21;");
        let file = super::super::parse(text.as_bytes()).unwrap();
        let documents = documents(&file).into_iter();
        documents.map(|found| (found.definition, found.name)).collect()
    }

    #[test]
    fn a_file_is_tied_to_a_definition() {
        let data = "#1=PRODUCT_DEFINITION('','',#2,$);#2=PRODUCT_DEFINITION_FORMATION('','',#3);#3=PRODUCT('','','',());\
            #4=DOCUMENT_FILE('Kolben.stp','','',#9,'',$);#5=APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT('Kolben.stp',#7,#6,(#4));\
            #6=EXTERNAL_SOURCE(IDENTIFIER(''));#8=APPLIED_DOCUMENT_REFERENCE(#4,'',(#1));#7=ROLE();#9=TYPE();";
        let want = vec![(0, "Kolben.stp".to_owned())];
        assert_eq!(found(data), want);
        assert_eq!(
            found(&data.replace("'',(#1));", "'',(#2));")),
            want,
            "by its version"
        );
        assert_eq!(
            found(&data.replace("'',(#1));", "'',(#3));")),
            want,
            "by its product"
        );
        let in_source = data
            .replace("'Kolben.stp'", "'4711'")
            .replace("IDENTIFIER('')", "IDENTIFIER('Kolben.stp')");
        assert_eq!(found(&in_source), want, "named by its source");
    }

    #[test]
    fn a_document_may_be_managed_as_a_product() {
        let data = "#1=PRODUCT_DEFINITION('','',$,$);#2=DOCUMENT('d','','',$);#3=DOCUMENT_PRODUCT_EQUIVALENCE('','',#2,#4);\
            #4=PRODUCT_DEFINITION_FORMATION('','',$);#5=PRODUCT_DEFINITION_WITH_ASSOCIATED_DOCUMENTS('','',#4,$,(#6));\
            #6=DOCUMENT_FILE('a.step','','',$,'',$);#7=APPLIED_DOCUMENT_REFERENCE(#2,'',(#1));";
        assert_eq!(found(data), [(0, "a.step".to_owned())]);
    }
}
