//! The page of an assembly of the repository: complete in one file, with a picture of each step.

use std::path::Path;
use std::time::Duration;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use mortise_brep::load_step;
use mortise_task::{Assembly, sequence};

fn taken_apart(file: &str, rename: &str) -> (Assembly, sequence::Sequence) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file);
    let mut model = load_step(file).expect("a file of the repository");
    model.parts[0].name = rename.into();
    let assembly = Assembly::new(model).expect("an assembly");
    let all: Vec<usize> = (0..assembly.count()).collect();
    let found = sequence::disassemble(&assembly, &all, Duration::from_secs(60));
    (assembly, found)
}

/// The page of a sequence, with its pictures.
fn page(title: &str, assembly: &Assembly, found: &sequence::Sequence, felt: &[String]) -> String {
    let pictures = mortise_page::pictures(assembly, found);
    mortise_page::page(title, assembly, found, &pictures, felt)
}

/// Pixels of the pictures of a page.
fn pictures(page: &str) -> Vec<Vec<u8>> {
    page.split("base64,")
        .skip(1)
        .map(|rest| {
            let data = rest.split('"').next().expect("a closed attribute");
            let file = BASE64_STANDARD.decode(data).expect("base64");
            let mut reader = png::Decoder::new(std::io::Cursor::new(file))
                .read_info()
                .expect("a PNG file");
            let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
            let frame = reader.next_frame(&mut pixels).expect("a picture");
            assert_eq!(frame.buffer_size(), pixels.len());
            pixels
        })
        .collect()
}

#[test]
fn each_step_has_its_picture_and_its_row() {
    let (assembly, found) = taken_apart("lab/data/fixture_row.step", "plate <1> & \"base\"");
    let felt = vec!["pin <1>: in".to_owned(); found.steps.len()];
    let page = page("a row <of> pins", &assembly, &found, &felt);
    assert_eq!(page.matches("<li>pin &lt;1&gt;: in</li>").count(), felt.len());
    assert!(page.contains("<h1>a row &lt;of&gt; pins</h1>"), "{page}");
    assert!(!page.contains("<1>"));
    let count = found.steps.len();
    assert_eq!(count, assembly.count() - 1);
    assert!(page.contains(&format!("together in {count} steps")));
    // Nothing is fetched.
    assert!(!page.contains("http") && !page.contains("<script") && !page.contains("<link"));
    let pictures = pictures(&page);
    let drawn = mortise_page::pictures(&assembly, &found);
    assert!(pictures.iter().eq(drawn.iter().map(|picture| &picture.rgb)));
    assert_eq!(pictures.len(), count);
    let orange = |p: &[u8]| i32::from(p[0]) - i32::from(p[2]) > 90;
    for picture in &pictures {
        let moving = picture.chunks(3).filter(|p| orange(p)).count();
        let paper = picture.chunks(3).filter(|p| **p == [255; 3]).count();
        let all = picture.len() / 3;
        assert!(moving > 20 && moving < all / 2, "{moving} of {all} pixels move");
        assert!(
            paper > all / 10 && paper < all * 9 / 10,
            "{paper} of {all} pixels are paper"
        );
    }
    let rows = page.matches("<tr><td class=\"n\">").count();
    assert_eq!(rows, count);
}

/// What does not come apart is said with its proof, and a page without a step has no picture.
#[test]
fn what_stays_together_is_said() {
    let (assembly, mut found) = taken_apart("app/samples/pair_d18.75_clear1.00.step", "block");
    found.steps.clear();
    found.stuck = vec![(
        vec![0, 1],
        mortise_task::removal::Blocked {
            pair: [1, 0],
            overlap_mm: Some(0.25),
            proof: Some(mortise_task::Proof::Linked),
        },
    )];
    let page = page("pair", &assembly, &found, &[]);
    assert!(page.contains("do not come apart completely; 0 steps were found"));
    assert!(
        page.contains("by 250.0 µm at the least; linked: a closed curve"),
        "{page}"
    );
    assert!(pictures(&page).is_empty());
}

/// Without a proof it is said that the search may have overlooked a way.
#[test]
fn what_was_only_searched_is_not_called_certain() {
    let (assembly, mut found) = taken_apart("app/samples/pair_d18.75_clear1.00.step", "block");
    for (overlap_mm, words) in [
        (Some(0.25), "by 250.0 µm at the widest place found"),
        (None, "meets"),
    ] {
        found.stuck = vec![(
            vec![0, 1],
            mortise_task::removal::Blocked {
                pair: [1, 0],
                overlap_mm,
                proof: None,
            },
        )];
        let page = page("pair", &assembly, &found, &[]);
        assert!(
            page.contains("stay together, as far as was searched:") && page.contains(words),
            "{page}"
        );
    }
}

/// A page of very many steps says that it has no pictures.
#[test]
fn a_long_page_has_no_pictures() {
    let (assembly, mut found) = taken_apart("app/samples/pair_d18.75_clear1.00.step", "block");
    let one = found.steps[0].clone();
    for (count, drawn) in [(100, 100), (101, 0)] {
        found.steps = vec![one.clone(); count];
        let page = page("pair", &assembly, &found, &[]);
        assert_eq!(pictures(&page).len(), drawn);
        assert_eq!(
            page.contains("Without pictures: more than 100 steps."),
            drawn == 0
        );
    }
}
