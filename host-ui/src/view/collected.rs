//! Marks of the three-dimensional picture, of the plan and of moving parts.

use super::marks::{Marks, NEEDLE_LENGTH_M};
use super::scene3d::Look;
use super::state::ViewState;
use crate::shown::Shown;
use crate::theme::Tokens;
use nalgebra::Vector3;

/// Distance of the template before the entry.
const TEMPLATE_BEFORE_M: f32 = 0.01;
/// Drawn length of the second hand's tool.
const SECOND_LENGTH_M: f64 = 0.12;

/// Collects marks that change only with the scene and the plan. Returns the corner of the drawn
/// axes.
pub fn collect_fixed(marks: &mut Marks, shown: &Shown, look: Look, tokens: &'static Tokens) -> Option<[f32; 3]> {
    marks.begin(tokens);
    let corner = shown
        .scene
        .map(|scene| marks.grid_and_axes(scene.lower_m, scene.upper_m));
    let at_work = shown.planning.progress.begun().checked_sub(1);
    for (number, needle) in shown
        .planning
        .implant
        .iter()
        .flat_map(|i| i.plan.needles.iter().enumerate())
    {
        if Some(number) != at_work {
            marks.path_thin(needle.entry_m, needle.at_m(needle.depth_m));
            marks.planned_seeds_thin(needle.seeds_m(), needle.direction);
        }
    }
    let is_other = shown.planning.waits();
    if let Some(plan) = shown.plan.as_ref().filter(|_| !is_other) {
        marks.entry(plan.entry_m, plan.direction);
        if look.template {
            marks.template(plan.entry_m, plan.direction, TEMPLATE_BEFORE_M);
        }
        for seed in shown.planned() {
            marks.planned_seed(seed.position_m, plan.direction);
        }
        if let Some(end) = shown.path_end_m() {
            marks.path(plan.entry_m, end);
        }
    }
    corner
}

/// Returns places along the needle and the second hand's tool. Omits the hub, which trembles far
/// more than the part in tissue.
pub fn moving_points(shown: &Shown) -> Vec<[f64; 3]> {
    let mut points_m = shown.needle_points_m(NEEDLE_LENGTH_M).unwrap_or_default();
    points_m.pop();
    points_m.extend(shown.second_tool_m(SECOND_LENGTH_M).into_iter().flatten());
    points_m
}

pub fn collect_live(marks: &mut Marks, (shown, view): (&Shown, &ViewState), look: Look, tokens: &'static Tokens) {
    marks.begin(tokens);
    if let (Some(tip), Some(state)) = (shown.tip_m(), &shown.state) {
        if let Some(points_m) = shown.needle_points_m(NEEDLE_LENGTH_M) {
            marks.needle(&points_m);
        }
        if look.force {
            marks.force(tip, state.force_on_hand_n);
        }
    }
    if let Some([tip, end]) = shown.second_tool_m(SECOND_LENGTH_M) {
        marks.second_tool(tip, end);
    }
    for left in &shown.left {
        let hub_m = [0, 1, 2].map(|a| left.tip_m[a] - left.direction[a] * NEEDLE_LENGTH_M);
        marks.needle(&[left.tip_m, hub_m]);
    }
    for seed in &shown.seeds {
        marks.placed_seed(shown.drawn_at_m(seed), seed.axis);
    }
    let measured: Vec<Vector3<f32>> = view.measure.points_m().iter().map(|p| p.map(|c| c as f32)).collect();
    marks.measured(&measured);
}
