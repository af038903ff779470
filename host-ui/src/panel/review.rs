//! The update of the plan on the live picture: the drawing, the dose before and after, and the
//! decision.

use crate::action::{Action, PlanAction};
use crate::panel::workflow::job::job_ui;
use crate::planner::{Edit, Implant, ReviewShown};
use crate::shown::Shown;
use crate::theme;
use crate::theme::Press;
use crate::view::state::Tool;
use crate::words::counted;
use egui::{Button, RichText};
use stylet_base::format;
use stylet_implant::intraoperative::{PLANES, Reviewed, SeedsFrom};
use stylet_implant::plan::optimise::{Figures, Measure};

/// Draws the panel; `at_m` is the place of the transverse plane along the axis of the probe.
pub fn review_ui(ui: &mut egui::Ui, shown: &Shown, tool: &mut Option<Tool>, at_m: Option<f64>) -> Vec<Action> {
    let mut actions = Vec::new();
    let review = &shown.planning.review;
    head_ui(ui, tool, review, &mut actions);
    ui.add_space(theme::GAP);
    match tool {
        Some(Tool::Contour) => contour_ui(ui, review, at_m, &mut actions),
        Some(Tool::Seeds) => marks_ui(ui, shown),
        None => {}
    }
    ui.separator();
    let missing = missing(shown);
    dose_ui(ui, shown, &mut actions);
    ui.separator();
    if let Some(work) = &shown.planning.job {
        if job_ui(ui, &work.what, work.share) {
            actions.push(Action::Plan(PlanAction::Cancel));
        }
        return actions;
    }
    match &review.update {
        Some(update) => decision_ui(ui, update, &mut actions),
        None => update_ui(ui, shown, missing, &mut actions),
    }
    actions
}

fn head_ui(ui: &mut egui::Ui, tool: &mut Option<Tool>, review: &ReviewShown, actions: &mut Vec<Action>) {
    let mut draw = |edit| actions.push(Action::Plan(PlanAction::Draw(edit)));
    ui.horizontal(|ui| {
        ui.heading("Update the plan");
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if ui.button("Close").on_hover_text("The drawing is kept").clicked() {
                *tool = None;
            }
        });
    });
    ui.horizontal(|ui| {
        for one in Tool::ALL {
            if ui.selectable_label(*tool == Some(one), one.name()).clicked() {
                *tool = Some(one);
            }
        }
        ui.separator();
        if ui.button("Undo").on_hover_text("Ctrl+Z").clicked() {
            draw(Edit::Undo);
        }
        if ui.button("Redo").on_hover_text("Ctrl+Shift+Z").clicked() {
            draw(Edit::Redo);
        }
        let is_empty = review.drawn == Default::default();
        let clear = ui.add_enabled(!is_empty, Button::new("Clear"));
        if clear.on_hover_text("Removes all points and marks").clicked() {
            draw(Edit::Clear);
        }
    });
}

fn contour_ui(ui: &mut egui::Ui, review: &ReviewShown, at_m: Option<f64>, actions: &mut Vec<Action>) {
    let contour = &review.drawn.contour;
    let words = "Click the edge of the gland in the transverse picture, some six points in a plane; PgUp and PgDn step the probe. Drag moves \
                 a point, the right button or Del removes it. Dashed: the outline proposed by other planes.";
    ui.label(theme::weak(words));
    let here = at_m
        .and_then(|at_m| contour.at(at_m))
        .map_or(0, |clicks| clicks.points_m.len());
    ui.horizontal(|ui| {
        ui.label(format!("This plane: {}", counted(here, "point")));
        let proposed = at_m.filter(|at_m| here == 0 && review.outline_at(*at_m).is_some());
        let take = ui.add_enabled(proposed.is_some(), Button::new("Accept the proposal"));
        let hint = "Converts the dashed outline into points of this plane that can be dragged";
        if let (true, Some(at_m)) = (take.on_hover_text(hint).clicked(), proposed) {
            actions.push(Action::Plan(PlanAction::Draw(Edit::TakeOver { at_m })));
        }
    });
    let solid = review.solid.as_ref();
    let volume = review.volume_m3.filter(|_| solid.is_some());
    let volume = volume.map_or_else(String::new, |m3| format!(", {:.1} cc", m3 * 1e6));
    let length = solid.map(|solid| solid.poles_m());
    let length = length.map_or_else(String::new, |[from, to]| {
        format!(", {} long", format::length(to - from))
    });
    let (planes, points) = (contour.planes().len(), contour.points());
    ui.label(format!(
        "{} in {}{length}{volume}",
        counted(points, "point"),
        counted(planes, "plane")
    ));
}

