//! Proposals of the automatic plan, with their robustness against misplaced seeds and its cost.

use crate::action::{Action, PlanAction};
use crate::panel::axis::{marks, plot};
use crate::shown::Shown;
use crate::theme;
use egui::{Button, RichText};
use egui_plot::{HLine, MarkerShape, PlotPoints, Points, VLine};
use stylet_implant::plan::first::FirstPlan;

/// Height of the picture.
const HEIGHT: f32 = 72.0;
/// Limit of V150 of the target, percent.
const MOST_V150: f64 = 60.0;
/// Share of trials that should meet their D90, percent.
const TRIALS_KEPT: f64 = 95.0;
/// Smallest range of the picture.
const SHOWN_V150: [f64; 2] = [20.0, 64.0];
const SHOWN_KEPT: [f64; 2] = [40.0, 104.0];

/// Draws a button for each proposal, the picture, and the figures of the current plan.
pub fn proposals_ui(ui: &mut egui::Ui, shown: &Shown, free: bool, actions: &mut Vec<Action>) {
    let Some(proposals) = shown.planning.proposals.as_ref().filter(|all| all.len() > 1) else {
        return;
    };
    let plan = shown.planning.implant.as_ref().map(|implant| &implant.plan);
    let chosen = proposals.iter().position(|proposal| Some(&proposal.found.plan) == plan);
    ui.horizontal_wrapped(|ui| {
        for (number, proposal) in proposals.iter().enumerate() {
            let button = Button::new(proposal.name).selected(chosen == Some(number));
            let response = ui.add_enabled(free, button).on_hover_text(hint(proposal));
            if response.clicked() && chosen != Some(number) {
                actions.push(Action::Plan(PlanAction::Choose(number)));
            }
        }
    });
    picture_ui(ui, proposals, chosen);
    let text = match chosen.and_then(|number| proposals.get(number)) {
        Some(proposal) => words(proposal),
        None => "Edited since; a button restores a proposal.".to_owned(),
    };
    super::weak_line(ui, text);
}

/// Draws the share of trials that meet their D90 over V150: better is up and to the left.
fn picture_ui(ui: &mut egui::Ui, proposals: &[FirstPlan], chosen: Option<usize>) {
    let tokens = theme::of(ui);
    ui.horizontal(|ui| {
        ui.label(RichText::new("% of trials meeting D90").color(tokens.depth).size(11.5));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let limit = format!("limit {MOST_V150:.0}");
            ui.label(RichText::new(limit).color(tokens.bad).size(11.5));
            ui.label(RichText::new("over V150, %;").color(tokens.weak).size(11.5));
        });
    });
    plot("proposals", HEIGHT)
        .include_x(SHOWN_V150[0])
        .include_x(SHOWN_V150[1])
        .include_y(SHOWN_KEPT[0])
        .include_y(SHOWN_KEPT[1])
        .x_grid_spacer(|_| marks(30.0, 10.0, 3))
        .y_grid_spacer(|_| marks(50.0, 25.0, 2))
        .show(ui, |plot| {
            plot.hline(
                HLine::new("95 % of trials", TRIALS_KEPT)
                    .color(tokens.line)
                    .allow_hover(false),
            );
            plot.vline(
                VLine::new("limit of V150", MOST_V150)
                    .color(tokens.bad)
                    .allow_hover(false),
            );
            for (number, proposal) in proposals.iter().enumerate() {
                let m = &proposal.found;
                let place = PlotPoints::from(vec![[m.figures.v150, m.robust * 100.0]]);
                let is_chosen = chosen == Some(number);
                let points = Points::new(proposal.name, place)
                    .shape(if is_chosen {
                        MarkerShape::Circle
                    } else {
                        MarkerShape::Diamond
                    })
                    .radius(if is_chosen { 5.0 } else { 4.0 })
                    .filled(is_chosen)
                    .color(if is_chosen { tokens.accent } else { tokens.text });
                plot.points(points.allow_hover(false));
            }
        });
}

fn hint(proposal: &FirstPlan) -> String {
    format!("{}\n{}", proposal.why, words(proposal))
}

/// Returns a text such as "25 needles, V150 42 %, 96 % keep D90", a share of the trials.
fn words(proposal: &FirstPlan) -> String {
    let found = &proposal.found;
    format!(
        "{} needles, V150 {:.0} %, {:.0} % meet D90",
        found.plan.needles.len(),
        found.figures.v150,
        found.robust * 100.0
    )
}
