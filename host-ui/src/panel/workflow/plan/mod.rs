//! The plan: whole-plan actions in the step; its needles at the right, instead of the instruments.

mod card;
mod findings;
mod list;
mod needle;
mod proposals;
mod template;

use super::progress;
use crate::action::{Action, PlanAction, Viewpoint};
use crate::planner::Implant;
use crate::shown::Shown;
use crate::theme;
use crate::theme::Press;
use crate::words::counted;
pub(super) use card::plan_ui;
use egui::Button;
use std::path::PathBuf;
use stylet_implant::plan::{Hole, ImplantPlan};

/// Selection of the user in the plan.
pub struct PlanState {
    /// Path of a plan file.
    pub path: String,
    /// File that was saved for this scene, which *Save* replaces without a question.
    pub own_file: Option<PathBuf>,
    pub(super) hole: Hole,
    /// Selected needle, if it goes through no hole.
    by_hand: Option<usize>,
    /// Depth of the outlines, from the template's face; `None` until it is set.
    depth_m: Option<f64>,
    /// Needle to which the list was scrolled last.
    listed: Option<usize>,
}

impl Default for PlanState {
    fn default() -> Self {
        Self {
            path: String::new(),
            own_file: None,
            hole: Hole::middle(),
            by_hand: None,
            depth_m: None,
            listed: None,
        }
    }
}

impl PlanState {
    /// Forgets file, needle and depth of the scene before.
    pub fn forget_scene(&mut self) {
        *self = Self::default();
    }
}

impl PlanState {
    /// Returns the selected needle.
    fn needle(&self, plan: &ImplantPlan) -> Option<usize> {
        let by_hand = self
            .by_hand
            .filter(|&n| plan.needles.get(n).is_some_and(|needle| needle.hole.is_none()));
        by_hand.or_else(|| plan.needles.iter().position(|n| n.hole == Some(self.hole)))
    }

    fn look_at(&mut self, plan: &ImplantPlan, number: usize) {
        match plan.needles.get(number).and_then(|n| n.hole) {
            Some(hole) => (self.hole, self.by_hand) = (hole, None),
            None => self.by_hand = Some(number),
        }
    }

    fn look_at_hole(&mut self, hole: Hole) {
        (self.hole, self.by_hand) = (hole, None);
    }
}

/// Height below which the panel as a whole scrolls.
const LEAST_HEIGHT: f32 = 620.0;

/// Draws the right panel while a plan of many needles is edited.
pub fn editor_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut PlanState, height: f32) -> Vec<Action> {
    let mut actions = Vec::new();
    ui.set_max_height(height.max(LEAST_HEIGHT));
    let Some(implant) = &shown.planning.implant else {
        return actions;
    };
    head_ui(ui, implant, &mut actions);
    let free = shown.is_live() && !shown.running;
    ui.add_enabled_ui(free, |ui| {
        template::template_ui(ui, shown, implant, state, &mut actions);
        needle::needle_ui(ui, shown, implant, state, &mut actions);
    });
    // Available at any time, also while the script runs.
    ui.separator();
    list::list_ui(ui, implant, state);
    ui.separator();
    findings::findings_ui(ui, shown.dose.as_deref(), implant, state);
    actions
}

fn head_ui(ui: &mut egui::Ui, implant: &Implant, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.heading("Needles");
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let redo = Press("Redo", "Ctrl+Shift+Z").ui(ui, implant.can_redo);
            actions.extend(redo.then_some(Action::Redo));
            let undo = Press("Undo", "Ctrl+Z").ui(ui, implant.can_undo);
            actions.extend(undo.then_some(Action::Undo));
            let pressed = Press(
                "Perineum view",
                "Turns the 3D view to look through the template, like this panel",
            )
            .ui(ui, true);
            actions.extend(pressed.then_some(Action::LookFrom(Viewpoint::Perineum)));
        });
    });
}

/// Returns a text such as "24 needles, 98 seeds of 0.43 U".
fn summary(implant: &Implant) -> String {
    let plan = &implant.plan;
    let strengths = || implant.seeds.iter().map(|s| s.strength_u);
    let (least, most) = (
        strengths().fold(f64::INFINITY, f64::min),
        strengths().fold(0.0, f64::max),
    );
    let strength = match implant.seeds.len() {
        0 => String::new(),
        _ if most - least < 5e-4 => format!(" of {most:.3} U"),
        _ => format!(" of {least:.3} to {most:.3} U"),
    };
    let needles = counted(plan.needles.len(), "needle");
    format!("{needles}, {} seeds{strength}", implant.seeds.len())
}

/// Returns the hole, such as "E5", or the number of a needle held by hand.
fn name_of(plan: &ImplantPlan, number: usize) -> String {
    let hole = plan.needles.get(number).and_then(|n| n.hole);
    hole.map_or_else(|| format!("needle {}", number + 1), |h| h.to_string())
}

/// Returns the position in the procedure, such as "Needle 3 of 24, through E5".
pub(super) fn at_work(shown: &Shown) -> Option<String> {
    let implant = shown.planning.implant.as_ref()?;
    let number = progress::next_needle(shown).or_else(|| Some(shown.planning.at_work()?.0))?;
    let count = implant.plan.needles.len();
    let name = name_of(&implant.plan, number);
    Some(format!("Needle {} of {count}, {name}.", number + 1))
}

/// Draws the button for the next needle, if a person may leave the present one.
pub(super) fn next_needle_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    if shown.planning.next_needle().is_none() || shown.planning.waits() {
        return;
    }
    let can = progress::can_leave_needle(shown) && shown.is_live() && !shown.running;
    let response = ui.add_enabled(can, Button::new("Next needle"));
    let response = response.on_disabled_hover_text("Take this needle out first");
    if response
        .on_hover_text("Enter, once all seeds of this one are dropped")
        .clicked()
    {
        actions.push(Action::Plan(PlanAction::NextNeedle));
    }
}

fn weak_line(ui: &mut egui::Ui, text: impl Into<String>) -> egui::Response {
    ui.add(egui::Label::new(theme::small(text)).truncate())
}