fn marks_ui(ui: &mut egui::Ui, shown: &Shown) {
    let review = &shown.planning.review;
    let words =
        "Click each seed that you see, in either picture. Drag moves a mark, the right button or Del removes it.";
    ui.label(theme::weak(words));
    let marks = review.drawn.marks_m.len();
    let without_mark = review.marks.without_mark();
    ui.label(format!(
        "{} for {}",
        counted(marks, "mark"),
        counted(shown.seeds.len(), "seed")
    ));
    if review.marks.of_seeds.is_empty() || marks == 0 {
        return;
    }
    if let Some([mean, worst]) = review.marks.residuals_m() {
        ui.label(theme::small(format!(
            "From mark to seed, mm: mean {:.1}, worst {:.1}",
            format::mm(mean),
            format::mm(worst)
        )));
    }
    let of_none = review.marks.without_seed.len();
    if without_mark + of_none > 0 {
        let text = format!(
            "{} without a mark, {} without a seed",
            counted(without_mark, "seed"),
            counted(of_none, "mark")
        );
        ui.label(RichText::new(text).color(theme::of(ui).warn));
    }
}

fn dose_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let review = &shown.planning.review;
    ui.horizontal(|ui| {
        ui.label(theme::strong("Dose"));
        for which in [SeedsFrom::Tissue, SeedsFrom::Marks] {
            if ui.selectable_label(review.seeds_from == which, which.name()).clicked() {
                actions.push(Action::Plan(PlanAction::SeedsFrom(which)));
            }
        }
        if review.is_assessing {
            ui.spinner();
        }
    });
    let update = review.update.as_ref().map(|proposed| &proposed.update);
    let doses = update.map(|update| update.doses).or(review.doses);
    let Some(doses) = doses else {
        let why = review
            .trouble
            .as_deref()
            .unwrap_or("Available once the gland is contoured and a seed lies in it.");
        ui.label(theme::small(why));
        return;
    };
    let columns = [Some(doses.now), Some(doses.continued), update.map(|u| u.updated)];
    egui::Grid::new("doses of the update")
        .num_columns(4)
        .striped(true)
        .spacing([10.0, 3.0])
        .show(ui, |ui| {
            theme::heads(ui, ["%", "now", "if continued", "updated"]);
            let measures: Vec<Measure> = doses.continued.measures().collect();
            for row in &measures {
                ui.label(row.name);
                columns
                    .iter()
                    .for_each(|figures| value_ui(ui, figures.as_ref(), row.name));
                ui.end_row();
            }
            ui.label("target V200");
            for figures in columns {
                ui.monospace(figures.map_or_else(String::new, |f| format!("{:.1}", f.v200)));
            }
            ui.end_row();
        });
    let planning = &shown.planning;
    if let Some(text) = planning
        .implant
        .as_ref()
        .and_then(|i| rehearsed(i, planning.progress.begun()))
    {
        ui.label(theme::small(text));
    }
}

/// Returns the rehearsed share of the continued plan's dose; nothing if no needle is left.
fn rehearsed(implant: &Implant, begun: usize) -> Option<String> {
    let left = || implant.plan.needles.iter().zip(&implant.rest_errors_m).skip(begun);
    let with_seeds = || left().filter(|(needle, _)| !needle.seeds.is_empty());
    let (needles, rehearsed) = (
        with_seeds().count(),
        with_seeds().filter(|(_, error)| error.is_some()).count(),
    );
    match (needles, rehearsed) {
        (0, _) => None,
        (_, 0) => Some("If continued: seeds as planned. Compensate predicts where they come to rest.".to_owned()),
        (n, m) if n == m => Some(format!(
            "If continued: seeds of {} at their rehearsed positions.",
            counted(n, "needle")
        )),
        (n, m) => Some(format!(
            "If continued: seeds of {m} of {n} needles at their rehearsed positions, others as planned."
        )),
    }
}

