//! Contacts of the shared test parts match independent results. Skipped with a message when the parts are absent (`MORTISE_SHARED`, else `shared`
//! beside the workspace).

use mortise_lab::{contacts, corpus};

#[test]
fn every_file_has_the_contacts_the_checker_found() {
    let Some(cad) = corpus::folder() else {
        println!("skipped all files: no shared test parts (set MORTISE_SHARED)");
        return;
    };
    let checked = contacts::expected(&cad).expect("a readable list");
    for one in &checked {
        assert_eq!(one.wrong, None, "{}", one.file);
    }
    let found: usize = checked.iter().map(|one| one.contacts).sum();
    println!("{found} contacts in {} files", checked.len());
    assert!(checked.len() >= 46 && found >= 300, "{} {found}", checked.len());
}

#[test]
fn assemblies_have_the_contacts_others_counted() {
    let Some(cad) = corpus::folder() else {
        println!(
            "skipped {} files: no shared test parts (set MORTISE_SHARED)",
            contacts::COUNTED.len()
        );
        return;
    };
    for (file, planar, cylindrical) in contacts::COUNTED {
        let found = contacts::count(&cad.join(file)).expect(file);
        println!("{file}: {found:?}");
        let numbers = (found.planar, found.cylindrical, found.others);
        assert_eq!(numbers, (planar, cylindrical, 0), "{file}");
    }
}
