//! A field for a file's path: it shows the end of the path unless it has the focus, and the whole
//! path on hover.

use egui::{Response, TextEdit, TextStyle};

/// Width of the three dots and the margins of the field.
const BESIDE: f32 = 24.0;

pub fn path_ui(ui: &mut egui::Ui, name: &str, path: &mut String, hint: &str, width: f32) -> Response {
    let id = ui.make_persistent_id(name);
    let shown = match ui.memory(|m| m.has_focus(id)) {
        true => None,
        false => end_of(ui, path, width - BESIDE),
    };
    let edit = |text: &mut String, ui: &mut egui::Ui| {
        let edit = TextEdit::singleline(text).id(id).hint_text(hint).desired_width(width);
        ui.add(edit)
    };
    let response = match shown {
        Some(mut end) => edit(&mut end, ui),
        None => edit(path, ui),
    };
    if path.is_empty() {
        return response;
    }
    response.on_hover_text(path.as_str())
}

/// Returns the end of a path that does not fit the room.
fn end_of(ui: &egui::Ui, path: &str, room: f32) -> Option<String> {
    let font = TextStyle::Body.resolve(ui.style());
    let whole = ui.painter().layout_no_wrap(path.to_owned(), font, egui::Color32::WHITE);
    let row = whole.rows.first()?;
    let width = row.size.x;
    if width <= room + BESIDE / 2.0 {
        return None;
    }
    let fits = row.glyphs.iter().filter(|glyph| width - glyph.pos.x <= room).count();
    let skipped = path.chars().count().saturating_sub(fits);
    Some(format!("…{}", path.chars().skip(skipped).collect::<String>()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_path_shows_its_end_and_a_short_one_all() {
        let ctx = egui::Context::default();
        let mut ends = (None, None);
        let output = ctx.run_ui(egui::RawInput::default(), |ui| {
            ends = (
                end_of(ui, "/srv/a/very/long/way/to/the/file/gland.nrrd", 120.0),
                end_of(ui, "gland.nrrd", 120.0),
            );
        });
        output.drop_without_applying_deltas();
        let long = ends.0.expect("too long");
        assert!(
            long.starts_with('…') && long.ends_with("gland.nrrd") && long.chars().count() < 25,
            "{long}"
        );
        assert_eq!(ends.1, None);
    }
}