/// Draws a value, in the warning colour if it violates its limit.
fn value_ui(ui: &mut egui::Ui, figures: Option<&Figures>, name: &str) {
    let measure = figures.and_then(|figures| figures.measures().find(|m| m.name == name));
    let Some(measure) = measure else {
        ui.label("");
        return;
    };
    let text = RichText::new(format!("{:.1}", measure.value)).monospace();
    match measure.beyond() > 0.0 {
        true => ui
            .label(text.color(theme::of(ui).warn))
            .on_hover_text(measure.to_string()),
        false => ui.label(text),
    };
}

/// Returns the reason why the plan cannot be updated.
fn missing(shown: &Shown) -> Option<String> {
    let planning = &shown.planning;
    let planes = planning.review.drawn.contour.outlines().len();
    if planning.implant.is_none() {
        return Some("a plan of many needles; make one first".to_owned());
    }
    if shown.seeds.is_empty() {
        return Some("a seed in the tissue".to_owned());
    }
    if planning.review.solid.is_none() {
        return Some(format!("an outline of the gland in {PLANES} planes; {planes} so far"));
    }
    (planning.review.seeds_from == SeedsFrom::Marks && planning.review.drawn.marks_m.is_empty())
        .then(|| "a mark of a seed, or the actual positions".to_owned())
}

fn update_ui(ui: &mut egui::Ui, shown: &Shown, missing: Option<String>, actions: &mut Vec<Action>) {
    if let Some(why) = &missing {
        ui.label(RichText::new(format!("Missing: {why}.")).color(theme::of(ui).warn));
    }
    let free = shown.is_live() && !shown.running && missing.is_none();
    ui.horizontal_wrapped(|ui| {
        let hint = "Needles that are not inserted yet, through free holes, given the dose of the placed seeds";
        let plan = Press("Replan the remaining needles", hint).ui(ui, free);
        actions.extend(plan.then_some(Action::Plan(PlanAction::Update)));
        let can_rehearse = shown.is_live() && !shown.running && shown.planning.next_needle().is_some();
        let hint = "Rehearses the remaining needles and shifts their drops so that seeds rest where they are planned";
        let compensate = Press("Compensate", hint).ui(ui, can_rehearse);
        actions.extend(compensate.then_some(Action::Plan(PlanAction::Compensate)));
        if shown.planning.review.can_withdraw {
            let withdraw = Press("Withdraw the update", "Restores the plan before the update").ui(ui, !shown.running);
            actions.extend(withdraw.then_some(Action::Plan(PlanAction::WithdrawUpdate)));
        }
    });
}

fn decision_ui(ui: &mut egui::Ui, proposed: &Reviewed, actions: &mut Vec<Action>) {
    let [[needles, seeds], [new_needles, new_seeds]] = proposed.left;
    ui.label(format!(
        "{} with {} remained; the update has {new_needles} with {new_seeds}.",
        counted(needles, "needle"),
        counted(seeds, "seed")
    ));
    let tokens = theme::of(ui);
    match proposed.update.improves() {
        true => ui.label(RichText::new("The update meets the limits better.").color(tokens.good)),
        false => ui.label(RichText::new("The update is no better than continuing the plan.").color(tokens.warn)),
    };
    ui.horizontal(|ui| {
        let pressed = Press("Accept", "The plan of the remaining needles").ui(ui, true);
        actions.extend(pressed.then_some(Action::Plan(PlanAction::Decide(true))));
        let pressed = Press("Keep the plan", "Continue as before").ui(ui, true);
        actions.extend(pressed.then_some(Action::Plan(PlanAction::Decide(false))));
    });
}
