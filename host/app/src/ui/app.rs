//! The program's window: runs a [`Window`] under eframe and takes the screenshots that automation requests.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use egui::{ColorImage, Vec2, ViewportCommand};
use mortise_output::Output;

use super::{Window, theme};
use crate::folder_cache::FolderCache;
use crate::kept::{Preferences, StateFolder};
use crate::session::{Intent, Session};
use crate::viewport::surface::Surface;

/// A screenshot of the window.
#[derive(Clone, Debug)]
pub struct Screenshot {
    /// PNG file to write.
    pub file: Output,
    /// Delay after the window appears.
    pub after: Duration,
}

/// Start-up options.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Intents handled first.
    pub first: Vec<Intent>,
    /// Screenshot after which the program ends.
    pub screenshot: Option<Screenshot>,
    /// Draw fixed parts as glass from the start.
    pub see_through: bool,
}

struct App {
    window: Window,
    surface: Option<Surface>,
    screenshot: Option<Screenshot>,
    began: Instant,
    taken: Arc<Mutex<Option<Arc<ColorImage>>>>,
    asked: bool,
    /// Id of the document that the window title names.
    named: Option<u64>,
    failed: Arc<Mutex<Option<anyhow::Error>>>,
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// No display, no graphics device, or the screenshot could not be written.
pub fn run(options: Options) -> anyhow::Result<()> {
    // A picture taken by automation shows the same on every computer.
    let folder = (options.screenshot.is_none())
        .then(StateFolder::of_user)
        .flatten();
    let size = folder
        .as_ref()
        .and_then(Preferences::of)
        .and_then(|kept| kept.window);
    let failed = Arc::new(Mutex::new(None));
    let report = Arc::clone(&failed);
    let native = eframe::NativeOptions {
        viewport: viewport(size),
        renderer: eframe::Renderer::Wgpu,
        // `set_up` does this, also in tests.
        system_font_fallback: false,
        ..Default::default()
    };
    eframe::run_native(
        "Mortise",
        native,
        Box::new(move |creation| {
            super::set_up(&creation.egui_ctx);
            let ctx = creation.egui_ctx.clone();
            let session = Session::new(Arc::new(move || ctx.request_repaint()));
            let mut window = Window::new(session.with_cache(FolderCache::of_user()).with_state(folder));
            window.view.see_through = options.see_through;
            #[cfg(unix)]
            {
                window.space_mouse = Some(super::space_mouse::SpaceMouse::follow(&creation.egui_ctx));
            }
            for intent in options.first {
                window.session.act(intent);
            }
            Ok(Box::new(App {
                window,
                surface: creation.wgpu_render_state.as_ref().map(Surface::new),
                screenshot: options.screenshot,
                began: Instant::now(),
                taken: Arc::default(),
                asked: false,
                named: None,
                failed: report,
            }))
        }),
    )
    .map_err(|error| {
        anyhow::anyhow!(
            "the window cannot be opened: {}; it needs a display and Vulkan, OpenGL, Metal or DirectX (on Debian without a \
             graphics card: mesa-vulkan-drivers); `mortise demo --headless` needs neither",
            reason(&error.to_string())
        )
    })?;
    let failure = failed.lock().unwrap_or_else(PoisonError::into_inner).take();
    failure.map_or(Ok(()), Err)
}

/// What an error of the window library states, without the place in that library's source which it begins with.
fn reason(error: &str) -> &str {
    let after_place = error
        .rsplit_once(".rs:")
        .and_then(|(_, after)| after.split_once(": "));
    after_place.map_or(error, |(_, text)| text).trim_end_matches('.')
}

/// The window that the system is asked for.
fn viewport(size: Option<[f32; 2]>) -> egui::ViewportBuilder {
    egui::ViewportBuilder::default()
        .with_title("Mortise")
        .with_app_id("mortise")
        .with_inner_size(size.map_or(Vec2::new(1520.0, 940.0), Vec2::from))
        // Small enough for the smallest screen at the largest scale; a larger minimum would exceed that screen.
        .with_min_inner_size(Vec2::new(240.0, 180.0))
        .with_clamp_size_to_monitor_size(true)
        .with_icon(icon())
}

impl eframe::App for App {
    fn logic(&mut self, _ctx: &egui::Context, _frame: &mut eframe::Frame) {
        // Runs while the window is hidden too: the board needs a listener at all times.
        self.window.session.poll();
    }

    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.window.show(ui, self.surface.as_mut());
        self.note_size(ui.ctx());
        self.name_window(ui.ctx());
        self.take_screenshot(ui.ctx());
    }

    fn raw_input_hook(&mut self, _ctx: &egui::Context, input: &mut egui::RawInput) {
        // A picture taken by automation does not depend on where the pointer happens to be.
        if self.screenshot.is_some() {
            (input.events).retain(|event| !matches!(event, egui::Event::PointerMoved(_)));
        }
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        let theme = egui::Theme::from_dark_mode(visuals.dark_mode);
        theme::palette(theme).panel.to_normalized_gamma_f32()
    }
}

