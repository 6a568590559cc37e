//! No data is lost: after any operation the target has its previous bytes or the complete new file.

use std::path::Path;

use mortise_output::{Existing, Folder, Output, OutputError};

const NONE: &[&Path] = &[];

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("temporary folder")
}

/// Names of the files in the folder, including hidden ones.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .expect("folder")
        .map(|entry| entry.expect("entry").file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    names
}

#[test]
fn a_new_file_has_all_bytes_and_leaves_nothing_beside() {
    let folder = folder();
    let path = folder.path().join("x.image");
    let output = Output::new(&path, Existing::Keep, NONE).expect("free");
    assert!(names(folder.path()).is_empty(), "the check leaves nothing");
    output.write(b"bytes").expect("written");
    assert_eq!(std::fs::read(&path).expect("read"), b"bytes");
    assert_eq!(names(folder.path()), ["x.image"]);
}

#[test]
fn an_existing_file_is_replaced_on_request_only() {
    let folder = folder();
    let path = folder.path().join("x.image");
    std::fs::write(&path, "old").expect("written");
    let error = Output::new(&path, Existing::Keep, NONE).expect_err("taken");
    assert!(matches!(error, OutputError::Exists { .. }), "{error}");
    assert!(error.to_string().contains("--force"), "{error}");
    assert_eq!(std::fs::read(&path).expect("read"), b"old");
    let output = Output::new(&path, Existing::Replace, NONE).expect("may be replaced");
    output.write(b"new").expect("written");
    assert_eq!(std::fs::read(&path).expect("read"), b"new");
}

#[test]
fn a_missing_folder_is_named_and_the_random_name_is_not() {
    let folder = folder();
    let missing = folder.path().join("missing");
    let error = Output::new(missing.join("x.image"), Existing::Keep, NONE).expect_err("no folder");
    assert!(matches!(error, OutputError::NoFolder { .. }), "{error}");
    let words = error.to_string();
    assert!(
        words.contains(&format!("folder {} does not exist", missing.display())),
        "{words}"
    );
    assert!(!words.contains(".part"), "{words}");
}

#[test]
fn a_name_taken_during_the_work_is_not_replaced() {
    let folder = folder();
    let path = folder.path().join("x.image");
    let output = Output::new(&path, Existing::Keep, NONE).expect("free");
    std::fs::write(&path, "of somebody else").expect("written");
    let error = output.write(b"ours").expect_err("taken meanwhile");
    assert!(matches!(error, OutputError::Exists { .. }), "{error}");
    assert_eq!(std::fs::read(&path).expect("read"), b"of somebody else");
    assert_eq!(names(folder.path()), ["x.image"]);
}

#[test]
fn an_input_is_never_the_output() {
    let folder = folder();
    let input = folder.path().join("x.step");
    std::fs::write(&input, "CAD").expect("written");
    let mut ways = vec![input.clone(), folder.path().join(".").join("x.step")];
    if cfg!(unix) {
        let hard = folder.path().join("hard.step");
        std::fs::hard_link(&input, &hard).expect("hard link");
        ways.push(hard);
    }
    for path in ways {
        let error = Output::new(&path, Existing::Replace, &[&input]).expect_err("the input");
        assert!(matches!(error, OutputError::Input { .. }), "{error}");
    }
    let other = folder.path().join("other.step");
    std::fs::write(&other, "CAD too").expect("written");
    let mut output = Output::new(&other, Existing::Replace, &[&input]).expect("may be replaced");
    let error = output.add_inputs(&[&other]).expect_err("read as well");
    assert!(matches!(error, OutputError::Input { .. }), "{error}");
    assert_eq!(std::fs::read(&input).expect("read"), b"CAD");
}

#[cfg(unix)]
#[test]
fn an_input_behind_a_symbolic_link_is_known() {
    let folder = folder();
    let (input, link) = (folder.path().join("x.step"), folder.path().join("link.step"));
    std::fs::write(&input, "CAD").expect("written");
    std::os::unix::fs::symlink(&input, &link).expect("link");
    let error = Output::new(&input, Existing::Replace, &[&link]).expect_err("the input");
    assert!(matches!(error, OutputError::Input { .. }), "{error}");
}

