//! The step of the plan: create, compensate and save it, and show its dose.

use super::super::{WorkflowState, debrief, hinted, main_button, progress, undo_action};
use super::summary;
use crate::action::{Action, PlanAction};
use crate::dialog::Purpose;
use crate::panel::field::path_ui;
use crate::panel::workflow::Undo;
use crate::panel::workflow::job::job_ui;
use crate::planner::Implant;
use crate::shown::Shown;
use crate::theme;
use crate::theme::Press;
use crate::words::{Explained, counted};
use egui::{Button, DragValue};
use std::path::PathBuf;
use stylet_base::format;
use stylet_implant::plan::check::STRENGTHS_U;

pub fn plan_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, ready: bool, actions: &mut Vec<Action>) {
    let free = ready && shown.planning.job.is_none();
    match &shown.planning.implant {
        None => begin_ui(ui, shown, (ready, free), actions),
        Some(implant) => implant_ui(ui, shown, implant, free, actions),
    }
    // Blocked actions make room for the progress of the job.
    match &shown.planning.job {
        Some(work) => {
            if job_ui(ui, &work.what, work.share) {
                actions.push(Action::Plan(PlanAction::Cancel));
            }
        }
        None => file_ui(ui, shown, state, free, actions),
    }
    if shown.planning.implant.is_some() {
        debrief::dose_ui(ui, shown, 60.0, "The dose is computed once the plan has seeds.");
    }
}

/// Draws the choice between one needle and many.
fn begin_ui(ui: &mut egui::Ui, shown: &Shown, (ready, free): (bool, bool), actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        main_button(ui, ("Plan five seeds", Action::PlanSeeds), ready, actions);
        let undo = Press("Withdraw the plan", "Ctrl+Z").ui(ui, ready && undo_action(shown) == Some(Undo::Plan));
        actions.extend(undo.then_some(Action::Undo));
    });
    if shown.planning.can_restore {
        let restore = Press("Restore the discarded plan", "As it was, with its rehearsals").ui(ui, free);
        actions.extend(restore.then_some(Action::Plan(PlanAction::Restore)));
    }
    ui.label(theme::small("Or many needles through the template:"));
    ui.horizontal(|ui| {
        automatic_ui(ui, shown, free, actions);
        let empty = Press("Empty plan", "Choose the holes yourself").ui(ui, free && shown.planning.outlines.is_some());
        actions.extend(empty.then_some(Action::Plan(PlanAction::Begin)));
    });
}

fn automatic_ui(ui: &mut egui::Ui, shown: &Shown, free: bool, actions: &mut Vec<Action>) {
    let can = free && shown.planning.outlines.is_some();
    let hint = "Needles, seeds and one strength that cover the target and keep the limits of urethra and rectum: three proposals to \
                choose from";
    let response = Press("Automatic plan", hint).ui(ui, can);
    actions.extend(response.then_some(Action::Plan(PlanAction::Automatic)));
}

fn implant_ui(ui: &mut egui::Ui, shown: &Shown, implant: &Implant, free: bool, actions: &mut Vec<Action>) {
    ui.label(summary(implant));
    let waits = shown.planning.waits();
    ui.horizontal(|ui| {
        if waits {
            let blocked = shown
                .planning
                .next_needle()
                .is_none()
                .then(|| "add a needle with seeds first".to_owned());
            let first = ui.add_enabled(free && blocked.is_none(), Button::new("First needle"));
            let hint = "Enter: accept the plan and begin with its first needle";
            if hinted(first, blocked).on_hover_text(hint).clicked() {
                actions.push(Action::Plan(PlanAction::NextNeedle));
            }
        } else {
            super::next_needle_ui(ui, shown, actions);
        }
        // The path of a needle in the tissue is needed to take it out.
        let outside = shown.is_in_tissue().then(|| "take the needle out first".to_owned());
        let discard = ui.add_enabled(free && outside.is_none(), Button::new("Discard the plan"));
        let hint = "Returns to one needle; Ctrl+Z restores the plan";
        if hinted(discard, outside).on_hover_text(hint).clicked() {
            actions.push(Action::Plan(PlanAction::Discard));
        }
    });
    ui.horizontal(|ui| {
        ui.add_enabled_ui(waits, |ui| automatic_ui(ui, shown, free, actions));
        let compensate = ui.add_enabled(
            free && shown.planning.next_needle().is_some(),
            Button::new("Compensate"),
        );
        let hint = "Rehearses each needle and shifts its drops so that the seeds rest where they are planned";
        let compensate = compensate.on_hover_text(hint).explained("rehearsal");
        if compensate.explained("compensation").clicked() {
            actions.push(Action::Plan(PlanAction::Compensate));
        }
    });
    compensated_ui(ui, implant);
    if waits {
        super::proposals::proposals_ui(ui, shown, free, actions);
    }
    if shown.planning.job.is_none() {
        strength_ui(ui, implant, free && waits, actions);
    }
}

