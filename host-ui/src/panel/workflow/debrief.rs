//! The debrief: the error of each seed, the dose with its limits, the histogram of the target.

use crate::action::Action;
use crate::dose_worker::{DoseOf, DoseResult, Figure};
use crate::panel::axis::{plot, upwards};
use crate::shown::{SeedError, Shown, all_errors};
use crate::theme;
use crate::words::{Explained, counted};
use egui::RichText;
use egui_plot::{Line, PlotPoints, VLine};
use stylet_base::format;
use stylet_shm_schema::touching;

/// Place of the debrief's files.
const AS: &str = if crate::IN_PAGE {
    "as downloads"
} else {
    "in a new folder under out/"
};

pub fn debrief_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let save = ui.add_enabled(!shown.seeds.is_empty(), egui::Button::new("Save the debrief"));
    if save
        .on_hover_text(format!("A page and its figures: debrief.html and score.json, {AS}"))
        .clicked()
    {
        actions.push(Action::SaveDebrief);
    }
    dose_ui(ui, shown, 60.0, "The dose is computed once seeds lie in the tissue.");
    updates_ui(ui, shown);
    seeds_ui(ui, shown, &all_errors(shown));
}

/// Draws one line for each update of the plan: the distance of its contour from the true gland.
fn updates_ui(ui: &mut egui::Ui, shown: &Shown) {
    for update in &shown.planning.review.reviewed {
        let what = if update.accepted { "updated" } else { "kept" };
        let contour = update.agreement.map_or_else(String::new, |a| {
            format!(": contour Dice {:.2}, {:.1} mm off", a.dice, format::mm(a.mean_m))
        });
        let text = format!("Plan {what} after needle {}{contour}", update.update.begun);
        let label = ui.add(egui::Label::new(theme::small(text)).truncate());
        label.on_hover_text("The gland contoured on the live picture, against the true gland at that moment");
    }
}

/// Draws figures and histogram of the placed or planned seeds, in this height.
pub fn dose_ui(ui: &mut egui::Ui, shown: &Shown, height: f32, otherwise: &str) {
    let Some(dose) = &shown.dose else {
        ui.label(theme::small(shown.dose_trouble.unwrap_or(otherwise)));
        return;
    };
    let what = format!(
        "Dose: {} seeds of {}, {:.0} Gy",
        dose.seeds, dose.source, dose.prescription_gy
    );
    ui.label(what).explained("source").explained("prescription");
    if shown.is_one_needle_by_hand() {
        ui.label(theme::small("One needle is not an implant: no dose limits apply."));
        return;
    }
    if let Some(words) = moved_words(dose, shown.body_moved_m) {
        ui.label(theme::small(&words));
    }
    ui.spacing_mut().interact_size.y = 16.0;
    egui::Grid::new("dose")
        .num_columns(5)
        .striped(true)
        .spacing([5.0, 2.0])
        .show(ui, |ui| {
            for figure in &dose.figures {
                figure_ui(ui, figure);
            }
        });
    dvh_ui(ui, dose, height);
}

fn figure_ui(ui: &mut egui::Ui, figure: &Figure) {
    let tokens = theme::of(ui);
    ui.label(theme::small(&figure.structure));
    let metric = figure.metric.to_string();
    ui.label(&metric).explained(&metric);
    ui.monospace(figure.shown());
    if let Some(limit) = figure.limit {
        ui.label(theme::small(limit.to_string()));
        let is_met = limit.is_met(figure.value);
        let color = if is_met { tokens.good } else { tokens.bad };
        ui.label(RichText::new(limit.verdict(figure.value)).color(color));
    }
    ui.end_row();
}

fn dvh_ui(ui: &mut egui::Ui, dose: &DoseResult, height: f32) {
    let tokens = theme::of(ui);
    ui.label(theme::small("Target: volume over dose, both in %"))
        .explained("DVH");
    let points: Vec<[f64; 2]> = dose.target_dvh.iter().map(|[x, y]| [x * 100.0, y * 100.0]).collect();
    plot("dvh", height)
        .include_x(0.0)
        .include_x(300.0)
        .include_y(0.0)
        .include_y(100.0)
        .show_x(true)
        .show_y(true)
        .y_grid_spacer(upwards)
        .show(ui, |plot| {
            plot.vline(VLine::new("prescription", 100.0).color(tokens.weak));
            plot.line(
                Line::new("target", PlotPoints::new(points))
                    .color(tokens.depth)
                    .width(1.6),
            );
        });
}

