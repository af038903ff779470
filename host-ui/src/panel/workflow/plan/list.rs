//! All needles in the order of insertion.

use super::template::needle_mark;
use super::{PlanState, name_of};
use crate::planner::Implant;
use crate::theme;
use egui::{Align2, FontId, Pos2, Rect, Sense, Vec2};
use stylet_base::format;
use stylet_implant::plan::Loading;

const ROW: f32 = 19.0;
/// Fewest visible rows.
const LEAST_ROWS: f32 = 4.0;
/// Height for the findings below, with and without any.
const BELOW: [f32; 2] = [104.0, 40.0];
/// Left edges of the columns: number, hole, seeds, loading, depth, state.
const COLUMNS: [f32; 6] = [22.0, 50.0, 84.0, 122.0, 174.0, 246.0];

pub fn list_ui(ui: &mut egui::Ui, implant: &Implant, state: &mut PlanState) {
    let tokens = theme::of(ui);
    let width = ui.available_width();
    let (head, _) = ui.allocate_exact_size(Vec2::new(width, 15.0), Sense::hover());
    for (name, left) in ["#", "hole", "seeds", "loaded", "depth, mm", "state"]
        .into_iter()
        .zip(COLUMNS)
    {
        let at = Pos2::new(head.left() + left, head.center().y);
        let font = FontId::proportional(11.5);
        ui.painter().text(at, Align2::LEFT_CENTER, name, font, tokens.weak);
    }
    let is_good = implant.problems.as_ref().is_none_or(|p| p.is_empty());
    let below = BELOW[usize::from(is_good)];
    let rows = ((ui.available_height() - below) / ROW).floor().max(LEAST_ROWS);
    ui.spacing_mut().item_spacing.y = 0.0;
    let chosen = state.needle(&implant.plan);
    egui::ScrollArea::vertical()
        .id_salt("needles")
        .max_height(rows * ROW)
        .min_scrolled_height(rows * ROW)
        .auto_shrink([false, false])
        .show(ui, |ui| {
            for number in 0..implant.plan.needles.len() {
                row_ui(ui, implant, number, chosen == Some(number), state);
            }
            if implant.plan.needles.is_empty() {
                ui.label(theme::small("No needle yet: choose a hole and press Enter."));
            }
        });
    ui.spacing_mut().item_spacing.y = theme::GAP;
}

fn row_ui(ui: &mut egui::Ui, implant: &Implant, number: usize, is_chosen: bool, state: &mut PlanState) {
    let (tokens, needle) = (theme::of(ui), &implant.plan.needles[number]);
    let (id, rect) = ui.allocate_space(Vec2::new(ui.available_width(), ROW));
    if is_chosen && state.listed != Some(number) {
        state.listed = Some(number);
        ui.scroll_to_rect_animation(rect, None, egui::style::ScrollAnimation::none());
    }
    // Skip a row that is mostly cut off.
    if ui.clip_rect().expand(0.5).intersect(rect).height() < ROW - 1.0 {
        return;
    }
    let response = ui.interact(rect, id, Sense::click());
    let (name, needle_state) = (name_of(&implant.plan, number), implant.states[number]);
    let (count, depth_mm) = (needle.seeds.len(), format::mm(needle.depth_m));
    let loaded = match needle.loading {
        Loading::Loose => "loose",
        Loading::Stranded { .. } => "strand",
    };
    response.widget_info(|| {
        let text = format!(
            "Needle {}: {name}, {count} seeds, {loaded}, {depth_mm:.1} mm, {}",
            number + 1,
            needle_state.name()
        );
        egui::WidgetInfo::selected(egui::accesskit::Role::Button, ui.is_enabled(), is_chosen, text)
    });
    let fill = match (is_chosen, response.hovered() || response.has_focus()) {
        (true, _) => tokens.selected,
        (false, true) => tokens.widget,
        (false, false) => tokens.panel,
    };
    ui.painter().rect_filled(rect, 2.0, fill);
    mark(ui, rect, implant, number);
    let words = [
        (number + 1).to_string(),
        needle.hole.map_or_else(|| "-".to_owned(), |h| h.to_string()),
        count.to_string(),
        loaded.to_owned(),
        format!("{depth_mm:.1}"),
        needle_state.name().to_owned(),
    ];
    for (word, left) in words.into_iter().zip(COLUMNS) {
        let at = Pos2::new(rect.left() + left, rect.center().y);
        let font = FontId::proportional(12.5);
        ui.painter().text(at, Align2::LEFT_CENTER, word, font, tokens.text);
    }
    if response.clicked() {
        state.look_at(&implant.plan, number);
    }
}

fn mark(ui: &egui::Ui, rect: Rect, implant: &Implant, number: usize) {
    let at = Pos2::new(rect.left() + 10.0, rect.center().y);
    needle_mark(ui.painter(), at, implant.states[number], theme::of(ui));
}
