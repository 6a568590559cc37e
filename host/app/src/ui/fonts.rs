//! System fonts for characters that the built-in fonts lack: part names may be in any script.

use std::sync::Arc;

use egui_system_font_provider::SystemFontProvider;

/// Makes egui use a system font for each character missing from the loaded fonts. The fonts are listed on a thread of their own.
pub fn install(ctx: &egui::Context) {
    ctx.add_font_provider(Arc::new(SystemFontProvider::new()));
}