fn compensated_ui(ui: &mut egui::Ui, implant: &Implant) {
    let errors: Vec<f64> = implant.rest_errors_m.iter().flatten().copied().collect();
    if errors.is_empty() {
        return;
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let sensitive = implant.sensitive.iter().flatten().count();
    let text = format!(
        "{} of {} needles compensated, to {:.2} mm{}",
        errors.len(),
        implant.plan.needles.len(),
        format::mm(mean),
        match sensitive {
            0 => String::new(),
            n => format!("; {} sensitive", counted(n, "seed")),
        }
    );
    super::weak_line(ui, text).explained("sensitive");
}

fn strength_ui(ui: &mut egui::Ui, implant: &Implant, free: bool, actions: &mut Vec<Action>) {
    let Some(first) = implant.seeds.first() else { return };
    ui.horizontal(|ui| {
        let label = ui.label(theme::small("Each seed"));
        let mut strength_u = first.strength_u;
        let value = DragValue::new(&mut strength_u)
            .range(STRENGTHS_U[0]..=STRENGTHS_U[1])
            .speed(0.005)
            .fixed_decimals(3)
            .update_while_editing(false)
            .clamp_existing_to_range(false)
            .suffix(" U");
        let response = ui.add_enabled(free, value).labelled_by(label.id);
        if response.changed() && strength_u != first.strength_u {
            actions.push(Action::Plan(PlanAction::SetStrength(strength_u)));
        }
        let fit = Press(
            "Fit dose",
            "The strength at which 96 % of the target receives the prescription",
        )
        .ui(ui, free);
        actions.extend(fit.then_some(Action::Plan(PlanAction::FitStrength)));
    });
}

/// Width of the buttons next to the field of the plan's file.
const BESIDE_FIELD: f32 = 170.0;

/// Draws the dialogs by name of the format.
fn dialogs_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let menu = ui.menu_button("…", |ui| {
        let import = [(Purpose::ImportPlan, progress::is_before_needles(shown))];
        let saves = Purpose::SAVES.map(|purpose| (purpose, shown.planning.implant.is_some()));
        for (purpose, can) in import.into_iter().chain(saves) {
            if ui
                .add_enabled(can, Button::new(format!("{}…", purpose.title())))
                .clicked()
            {
                actions.push(Action::PickFile(purpose));
            }
        }
    });
    menu.response.on_hover_text("Choose the file in a dialog");
}

fn file_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, free: bool, actions: &mut Vec<Action>) {
    if crate::IN_PAGE {
        return;
    }
    ui.horizontal(|ui| {
        let width = ui.available_width() - BESIDE_FIELD;
        let field = path_ui(ui, "plan file", &mut state.plan.path, "plan file", width);
        let name = || "Plan file: .toml, .csv or .dcm";
        theme::named(&field, egui::accesskit::Role::TextInput, name);
        let field = field.on_hover_text(".toml holds the whole plan; .csv and .dcm (RT Plan) hold its seeds");
        let path = state.plan.path.trim();
        let has_name = free && !path.is_empty();
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        let can_read = has_name && progress::is_before_needles(shown);
        let import = ui.add_enabled(can_read, Button::new("Import"));
        if (import.clicked() || entered) && can_read {
            actions.push(Action::Plan(PlanAction::Import(PathBuf::from(path))));
        }
        let export =
            Press("Save", "Writes to the file named at the left").ui(ui, has_name && shown.planning.implant.is_some());
        actions.extend(export.then(|| Action::Plan(PlanAction::Export(PathBuf::from(path)))));
        ui.add_enabled_ui(free, |ui| dialogs_ui(ui, shown, actions));
    });
    if shown.planning.implant.is_some() {
        study_ui(ui, free, actions);
    }
}

/// Draws the export of structure set, plan and dose.
fn study_ui(ui: &mut egui::Ui, free: bool, actions: &mut Vec<Action>) {
    let hint = "RT Structure Set, RT Plan and RT Dose that reference each other, in a new folder; patient and frame of reference \
                come from the scene's file if that is DICOM";
    let response = Press("Save as DICOM study", hint).ui(ui, free);
    actions.extend(response.then_some(Action::Plan(PlanAction::ExportStudy)));
}
