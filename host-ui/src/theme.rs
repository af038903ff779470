//! Colours, sizes and spacings as tokens; nothing else in the window names a colour.
//!
//! Hues come from the Okabe-Ito set, which people with any common colour blindness can tell apart; no meaning rests on hue alone.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Visuals};

pub const BACKGROUND: Color32 = Color32::from_rgb(20, 24, 29);
pub const PANEL: Color32 = Color32::from_rgb(27, 32, 38);
pub const CARD: Color32 = Color32::from_rgb(34, 40, 48);
pub const LINE: Color32 = Color32::from_rgb(56, 64, 74);
pub const TEXT: Color32 = Color32::from_rgb(222, 228, 234);
pub const WEAK: Color32 = Color32::from_rgb(152, 163, 175);
pub const ACCENT: Color32 = Color32::from_rgb(86, 180, 233);
pub const GOOD: Color32 = Color32::from_rgb(44, 181, 154);
pub const WARN: Color32 = Color32::from_rgb(230, 159, 0);
pub const BAD: Color32 = Color32::from_rgb(226, 101, 28);
/// Text on [`GOOD`], [`WARN`] and [`BAD`].
pub const ON_SIGNAL: Color32 = Color32::from_rgb(18, 20, 23);

pub const GLAND: Color32 = Color32::from_rgb(196, 142, 132);
/// The body around the gland.
pub const BODY: Color32 = Color32::from_rgb(150, 150, 140);
pub const SPARED: Color32 = Color32::from_rgb(204, 121, 167);
pub const BONE: Color32 = Color32::from_rgb(222, 212, 180);
pub const GHOST: Color32 = Color32::from_rgb(120, 140, 165);
pub const NEEDLE: Color32 = Color32::from_rgb(214, 221, 228);
pub const NEEDLE_TIP: Color32 = Color32::from_rgb(255, 255, 255);
pub const SEED_PLACED: Color32 = Color32::from_rgb(240, 228, 66);
pub const SEED_PLANNED: Color32 = Color32::from_rgb(86, 180, 233);
pub const PATH: Color32 = Color32::from_rgb(170, 182, 196);
pub const ENTRY: Color32 = Color32::from_rgb(44, 181, 154);
pub const GRID: Color32 = Color32::from_rgb(44, 51, 60);

pub const PLOT_FORCE: Color32 = Color32::from_rgb(230, 159, 0);
pub const PLOT_DEPTH: Color32 = Color32::from_rgb(86, 180, 233);
pub const PLOT_WAKE: Color32 = Color32::from_rgb(44, 181, 154);
pub const PLOT_WORK: Color32 = Color32::from_rgb(204, 121, 167);

pub const LEFT_WIDTH: f32 = 286.0;
pub const RIGHT_WIDTH: f32 = 330.0;
pub const GAP: f32 = 6.0;
pub const PADDING: i8 = 8;

/// Sets the dark theme once, at start.
pub fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        style.visuals = visuals();
        style.spacing.item_spacing = egui::vec2(GAP, GAP);
        style.spacing.button_padding = egui::vec2(8.0, 4.0);
        style.spacing.interact_size.y = 24.0;
        let font = |size| FontId::new(size, FontFamily::Proportional);
        style.text_styles.insert(TextStyle::Body, font(13.5));
        style.text_styles.insert(TextStyle::Button, font(13.5));
        style.text_styles.insert(TextStyle::Small, font(11.5));
        style.text_styles.insert(TextStyle::Heading, font(15.5));
        style
            .text_styles
            .insert(TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace));
    });
}

fn visuals() -> Visuals {
    let mut v = Visuals::dark();
    v.panel_fill = PANEL;
    v.window_fill = PANEL;
    v.extreme_bg_color = BACKGROUND;
    v.faint_bg_color = CARD;
    v.override_text_color = Some(TEXT);
    v.hyperlink_color = ACCENT;
    v.selection.bg_fill = Color32::from_rgb(36, 92, 128);
    v.selection.stroke = Stroke::new(1.0, ACCENT);
    v.window_stroke = Stroke::new(1.0, LINE);
    v.widgets.noninteractive.bg_stroke = Stroke::new(1.0, LINE);
    v.widgets.inactive.weak_bg_fill = Color32::from_rgb(49, 58, 69);
    v.widgets.inactive.bg_fill = Color32::from_rgb(49, 58, 69);
    v.widgets.hovered.weak_bg_fill = Color32::from_rgb(62, 74, 88);
    v.widgets.active.weak_bg_fill = Color32::from_rgb(36, 92, 128);
    for w in [&mut v.widgets.inactive, &mut v.widgets.hovered, &mut v.widgets.active] {
        w.corner_radius = CornerRadius::same(4);
    }
    v
}

/// A box that groups what belongs together.
pub fn card() -> egui::Frame {
    egui::Frame::new()
        .fill(CARD)
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::same(PADDING))
}

pub fn side_panel() -> egui::Frame {
    egui::Frame::new().fill(PANEL).inner_margin(Margin::same(PADDING))
}

pub fn strong(text: impl Into<String>) -> egui::RichText {
    egui::RichText::new(text).strong().color(TEXT)
}

pub fn weak(text: impl Into<String>) -> egui::RichText {
    egui::RichText::new(text).color(WEAK)
}

pub fn small(text: impl Into<String>) -> egui::RichText {
    egui::RichText::new(text).color(WEAK).small()
}

/// As the shader takes it: gamma-encoded, 0 to 1.
pub fn rgba(color: Color32, alpha: f32) -> [f32; 4] {
    let [r, g, b, _] = color.to_array();
    [f32::from(r) / 255.0, f32::from(g) / 255.0, f32::from(b) / 255.0, alpha]
}
