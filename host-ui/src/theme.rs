//! Colours, sizes and spacings as tokens; nothing else in the window names a colour.
//!
//! Hues come from the Okabe-Ito set, whose colours stay distinct with any common colour blindness;
//! no meaning rests on hue alone.

mod tokens;

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, RichText, Stroke, TextStyle, Theme, Visuals};
pub use tokens::{DARK, IMAGE, LIGHT, Tokens};

pub const LEFT_WIDTH: f32 = 286.0;
pub const RIGHT_WIDTH: f32 = 330.0;
pub const GAP: f32 = 6.0;
pub const PADDING: i8 = 8;

/// Returns the tokens of the theme that is shown.
pub fn of(ui: &egui::Ui) -> &'static Tokens {
    tokens(ui.visuals().dark_mode)
}

pub fn tokens(dark: bool) -> &'static Tokens {
    if dark { &DARK } else { &LIGHT }
}

/// Returns the colours of the lines over a slice, by their names.
pub fn colors_of_lines() -> Vec<(String, Color32)> {
    let i = &IMAGE;
    let outlines = [
        ("target", i.gland),
        ("urethra", i.urethra),
        ("rectum", i.rectum),
        ("bladder", i.bladder),
        ("bone", i.bone),
    ];
    let outlines = outlines.map(|(name, color)| (name.to_owned(), color));
    let levels = i.isodose.iter().enumerate();
    let levels = levels.map(|(level, color)| (format!("isodose line {level}"), *color));
    outlines.into_iter().chain(levels).collect()
}

/// Installs both themes at start; a setting selects the one shown.
pub fn apply(ctx: &egui::Context) {
    // The keys change a setting, because text also follows the size of the window.
    ctx.options_mut(|options| options.zoom_with_keyboard = false);
    for (theme, tokens) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| {
            style.visuals = visuals(theme, tokens);
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
}

fn visuals(theme: Theme, t: &Tokens) -> Visuals {
    let mut v = match theme {
        Theme::Dark => Visuals::dark(),
        Theme::Light => Visuals::light(),
    };
    v.panel_fill = t.panel;
    v.window_fill = t.panel;
    v.extreme_bg_color = t.background;
    v.text_edit_bg_color = Some(t.background);
    v.faint_bg_color = t.card;
    v.override_text_color = Some(t.text);
    v.weak_text_color = Some(t.weak);
    v.hyperlink_color = t.accent;
    v.warn_fg_color = t.warn;
    v.error_fg_color = t.bad;
    v.selection.bg_fill = t.selected;
    v.selection.stroke = Stroke::new(1.0, t.accent);
    v.window_stroke = Stroke::new(1.0, t.line);
    v.widgets.noninteractive.bg_stroke = Stroke::new(1.0, t.line);
    v.widgets.inactive.weak_bg_fill = t.widget;
    v.widgets.inactive.bg_fill = t.widget;
    v.widgets.hovered.weak_bg_fill = t.widget_hovered;
    v.widgets.active.weak_bg_fill = t.selected;
    v.widgets.active.fg_stroke = Stroke::new(1.5, t.text);
    for w in [&mut v.widgets.inactive, &mut v.widgets.hovered, &mut v.widgets.active] {
        w.corner_radius = CornerRadius::same(4);
    }
    v
}

/// Returns a frame around widgets that belong together.
pub fn card(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::new()
        .fill(of(ui).card)
        .corner_radius(CornerRadius::same(6))
        .inner_margin(Margin::same(PADDING))
}

pub fn side_panel(ui: &egui::Ui) -> egui::Frame {
    egui::Frame::new()
        .fill(of(ui).panel)
        .inner_margin(Margin::same(PADDING))
}

pub fn strong(text: impl Into<String>) -> RichText {
    RichText::new(text).strong()
}

pub fn weak(text: impl Into<String>) -> RichText {
    RichText::new(text).weak()
}

pub fn small(text: impl Into<String>) -> RichText {
    RichText::new(text).weak().small()
}

/// Names a widget for screen readers and tests.
pub fn named<S: ToString>(response: &egui::Response, role: egui::accesskit::Role, name: impl Fn() -> S) {
    response.widget_info(|| egui::WidgetInfo::labeled(role, response.enabled(), name()));
}

/// Writes the heads of a table's columns.
pub fn heads<const N: usize>(ui: &mut egui::Ui, names: [&str; N]) {
    for name in names {
        ui.label(small(name));
    }
    ui.end_row();
}

/// Button by its name, with a tooltip.
pub struct Press<'a>(pub &'a str, pub &'a str);

impl Press<'_> {
    /// Draws the button; returns whether it was pressed.
    pub fn ui(self, ui: &mut egui::Ui, can: bool) -> bool {
        let button = ui.add_enabled(can, egui::Button::new(self.0));
        button.on_hover_text(self.1).clicked()
    }
}

/// Returns the colour for the shader: gamma-encoded, 0 to 1.
pub fn rgba(color: egui::Color32, alpha: f32) -> [f32; 4] {
    let [r, g, b, _] = color.to_array();
    [f32::from(r) / 255.0, f32::from(g) / 255.0, f32::from(b) / 255.0, alpha]
}
