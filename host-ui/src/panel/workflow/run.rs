//! The row above the steps: the scripted hand, its progress, and its end.

use super::{Guide, Progress, hinted, missing};
use crate::action::{Action, WatchAction};
use crate::shown::{Shown, Watched};
use crate::theme;
use egui::{Align, Button, Layout};
use stylet_implant::workflow::Step;

/// Steps that the script takes for a plan of one needle, by their numbers in the panel.
pub const SCRIPTED_STEPS: &str = "steps 2 to 6";
/// Heights of the button that runs the script, alone and with the line under it.
const RUN_BUTTON: f32 = 28.0;
const RUN_HEIGHT: f32 = RUN_BUTTON + theme::GAP + 24.0;
/// Waiting time beyond which the reason is shown.
const SHOW_WAITING_S: f64 = 2.0;

/// Draws the row, always with the same height.
pub fn run_ui(ui: &mut egui::Ui, shown: &Shown, guide: &mut Guide, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.heading("Procedure");
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| guide.toggle_ui(ui));
    });
    let size = egui::vec2(ui.available_width(), RUN_HEIGHT);
    ui.allocate_ui(size, |ui| {
        ui.set_min_size(size);
        match (&shown.watched, shown.running) {
            (Some(watched), _) => watched_ui(ui, watched, actions),
            (None, true) => running_ui(ui, shown, actions),
            (None, false) => begin_ui(ui, shown, actions),
        }
    });
}

fn running_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let step = match shown.run_step {
        Some(Step::Plan) => "planning",
        Some(Step::Place) => "placing the needle",
        Some(Step::Insert) => "inserting",
        Some(Step::Drop) => "dropping the seeds",
        Some(Step::Retract) => "retracting",
        Some(Step::Settle) => "waiting for the tissue to rest",
        Some(Step::Done) | None => "finishing",
    };
    ui.horizontal(|ui| {
        ui.set_min_height(RUN_BUTTON);
        ui.spinner();
        ui.label(match shown.run_needle {
            Some((needle, count)) => format!("Needle {} of {count}", needle + 1),
            None => "Running".to_owned(),
        });
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.button("Stop").clicked() {
                actions.push(Action::StopRun);
            }
        });
    });
    // On a separate line, because a long text must not widen the panel.
    let text = match waits(shown) {
        Some(waits) => format!("{step}: {waits}"),
        None => step.to_owned(),
    };
    ui.add(egui::Label::new(theme::weak(text)).truncate());
}

/// Draws a recording: its progress, and its end.
fn watched_ui(ui: &mut egui::Ui, watched: &Watched, actions: &mut Vec<Action>) {
    let mut asked = |action| actions.push(Action::Watch(action));
    ui.horizontal(|ui| {
        ui.set_min_height(RUN_BUTTON);
        let (name, action) = match (watched.has_ended, watched.is_held) {
            (true, _) => ("Again", WatchAction::Again),
            (false, true) => ("Resume", WatchAction::Hold(false)),
            (false, false) => ("Pause", WatchAction::Hold(true)),
        };
        if ui.button(name).clicked() {
            asked(action);
        }
        ui.label(format!("{:.0} of {:.0} s", watched.at_s.floor(), watched.length_s));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let close = ui
                .button("Close")
                .on_hover_text("Back to rt-core, where the needle can be moved");
            if close.clicked() {
                asked(WatchAction::Close);
            }
        });
    });
    let text = format!("Recording: {}", watched.name);
    ui.add(egui::Label::new(theme::weak(&text)).truncate())
        .on_hover_text(&watched.name);
}

fn begin_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let wide = egui::vec2(ui.available_width(), RUN_BUTTON);
    let blocked = missing(shown, Progress::Plan);
    let response = ui.add_enabled(blocked.is_none(), Button::new(run_name(shown)).min_size(wide));
    if hinted(response, blocked).on_hover_text(run_help(shown)).clicked() {
        actions.push(Action::RunAll);
    }
    if shown.continues_at.is_none() {
        // The full sentence has no room here and is the button's tooltip.
        ui.add(egui::Label::new(theme::small("By a scripted hand")).truncate());
        return;
    }
    let anew = ui.add_enabled(shown.is_live(), Button::new("Start over"));
    let help = "Removes all seeds from the tissue and begins at the first needle";
    if anew.on_hover_text(help).clicked() {
        actions.push(Action::StartOver);
    }
}

/// Returns the reason why the script waits, once that takes longer than usual.
pub(super) fn waits(shown: &Shown) -> Option<String> {
    let waiting = shown.run_waits.filter(|waiting| waiting.for_s >= SHOW_WAITING_S)?;
    Some(format!("waiting for {}, {:.0} s", waiting.waits_for, waiting.for_s))
}

pub(super) fn run_name(shown: &Shown) -> String {
    if let Some((needle, count)) = shown.continues_at {
        return format!("Continue at needle {} of {count}", needle + 1);
    }
    match needle_count(shown) {
        0 => format!("Run {SCRIPTED_STEPS}"),
        count => format!("Run all {count} needles"),
    }
}

fn run_help(shown: &Shown) -> &'static str {
    if shown.continues_at.is_some() {
        return "The seeds in the tissue stay; the scripted hand continues with the first missing seed";
    }
    match needle_count(shown) {
        0 => "A scripted hand plans five seeds, places the needle, inserts it, drops the seeds and retracts it",
        _ => "A scripted hand places each needle in turn, inserts it, drops its seeds and retracts it",
    }
}

/// Returns the number of needles of the plan; 0 if the script plans the only one.
fn needle_count(shown: &Shown) -> usize {
    shown.planning.implant.as_ref().map_or(0, |i| i.plan.needles.len())
}