#[cfg(unix)]
#[test]
fn only_a_regular_file_is_replaced() {
    use std::os::unix::fs::{FileTypeExt as _, symlink};
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let victim = at("victim");
    std::fs::write(&victim, "precious").expect("written");
    symlink(&victim, at("link")).expect("link");
    symlink(at("absent"), at("dangling")).expect("link");
    std::fs::create_dir(at("folder")).expect("folder");
    let _socket = std::os::unix::net::UnixListener::bind(at("socket")).expect("socket");
    for (name, what) in [
        ("link", "a symbolic link"),
        ("dangling", "a symbolic link"),
        ("folder", "a folder"),
        ("socket", "a socket"),
    ] {
        for existing in [Existing::Keep, Existing::Replace] {
            let error = Output::new(at(name), existing, NONE).expect_err(name);
            assert!(error.to_string().contains(what), "{name}: {error}");
        }
    }
    let error = Output::new("/dev/null", Existing::Replace, NONE).expect_err("a device");
    assert!(error.to_string().contains("a device"), "{error}");
    assert!(
        std::fs::metadata("/dev/null")
            .expect("there")
            .file_type()
            .is_char_device()
    );
    // A link planted between the check and the end of the work.
    let late = at("late");
    let output = Output::new(&late, Existing::Replace, NONE).expect("free");
    symlink(&victim, &late).expect("link");
    output.write(b"ours").expect_err("a link");
    assert_eq!(std::fs::read(&victim).expect("read"), b"precious");
}

#[test]
fn what_cannot_be_written_is_reported_before_the_work() {
    let folder = folder();
    let file = folder.path().join("file");
    std::fs::write(&file, "no folder").expect("written");
    for path in [
        folder.path().join("absent/x.image"),
        file.join("x.image"),
        folder.path().join(".."),
        folder.path().join("x/"),
    ] {
        let error = Output::new(&path, Existing::Keep, NONE).expect_err("unwritable");
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn permissions_are_those_of_a_new_file_or_of_the_replaced_one() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = folder();
    let mode = |path: &Path| std::fs::metadata(path).expect("there").permissions().mode() & 0o777;
    let (plain, ours) = (folder.path().join("plain"), folder.path().join("ours"));
    std::fs::write(&plain, "").expect("written");
    Output::new(&ours, Existing::Keep, NONE)
        .and_then(|output| output.write(b""))
        .expect("written");
    assert_eq!(mode(&ours), mode(&plain));
    std::fs::set_permissions(&ours, std::fs::Permissions::from_mode(0o600)).expect("set");
    Output::new(&ours, Existing::Replace, NONE)
        .and_then(|output| output.write(b""))
        .expect("written");
    assert_eq!(mode(&ours), 0o600);
}

#[test]
fn a_folder_is_made_and_each_of_its_files_checked_first() {
    let folder = folder();
    let path = folder.path().join("a/b");
    let out = Folder::new(&path, Existing::Keep, &["x.csv", "x.svg"]).expect("made");
    out.write("x.csv", b"1,2").expect("written");
    let error = Folder::new(&path, Existing::Keep, &["x.svg", "x.csv"]).expect_err("taken");
    assert!(error.to_string().contains("x.csv"), "{error}");
    let out = Folder::new(&path, Existing::Replace, &["x.csv"]).expect("may be replaced");
    out.write("x.csv", b"3,4").expect("written");
    assert_eq!(std::fs::read(path.join("x.csv")).expect("read"), b"3,4");
}

/// A name that can be predicted could be planted as a link or taken in advance. Each file's temporary name is listed while the file is written.
#[test]
fn temporary_names_are_never_repeated() {
    let folder = folder();
    let bytes = vec![7u8; 8 << 20];
    let mut seen: Vec<String> = Vec::new();
    for round in 0..12 {
        let target = format!("{round}.image");
        let output = Output::new(folder.path().join(&target), Existing::Keep, NONE).expect("free");
        let mut beside = std::thread::scope(|scope| {
            let writing = scope.spawn(|| output.write(&bytes).expect("written"));
            let mut beside = Vec::new();
            while !writing.is_finished() {
                beside.extend(
                    names(folder.path())
                        .into_iter()
                        .filter(|name| !name.ends_with(".image")),
                );
            }
            beside
        });
        beside.sort();
        beside.dedup();
        seen.append(&mut beside);
    }
    assert!(seen.len() >= 3, "{seen:?} were seen: too few to compare");
    let count = seen.len();
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), count, "a name was used twice: {seen:?}");
}
