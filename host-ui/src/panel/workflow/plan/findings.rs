//! Problems of the plan, and limits that its dose violates, in words; a click shows the needle.

use super::{PlanState, name_of};
use crate::dose_worker::{DoseOf, DoseResult, Figure};
use crate::planner::Implant;
use crate::theme;
use crate::words::counted;
use egui::{FontId, RichText, Sense};
use stylet_implant::plan::check::Problem;

pub fn findings_ui(ui: &mut egui::Ui, dose: Option<&DoseResult>, implant: &Implant, state: &mut PlanState) {
    let tokens = theme::of(ui);
    let Some(problems) = &implant.problems else {
        ui.label(theme::small("Checking the plan."));
        return;
    };
    let broken = dose.and_then(|dose| broken(dose, implant));
    let count = problems.len() + broken.as_ref().map_or(0, Vec::len);
    if count == 0 {
        let text = match broken {
            Some(_) => "The plan has no problems.",
            None => "Needles and seeds have no problems; the dose of the plan is not known yet.",
        };
        ui.label(RichText::new(text).color(tokens.good));
        return;
    }
    ui.label(RichText::new(counted(count, "problem")).color(tokens.warn));
    ui.spacing_mut().item_spacing.y = 2.0;
    let height = ui.available_height().max(30.0);
    egui::ScrollArea::vertical()
        .id_salt("findings")
        .max_height(height)
        .auto_shrink([false, true])
        .show(ui, |ui| {
            for criterion in broken.iter().flatten() {
                ui.label(RichText::new(criterion).size(11.5).color(tokens.bad));
            }
            for problem in problems.iter() {
                finding_ui(ui, implant, problem, state);
            }
        });
}

/// Returns the criteria that the dose of the plan fails; `None` for a dose of other seeds.
fn broken(dose: &DoseResult, implant: &Implant) -> Option<Vec<String>> {
    let is_of_plan = dose.of == DoseOf::Plan && dose.seeds == implant.seeds.len();
    is_of_plan.then(|| dose.figures.iter().filter_map(Figure::broken).collect())
}

fn finding_ui(ui: &mut egui::Ui, implant: &Implant, problem: &Problem, state: &mut PlanState) {
    let tokens = theme::of(ui);
    let text = words(implant, problem);
    let font = FontId::proportional(11.5);
    let width = ui.available_width() - 4.0;
    let galley = ui.painter().layout(text.clone(), font, tokens.text, width);
    let (id, rect) = ui.allocate_space(galley.size());
    if ui.clip_rect().expand(0.5).contains_rect(rect) {
        let response = ui.interact(rect, id, Sense::click());
        theme::named(&response, egui::accesskit::Role::Button, || &text);
        if response.hovered() || response.has_focus() {
            ui.painter().rect_filled(rect.expand(1.0), 2.0, tokens.widget);
        }
        if response.clicked()
            && let Some(number) = problem.needle
        {
            state.look_at(&implant.plan, number);
        }
    }
    ui.painter().galley(rect.min, galley, tokens.text);
}

/// Returns a text such as "Needle 3, E5, seed 2: it lies outside the gland".
fn words(implant: &Implant, problem: &Problem) -> String {
    let Some(number) = problem.needle else {
        return problem.what.clone();
    };
    let hole = match implant.plan.needles.get(number).and_then(|n| n.hole) {
        Some(_) => format!(", {}", name_of(&implant.plan, number)),
        None => String::new(),
    };
    let seed = problem.seed.map_or_else(String::new, |s| format!(", seed {}", s + 1));
    format!("Needle {}{hole}{seed}: {}", number + 1, problem.what)
}