/// Explains to which body the figures apply, while an exercise has moved it.
fn moved_words(dose: &DoseResult, body_moved_m: [f64; 3]) -> Option<String> {
    let moved_mm = body_moved_m.iter().map(|c| c * c).sum::<f64>().sqrt() * 1e3;
    let words = match dose.of {
        DoseOf::Tissue => "with its seeds",
        DoseOf::Plan => "and the plan has not",
    };
    (moved_mm > 0.05).then(|| format!("The gland has moved by {moved_mm:.1} mm, {words}."))
}

/// Draws the seeds; nothing until the first one is placed.
pub fn seeds_ui(ui: &mut egui::Ui, shown: &Shown, rows: &[(usize, SeedError)]) {
    if shown.seeds.is_empty() || rows.is_empty() {
        return;
    }
    let is_one_of_many = shown.plan.is_some_and(|plan| plan.prescribed.needle > 0);
    let has_many = is_one_of_many || shown.planning.implant.is_some();
    ui.horizontal(|ui| {
        ui.label(theme::strong("Seed error, mm"))
            .explained("error of a seed")
            .on_hover_text("Present position of the seed relative to plan; along the needle, deeper is positive");
        let placed = rows.iter().map(|(_, row)| row).filter(|r| r.placed.is_some());
        let placed: Vec<f64> = placed.map(total_m).collect();
        if let Some(text) = mean_and_worst(&placed) {
            ui.label(theme::small(text));
        }
    });
    let touch = |number: &usize| !touching(&shown.seeds, *number).is_empty();
    let touching = (0..shown.seeds.len()).filter(touch).count();
    if touching > 0 {
        let touch = if touching == 1 { "touches" } else { "touch" };
        ui.label(theme::small(format!(
            "{} {touch} a neighbour",
            counted(touching, "seed")
        )));
    }
    for (needle, row) in rows {
        if let Some(place) = shown.outside(*needle, row) {
            let text = format!("Seed {} {place}", number_of(has_many.then_some(*needle), row));
            ui.label(RichText::new(text).small().color(theme::of(ui).warn));
        }
    }
    // The list is last and does not scroll by itself, so that the wheel moves the whole panel.
    ui.spacing_mut().interact_size.y = 16.0;
    let grid = egui::Grid::new("seed errors").num_columns(4).striped(true);
    grid.min_col_width(52.0).spacing([8.0, 2.0]).show(ui, |ui| {
        theme::heads(ui, ["seed", "along", "across", "total"]);
        for (needle, row) in rows {
            seed_row_ui(ui, has_many.then_some(*needle), row);
        }
    });
}

/// Formats mean and largest error; `None` while no seed of the list is placed.
fn mean_and_worst(errors_m: &[f64]) -> Option<String> {
    let worst = errors_m.iter().copied().reduce(f64::max)?;
    let mean = errors_m.iter().sum::<f64>() / errors_m.len() as f64;
    Some(format!("mean {:.2}, worst {:.2}", format::mm(mean), format::mm(worst)))
}

fn total_m(row: &SeedError) -> f64 {
    row.along_m.hypot(row.across_m)
}

/// Draws one seed, with the number of its needle if there are many.
fn seed_row_ui(ui: &mut egui::Ui, needle: Option<usize>, row: &SeedError) {
    ui.label(number_of(needle, row));
    if row.placed.is_some() {
        ui.monospace(format::signed_mm(row.along_m));
        ui.monospace(format!("{:.2}", format::mm(row.across_m)));
        ui.monospace(format!("{:.2}", format::mm(total_m(row))));
    } else {
        ui.label(theme::small("not placed"));
        ui.label("");
        ui.label("");
    }
    ui.end_row();
}

fn number_of(needle: Option<usize>, row: &SeedError) -> String {
    let number = row.planned + 1;
    needle.map_or_else(|| number.to_string(), |n| format!("{}.{number}", n + 1))
}

#[cfg(test)]
mod tests {
    use super::mean_and_worst;

    #[test]
    fn errors_have_a_mean_only_once_a_seed_is_placed() {
        assert_eq!(mean_and_worst(&[]), None);
        assert_eq!(mean_and_worst(&[1e-3, 4e-3]).as_deref(), Some("mean 2.50, worst 4.00"));
    }
}
