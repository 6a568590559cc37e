//! The page of what the window does names a test of this program for each of its rows.

use std::path::Path;

#[test]
fn every_row_of_the_page_has_its_test() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(here.join("../../docs/window.md")).expect("the page");
    let rows: Vec<(&str, &str)> = (page.lines())
        .filter_map(|line| {
            let (what, tests) = line
                .strip_prefix("| ")?
                .strip_suffix("` |")?
                .rsplit_once(" | `")?;
            Some((what, tests))
        })
        .collect();
    assert_eq!(rows.len(), 54);
    let each = rows
        .iter()
        .flat_map(|(what, tests)| tests.split("`, `").map(move |test| (what, test)));
    for (what, test) in each {
        let (module, function) = test.split_once("::").expect("module and function");
        let source = here.join("tests/window").join(format!("{module}.rs"));
        let source = std::fs::read_to_string(&source).unwrap_or_else(|why| panic!("{what}: {why}"));
        // An ignored test has a line between the two.
        let is_there = source.contains(&format!("#[test]\nfn {function}() {{"));
        assert!(is_there, "{what}: no test `{test}`");
    }
}