impl App {
    /// Notes the size of the window for the next start, unless it fills the screen.
    fn note_size(&mut self, ctx: &egui::Context) {
        let size = ctx.input(|i| {
            let seen = i.viewport();
            let fills = [seen.maximized, seen.fullscreen, seen.minimized].contains(&Some(true));
            seen.inner_rect.filter(|_| !fills).map(|rect| rect.size().round())
        });
        if let Some(size) = size.filter(|size| size.min_elem() >= 100.0) {
            self.window.session.preferences.window = Some(size.into());
        }
    }

    fn name_window(&mut self, ctx: &egui::Context) {
        let open = self.window.session.document.as_ref();
        if open.map(|d| d.generation) != self.named {
            self.named = open.map(|d| d.generation);
            let title = open.map_or("Mortise".to_owned(), |d| format!("{} – Mortise", d.title));
            ctx.send_viewport_cmd(ViewportCommand::Title(title));
        }
    }

    fn take_screenshot(&mut self, ctx: &egui::Context) {
        let Some(screenshot) = &self.screenshot else {
            return;
        };
        let left = screenshot.after.saturating_sub(self.began.elapsed());
        if !left.is_zero() {
            ctx.request_repaint_after(left);
            return;
        }
        if !self.asked {
            self.asked = true;
            let (taken, wake) = (Arc::clone(&self.taken), ctx.clone());
            ctx.send_viewport_cmd(ViewportCommand::Screenshot(egui::ScreenshotCallback::new(
                move |image| {
                    *taken.lock().unwrap_or_else(PoisonError::into_inner) = Some(image);
                    wake.request_repaint();
                },
            )));
        }
        let image = self.taken.lock().unwrap_or_else(PoisonError::into_inner).take();
        match image {
            Some(image) => {
                let document = self.window.session.document.as_ref();
                let files = document.map_or(&[][..], |document| &document.model.files);
                if let Err(error) = write_png(screenshot.file.clone(), files, &image) {
                    *self.failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
                self.screenshot = None;
                ctx.send_viewport_cmd(ViewportCommand::Close);
            }
            None => ctx.request_repaint_after(Duration::from_millis(20)),
        }
    }
}

/// Writes the picture, unless the target is one of the `files` that were read: those beside the opened one are known only now.
fn write_png(mut target: Output, files: &[PathBuf], image: &ColorImage) -> anyhow::Result<()> {
    target.add_inputs(files)?;
    let what = || format!("cannot write the screenshot to {}", target.path().display());
    let [width, height] = image.size.map(|n| n as u32);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let bytes: Vec<u8> = (image.pixels.iter())
        .flat_map(|p| [p.r(), p.g(), p.b()])
        .collect();
    let mut writer = encoder.write_header().with_context(what)?;
    writer.write_image_data(&bytes).with_context(what)?;
    writer.finish().with_context(what)?;
    target.write(&file).with_context(what)
}

/// The mark, 64 pixels a side: a tenon over its mortise.
fn icon() -> egui::IconData {
    const SIDE: usize = 64;
    let ink = theme::palette(egui::Theme::Dark);
    let mut rgba = vec![0u8; 4 * SIDE * SIDE];
    let mut fill = |x: std::ops::Range<usize>, y: std::ops::Range<usize>, color: egui::Color32| {
        for row in y {
            for column in x.clone() {
                rgba[4 * (row * SIDE + column)..][..4].copy_from_slice(&color.to_array());
            }
        }
    };
    fill(23..41, 3..33, ink.held);
    fill(6..21, 37..62, ink.text);
    fill(43..58, 37..62, ink.text);
    fill(6..58, 52..62, ink.text);
    egui::IconData {
        rgba,
        width: SIDE as u32,
        height: SIDE as u32,
    }
}

#[cfg(test)]
mod tests {
    use mortise_output::Existing;

    use super::*;

    #[test]
    fn the_window_is_never_larger_than_the_monitor() {
        let viewport = viewport(None);
        assert_eq!(viewport.clamp_size_to_monitor_size, Some(true));
        // 800 × 600 pixels, three to the point.
        let least = viewport.min_inner_size.expect("a least size");
        assert!(least.x <= 266.0 && least.y <= 200.0, "{least}");
    }

    #[test]
    fn an_error_of_the_window_library_is_given_without_its_source() {
        let with_place = "winit EventLoopError: os error at /src/linux/mod.rs:765: DISPLAY is not set.";
        assert_eq!(reason(with_place), "DISPLAY is not set");
        assert_eq!(reason("no adapter was found"), "no adapter was found");
    }

    #[test]
    fn a_picture_replaces_no_file_that_was_read() {
        let place = tempfile::tempdir().expect("temporary folder");
        let [beside, other] = ["part.step", "other.png"].map(|name| place.path().join(name));
        std::fs::write(&beside, "a part").expect("written");
        let image = ColorImage::filled([2, 2], egui::Color32::WHITE);
        let output = |path| Output::new(path, Existing::Replace, &[] as &[PathBuf]).expect("may be written");
        let files = [beside.clone()];
        let error = write_png(output(beside.clone()), &files, &image).expect_err("it was read");
        assert!(error.to_string().contains("is the input"), "{error}");
        assert_eq!(std::fs::read(&beside).expect("still there"), b"a part");
        write_png(output(other.clone()), &files, &image).expect("another file");
        assert!(std::fs::read(&other).expect("written").starts_with(b"\x89PNG"));
    }
}
