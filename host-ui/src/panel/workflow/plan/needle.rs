//! The needle of the chosen hole: its seeds, and its path.

use super::template::move_needle;
use super::{PlanState, name_of};
use crate::action::{Action, PlanAction};
use crate::planner::{Implant, NeedleState};
use crate::shown::Shown;
use crate::theme;
use crate::theme::Press;
use crate::words::Explained;
use egui::{Button, DragValue};
use stylet_base::format;
use stylet_implant::plan::check::{DEEPEST_SEED_M, STRENGTHS_U};
use stylet_implant::plan::{Row, SEED_LENGTH_M};

const MOST_SEEDS: usize = 15;
const LONGEST_PITCH_M: f64 = 0.05;

pub fn needle_ui(
    ui: &mut egui::Ui,
    shown: &Shown,
    implant: &Implant,
    state: &mut PlanState,
    actions: &mut Vec<Action>,
) {
    match state.needle(&implant.plan) {
        None => empty_ui(ui, shown, state, actions),
        Some(number) => {
            let can = implant.states[number] == NeedleState::Planned;
            head_ui(ui, implant, number, can, actions);
            ui.add_enabled_ui(can, |ui| {
                row_ui(ui, implant, number, actions);
                move_ui(ui, implant, number, state, actions);
            });
        }
    }
}

fn empty_ui(ui: &mut egui::Ui, shown: &Shown, state: &PlanState, actions: &mut Vec<Action>) {
    let outlines = shown.planning.outlines.as_ref();
    let piece_m = outlines.map(|g| g.piece_m(state.hole));
    ui.horizontal(|ui| {
        ui.label(theme::strong(format!("Hole {}", state.hole)))
            .explained("hole")
            .explained("template");
        let add = ui.add_enabled(matches!(piece_m, Some(Ok(_))), Button::new("Add needle"));
        if add.on_hover_text("Enter in the template").clicked() {
            actions.push(Action::Plan(PlanAction::Add(state.hole)));
        }
    });
    let text = match piece_m {
        None => "The outlines of the scene are being computed.".to_owned(),
        Some(Ok([from, to])) => format!(
            "The target lies {:.0} to {:.0} mm deep here.",
            format::mm(from),
            format::mm(to)
        ),
        Some(Err(why)) => format!("A needle through this hole {why}."),
    };
    ui.label(theme::small(text));
    // As high as with a needle, so that the list does not jump.
    ui.add_space(2.0 * 24.0 + 2.0 * theme::GAP - 15.0);
}

fn head_ui(ui: &mut egui::Ui, implant: &Implant, number: usize, can: bool, actions: &mut Vec<Action>) {
    let name = name_of(&implant.plan, number);
    ui.horizontal(|ui| {
        ui.label(theme::strong(format!("Needle {}, {name}", number + 1)));
        if let Some(error_m) = implant.rest_errors_m[number] {
            ui.label(theme::small(format!("rest error {:.2} mm", format::mm(error_m))));
        }
        if !implant.sensitive[number].is_empty() {
            let each = implant.sensitive[number].iter().map(|found| format!("{found}."));
            let words = each.collect::<Vec<_>>().join("\n");
            ui.label(theme::small("sensitive"))
                .on_hover_text(words)
                .explained("sensitive");
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let remove = Press("Remove", "Delete in the template").ui(ui, can);
            actions.extend(remove.then_some(Action::Plan(PlanAction::Remove(number))));
        });
    });
}

fn row_ui(ui: &mut egui::Ui, implant: &Implant, number: usize, actions: &mut Vec<Action>) {
    let needle = &implant.plan.needles[number];
    let Some(was) = Row::of(needle) else {
        ui.label(theme::small("It has no seeds; remove it and add it again."));
        return;
    };
    let mut row = was;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        labelled(
            ui,
            "Seeds",
            DragValue::new(&mut row.count).range(1..=MOST_SEEDS).speed(0.05),
        );
        let mut pitch_mm = format::mm(row.pitch_m);
        let [least, most] = [SEED_LENGTH_M, LONGEST_PITCH_M].map(format::mm);
        labelled(ui, "every", millimetres(&mut pitch_mm, least..=most));
        if (pitch_mm - format::mm(was.pitch_m)).abs() > 0.04 {
            row.pitch_m = format::metres(pitch_mm);
        }
        ui.checkbox(&mut row.stranded, "Strand")
            .on_hover_text("In one strand with spacers between the seeds, or loose")
            .explained("strand")
            .explained("spacer");
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let mut deepest_mm = format::mm(row.deepest_m);
        labelled(
            ui,
            "Depth",
            millimetres(&mut deepest_mm, 0.0..=format::mm(DEEPEST_SEED_M)),
        );
        if (deepest_mm - format::mm(was.deepest_m)).abs() > 0.04 {
            row.deepest_m = format::metres(deepest_mm);
        }
        let strength = DragValue::new(&mut row.strength_u)
            .range(STRENGTHS_U[0]..=STRENGTHS_U[1])
            .speed(0.005)
            .fixed_decimals(3)
            .suffix(" U");
        labelled(ui, "of", strength);
    });
    if row != was {
        actions.push(Action::Plan(PlanAction::SetRow(number, row)));
    }
}

fn millimetres(value: &mut f64, range: std::ops::RangeInclusive<f64>) -> DragValue<'_> {
    DragValue::new(value)
        .range(range)
        .speed(0.1)
        .fixed_decimals(1)
        .suffix(" mm")
}

fn labelled(ui: &mut egui::Ui, name: &str, value: DragValue<'_>) {
    let label = ui.label(theme::small(name));
    // A value from a file is kept until the operator changes it.
    let value = value.clamp_existing_to_range(false).update_while_editing(false);
    ui.add(value).labelled_by(label.id);
}

fn move_ui(ui: &mut egui::Ui, implant: &Implant, number: usize, state: &mut PlanState, actions: &mut Vec<Action>) {
    let Some(hole) = implant.plan.needles[number].hole else {
        ui.label(theme::small("Held by hand: it goes through no hole."));
        return;
    };
    ui.horizontal(|ui| {
        ui.label(theme::small("Move to"));
        let ways = [
            ("right", [-1, 0]),
            ("left", [1, 0]),
            ("anterior", [0, 1]),
            ("posterior", [0, -1]),
        ];
        ui.spacing_mut().item_spacing.x = 4.0;
        for (name, by) in ways {
            let to = hole.offset_by(by);
            let is_free = to.is_some_and(|to| implant.plan.needles.iter().all(|n| n.hole != Some(to)));
            let button = ui.add_enabled(is_free, Button::new(name));
            let hint = "One hole, by the sides of the patient; Shift and an arrow in the template";
            if button.on_hover_text(hint).clicked()
                && let Some(to) = to
            {
                move_needle(implant, number, to, state, actions);
            }
        }
    });
}
