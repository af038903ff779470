//! The row above the steps: the scripted hand, its progress, and its end.

use super::{Guide, Progress, hinted, missing};
use crate::action::{Action, WatchAction};
use crate::shown::{Shown, Watched};
use crate::theme;
use egui::{Align, Button, Layout, Stroke};
use stylet_implant::workflow::Step;
use stylet_shm_schema::EventKind;

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
    let text = waits(shown).unwrap_or_else(|| step.to_owned());
    ui.add(egui::Label::new(theme::weak(text)).truncate());
}

/// Speeds of a recording.
const SPEEDS: [f64; 5] = [0.1, 0.25, 0.5, 1.0, 2.0];

/// Draws a recording: its controls, and its time line.
fn watched_ui(ui: &mut egui::Ui, watched: &Watched, actions: &mut Vec<Action>) {
    let mut asked = |action| actions.push(Action::Watch(action));
    ui.horizontal(|ui| {
        ui.set_min_height(RUN_BUTTON);
        let play = if watched.is_held { "Play" } else { "Pause" };
        let name = if watched.has_ended { "Again" } else { play };
        if ui.add(Button::new(name).min_size(egui::vec2(46.0, 0.0))).clicked() {
            if watched.has_ended {
                asked(WatchAction::Jump(0.0));
            }
            asked(WatchAction::Hold(!watched.has_ended && !watched.is_held));
        }
        let speeds = egui::ComboBox::from_id_salt("speed").width(44.0);
        let speeds = speeds.selected_text(format!("{}\u{d7}", watched.speed));
        let speeds = speeds.show_ui(ui, |ui| {
            for speed in SPEEDS {
                let is_chosen = watched.speed == speed;
                if ui.selectable_label(is_chosen, format!("{speed}\u{d7}")).clicked() {
                    asked(WatchAction::Speed(speed));
                }
            }
        });
        theme::named(&speeds.response, egui::accesskit::Role::ComboBox, || "Speed");
        let text = theme::small(format!("{:.1} of {:.1} s", watched.at_s, watched.length_s));
        ui.label(text).on_hover_text(&watched.name);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let close = ui
                .button("Close")
                .on_hover_text("Returns to rt-core, where you can move the needle");
            if close.clicked() {
                asked(WatchAction::Close);
            }
        });
    });
    time_line_ui(ui, watched, actions);
}

/// Draws the time line with its marks; a click or drag jumps to its place.
fn time_line_ui(ui: &mut egui::Ui, watched: &Watched, actions: &mut Vec<Action>) {
    const HEIGHT: f32 = 22.0;
    const REACH: f32 = 5.0;
    let tokens = theme::of(ui);
    let (rect, response) =
        ui.allocate_exact_size(egui::vec2(ui.available_width(), HEIGHT), egui::Sense::click_and_drag());
    theme::named(&response, egui::accesskit::Role::Slider, || "Time line");
    let line = rect.shrink2(egui::vec2(6.0, 0.0));
    let length_s = watched.length_s.max(1e-9);
    let x_of = |at_s: f64| line.left() + line.width() * (at_s / length_s).clamp(0.0, 1.0) as f32;
    let painter = ui.painter();
    painter.hline(line.x_range(), line.center().y, Stroke::new(2.0, tokens.line));
    painter.hline(
        line.left()..=x_of(watched.at_s),
        line.center().y,
        Stroke::new(2.0, tokens.accent),
    );
    let mut under = None;
    let pointer = response.hover_pos();
    for mark in watched.marks.iter() {
        // Shapes differ as well as colours.
        let (name, color, [up, down]) = match mark.kind {
            EventKind::Puncture => ("puncture", tokens.force, [9.0, 0.0]),
            EventKind::SeedDropped => ("seed dropped", tokens.good, [0.0, 9.0]),
            EventKind::FaultRaised | EventKind::SecondFaultRaised => ("fault", tokens.bad, [10.0, 10.0]),
            EventKind::Mark => ("mark", tokens.accent, [5.0, 5.0]),
            _ => continue,
        };
        let (x, y) = (x_of(mark.at_s), line.center().y);
        painter.vline(x, y - up..=y + down, Stroke::new(2.0, color));
        if pointer.is_some_and(|place| (place.x - x).abs() < REACH) {
            under = Some(format!("{name}, {:.1} s", mark.at_s));
        }
    }
    painter.circle_filled(egui::pos2(x_of(watched.at_s), line.center().y), 5.0, tokens.text);
    if let Some(place) = response.interact_pointer_pos() {
        let share = f64::from((place.x - line.left()) / line.width().max(1.0));
        actions.push(Action::Watch(WatchAction::Jump(share.clamp(0.0, 1.0) * length_s)));
    }
    response.on_hover_text(under.unwrap_or_else(|| "Click to jump to another time".to_owned()));
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
