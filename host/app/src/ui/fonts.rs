//! Fonts of the system for what the built-in ones lack: names of parts come in every script.

use std::sync::Arc;

use egui_system_font_provider::SystemFontProvider;

/// Has egui look for a font of the system whenever a character is in none it has. The fonts are listed on a thread of their own.
pub fn install(ctx: &egui::Context) {
    ctx.add_font_provider(Arc::new(SystemFontProvider::new()));
}
