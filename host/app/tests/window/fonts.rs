//! Part names in scripts that the built-in fonts lack are drawn with fonts of the system, not as boxes.
//!
//! The window under test panics when a character has no glyph, so completing the test is the proof; the shapes of the glyphs are compared
//! too. A script that no font of this system covers is skipped with a message; set-up installs a font for Japanese.

use std::sync::Arc;

use crate::common::{harness_with, open_sample};
use egui::epaint::text::{FallbackRequest, FontProvider as _};
use egui::{Color32, ColorImage, FontFamily, FontId};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use egui_system_font_provider::SystemFontProvider;
use mortise::ui::{Window, set_up};

const NAMES: [(&str, &str); 7] = [
    ("Latin", "Gehäuse"),
    ("Cyrillic", "подшипник"),
    ("Greek", "έδρανο"),
    ("Japanese", "軸受ハウジング"),
    ("Chinese", "轴承座"),
    ("Korean", "베어링"),
    ("Arabic", "محمل"),
];

fn window() -> Harness<'static, Window> {
    harness_with(set_up)
}

fn is_on_this_system(name: &str) -> bool {
    let system = SystemFontProvider::new();
    let built_in = egui::Context::default();
    let mut own = false;
    // The first pass loads the built-in fonts.
    built_in
        .run_ui(egui::RawInput::default(), |_| {})
        .textures_delta
        .clear();
    built_in.fonts_mut(|fonts| own = fonts.has_glyphs(&FontId::proportional(13.5), name));
    own || name.chars().all(|c| {
        let request = FallbackRequest {
            cluster: &c.to_string(),
            family: &FontFamily::Proportional,
        };
        system.font_for(&request).is_some()
    })
}

fn rename(harness: &mut Harness<'_, Window>, name: &str) {
    let document = harness.state_mut().session.document.as_mut().expect("open");
    Arc::make_mut(&mut document.model).parts[1].name = name.to_owned();
    harness.run_steps(3);
}

/// Coverage of each glyph of `text` as drawn.
fn glyphs(harness: &Harness<'_, Window>, text: &str) -> Vec<Vec<u8>> {
    harness.ctx.fonts_mut(|fonts| {
        let galley = fonts.layout_no_wrap(text.to_owned(), FontId::proportional(13.5), Color32::WHITE);
        let atlas: ColorImage = fonts.image();
        let row = &galley.rows[0];
        (row.row.glyphs.iter())
            .map(|glyph| {
                let uv = glyph.uv_rect;
                let (min, max) = (uv.min.map(usize::from), uv.max.map(usize::from));
                let mut pixels = Vec::new();
                for y in min[1]..max[1] {
                    for x in min[0]..max[0] {
                        pixels.push(atlas[(x, y)].a());
                    }
                }
                pixels
            })
            .collect()
    })
}

#[test]
fn names_in_every_script_are_drawn() {
    let mut harness = window();
    open_sample(&mut harness);
    let mut drawn = 0;
    for (script, name) in NAMES {
        if !is_on_this_system(name) {
            println!("skipped: no font of this system has {script} ({name})");
            continue;
        }
        rename(&mut harness, name);
        harness.get_by_label(name);
        let glyphs = glyphs(&harness, name);
        let inked = glyphs.iter().filter(|g| g.iter().any(|&a| a > 100)).count();
        assert!(
            inked * 2 > glyphs.len(),
            "{script}: {inked} of {} glyphs have ink",
            glyphs.len()
        );
        let mut different = glyphs.clone();
        different.sort();
        different.dedup();
        assert!(
            different.len() * 2 > glyphs.len(),
            "{script}: boxes are all alike"
        );
        drawn += 1;
    }
    assert!(drawn >= 3, "the built-in fonts have Latin, Cyrillic and Greek");
    assert!(
        std::env::var_os("CI").is_none() || is_on_this_system("軸受ハウジング"),
        "set-up installs a font that has Japanese"
    );
}
