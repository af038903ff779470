//! The left panel: the four steps, what each lacks, and the seeds when all is done.

use super::{Action, LoadState, SeedError, Shown, seed_errors};
use crate::workflow::Step;
use crate::{format, theme};
use egui::{Button, RichText};
use std::path::PathBuf;
use stylet_shm_schema::{BUILTIN_SCENES, CommandKind, SceneHeader, role};

/// Beside the path by less than this, the needle counts as placed.
const PLACED_WITHIN_M: f64 = 1.5e-3;
/// The tip is at a goal when it is this near.
const REACHED_WITHIN_M: f64 = 1.0e-3;

/// What the panel keeps between frames: what a person is typing.
#[derive(Default)]
pub struct WorkflowState {
    pub scene_path: String,
}

/// How far the operator is, from what the core says alone, so that it survives a restart of this program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Progress {
    Plan,
    Place,
    Insert,
    Drop,
    Done,
}

pub fn progress(shown: &Shown) -> Progress {
    let (Some(depth), Some(beside)) = (shown.path_depth_m(), shown.off_path_m()) else {
        return Progress::Plan;
    };
    let planned = shown.planned().len();
    let dropped = shown.seeds.len();
    if dropped >= planned && depth < REACHED_WITHIN_M + 0.002 {
        Progress::Done
    } else if dropped > 0 {
        Progress::Drop
    } else if beside > PLACED_WITHIN_M || depth < -REACHED_WITHIN_M * 5.0 {
        Progress::Place
    } else if shown
        .deepest_seed_m()
        .is_some_and(|deepest| depth < deepest - REACHED_WITHIN_M)
    {
        Progress::Insert
    } else {
        Progress::Drop
    }
}

/// What is missing before `step` can be done; `None` when nothing is.
pub fn missing(shown: &Shown, step: Progress) -> Option<String> {
    if !shown.is_live() {
        return Some("rt-core must run".to_owned());
    }
    if shown.scene.is_none() {
        return Some("the scene has not arrived yet".to_owned());
    }
    if step == Progress::Plan {
        return None;
    }
    if shown.plan.is_none() {
        return Some("plan the seeds first".to_owned());
    }
    match (step, shown.off_path_m()) {
        (Progress::Insert, Some(beside)) if beside > PLACED_WITHIN_M => Some(format!(
            "place the needle first: it is {} beside the path",
            format::length(beside)
        )),
        (Progress::Drop, _) if !shown.has_punctured() && shown.seeds.is_empty() => {
            Some("insert the needle first: the tip is not in the tissue".to_owned())
        }
        _ => None,
    }
}

pub fn workflow_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState) -> Vec<Action> {
    let mut actions = Vec::new();
    let now = progress(shown);
    ui.heading("Procedure");
    run_ui(ui, shown, &mut actions);
    plan_ui(ui, shown, now, &mut actions);
    place_ui(ui, shown, now, &mut actions);
    insert_ui(ui, shown, now, &mut actions);
    drop_ui(ui, shown, now, &mut actions);
    if let Some(note) = &shown.note {
        let color = if note.refused { theme::BAD } else { theme::WEAK };
        ui.label(RichText::new(&note.text).color(color));
    }
    seeds_ui(ui, shown);
    force_ui(ui, shown, &mut actions);
    scene_ui(ui, shown, state, &mut actions);
    actions
}

fn run_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let wide = egui::vec2(ui.available_width(), 28.0);
    if shown.running {
        let step = match shown.run_step {
            Some(Step::Plan) => "planning",
            Some(Step::PlaceNeedle) => "placing the needle",
            Some(Step::Insert) => "inserting",
            Some(Step::DropAndRetract) => "dropping and retracting",
            Some(Step::Done) | None => "finishing",
        };
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label(format!("Running: {step}"));
            if ui.button("Stop").clicked() {
                actions.push(Action::StopRun);
            }
        });
        return;
    }
    let blocked = missing(shown, Progress::Plan);
    let response = ui.add_enabled(blocked.is_none(), Button::new("Run all four steps").min_size(wide));
    if hinted(response, blocked).clicked() {
        actions.push(Action::RunAll);
    }
}

fn hinted(response: egui::Response, blocked: Option<String>) -> egui::Response {
    match blocked {
        Some(why) => response.on_disabled_hover_text(why),
        None => response,
    }
}

/// Head of a step: its number, its name, and whether it is done or next.
fn step_ui(
    ui: &mut egui::Ui,
    (step, name, what): (Progress, &str, &str),
    (shown, now): (&Shown, Progress),
    body: impl FnOnce(&mut egui::Ui, bool),
) {
    let current = step == now && shown.is_live();
    let mut frame = theme::card();
    if current {
        frame = frame.stroke(egui::Stroke::new(1.0, theme::ACCENT));
    }
    frame.show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        ui.horizontal(|ui| {
            ui.label(theme::strong(name));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if now > step && shown.is_live() {
                    ui.label(RichText::new("done").color(theme::GOOD).small());
                } else if current {
                    ui.label(RichText::new("now").color(theme::ACCENT).small());
                }
            });
        });
        let blocked = missing(shown, step);
        match &blocked {
            Some(why) => ui.label(RichText::new(format!("Missing: {why}.")).color(theme::WARN).small()),
            None => ui.label(theme::small(what)),
        };
        body(ui, blocked.is_none() && !shown.running);
    });
}

fn plan_ui(ui: &mut egui::Ui, shown: &Shown, now: Progress, actions: &mut Vec<Action>) {
    let what = "Five seeds along one needle through the gland.";
    step_ui(ui, (Progress::Plan, "1  Plan", what), (shown, now), |ui, ready| {
        if ui.add_enabled(ready, Button::new("Plan five seeds")).clicked() {
            actions.push(Action::PlanSeeds);
        }
    });
}

fn place_ui(ui: &mut egui::Ui, shown: &Shown, now: Progress, actions: &mut Vec<Action>) {
    let what = "Bring the tip to the entry, along the path.";
    step_ui(
        ui,
        (Progress::Place, "2  Place the needle", what),
        (shown, now),
        |ui, ready| {
            if ui.add_enabled(ready, Button::new("Place needle")).clicked() {
                actions.push(Action::PlaceNeedle);
            }
        },
    );
}

fn insert_ui(ui: &mut egui::Ui, shown: &Shown, now: Progress, actions: &mut Vec<Action>) {
    let what = "To the deepest planned seed; or hold W and S.";
    step_ui(ui, (Progress::Insert, "3  Insert", what), (shown, now), |ui, ready| {
        ui.horizontal(|ui| {
            if ui.add_enabled(ready, Button::new("Insert")).clicked() {
                actions.push(Action::Insert);
            }
            let depth_mm = format::mm(shown.path_depth_m().unwrap_or(0.0));
            let length_mm = format::mm(shown.path_length_m().unwrap_or(0.01));
            let at_mm = depth_mm.clamp(0.0, length_mm);
            let mut goal_mm = at_mm;
            let label = ui.label(theme::small("Depth"));
            ui.spacing_mut().slider_width = 76.0;
            let slider = egui::Slider::new(&mut goal_mm, 0.0..=length_mm)
                .suffix(" mm")
                .fixed_decimals(1);
            let response = ui.add_enabled(ready, slider).labelled_by(label.id);
            // The slider rounds what it is given and calls that a change; only a hand on it may move the needle.
            let by_hand = response.dragged() || response.has_focus();
            if by_hand && (goal_mm - at_mm).abs() > 0.06 {
                actions.push(Action::MoveTo(format::metres(goal_mm)));
            }
        });
    });
}

fn drop_ui(ui: &mut egui::Ui, shown: &Shown, now: Progress, actions: &mut Vec<Action>) {
    let (dropped, planned) = (shown.seeds.len(), shown.planned().len());
    let what = format!("{dropped} of {planned} seeds dropped. Drop one at each place on the way out.");
    let step = (Progress::Drop, "4  Drop and retract", what.as_str());
    step_ui(ui, step, (shown, now), |ui, ready| {
        let live = shown.is_live() && !shown.running;
        ui.horizontal(|ui| {
            if ui
                .add_enabled(ready, Button::new("Drop seed"))
                .on_hover_text("Space")
                .clicked()
            {
                actions.push(Action::Send(CommandKind::DropSeed));
            }
            if ui
                .add_enabled(live && shown.plan.is_some(), Button::new("Retract"))
                .clicked()
            {
                actions.push(Action::Retract);
            }
            let undo = ui.add_enabled(live && dropped > 0, Button::new("Undo seed"));
            if undo.on_hover_text("Ctrl+Z").clicked() {
                actions.push(Action::Send(CommandKind::UndoSeed));
            }
        });
    });
}

fn force_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        let live = shown.is_live();
        let engaged = shown.is_engaged();
        if ui
            .add_enabled(live && !engaged, Button::new("Engage force"))
            .on_hover_text("Key E")
            .clicked()
        {
            actions.push(Action::Send(CommandKind::Engage));
        }
        if ui
            .add_enabled(live && engaged, Button::new("Disengage"))
            .on_hover_text("Key D")
            .clicked()
        {
            actions.push(Action::Send(CommandKind::Disengage));
        }
        let reset = ui.add_enabled(live, Button::new("Reset"));
        if reset
            .on_hover_text("Tissue to rest, seeds removed, peaks and worst cases forgotten")
            .clicked()
        {
            actions.push(Action::Send(CommandKind::Reset));
        }
    });
}

/// Nothing until the first seed is placed: an empty table tells nothing.
fn seeds_ui(ui: &mut egui::Ui, shown: &Shown) {
    let Some(plan) = &shown.plan else { return };
    if shown.seeds.is_empty() {
        return;
    }
    let rows = seed_errors(shown.planned(), &shown.seeds, plan.direction);
    theme::card().show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        ui.label(theme::strong("Seed error, mm"))
            .on_hover_text("Where the seed lies now against where it was planned; along is positive inwards");
        egui::Grid::new("seed errors")
            .num_columns(4)
            .striped(true)
            .min_col_width(52.0)
            .spacing([8.0, 2.0])
            .show(ui, |ui| {
                for head in ["seed", "along", "across", "total"] {
                    ui.label(theme::small(head));
                }
                ui.end_row();
                rows.iter().take(20).for_each(|row| seed_row_ui(ui, row));
            });
        let placed: Vec<f64> = rows.iter().filter(|r| r.placed.is_some()).map(total_m).collect();
        let mean = placed.iter().sum::<f64>() / placed.len().max(1) as f64;
        let worst = placed.iter().copied().fold(0.0, f64::max);
        let text = format!("mean {:.2}, worst {:.2}", format::mm(mean), format::mm(worst));
        ui.label(theme::small(text));
    });
}

fn total_m(row: &SeedError) -> f64 {
    row.along_m.hypot(row.across_m)
}

fn seed_row_ui(ui: &mut egui::Ui, row: &SeedError) {
    ui.label(format!("{}", row.planned + 1));
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

fn scene_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState, actions: &mut Vec<Action>) {
    ui.separator();
    let name = match &shown.scene {
        None => "Scene".to_owned(),
        Some(s) => format!(
            "Scene: {}, {}, {} elements",
            s.name.read(),
            format::volume(s.volume_m3),
            format::count(u64::from(s.element_count))
        ),
    };
    let label = ui.add(egui::Label::new(theme::small(name)).truncate());
    let free = shown.is_live() && !shown.load.is_busy() && !shown.running;
    ui.horizontal(|ui| {
        let edit = egui::TextEdit::singleline(&mut state.scene_path)
            .hint_text("segmentation.nii.gz, or drop a file")
            .desired_width(ui.available_width() - 106.0);
        let field = ui.add(edit).labelled_by(label.id);
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        let path = state.scene_path.trim();
        let clicked = ui
            .add_enabled(free && !path.is_empty(), Button::new("Load scene…"))
            .clicked();
        if (clicked || entered) && free && !path.is_empty() {
            actions.push(Action::LoadScene(PathBuf::from(path)));
        }
    });
    match &shown.load {
        LoadState::Idle => {}
        LoadState::Reading(what) | LoadState::Sending(what) => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(theme::small(what));
            });
        }
        LoadState::Loaded(what) => {
            ui.label(RichText::new(what).small().color(theme::GOOD));
        }
        LoadState::Refused(why) => {
            ui.label(RichText::new(why).small().color(theme::BAD));
        }
    }
    ui.horizontal(|ui| {
        ui.label(theme::small("Built in"));
        for (number, name) in BUILTIN_SCENES.into_iter().enumerate() {
            if ui.add_enabled(free, Button::new(name)).clicked() {
                actions.push(Action::LoadBuiltinScene(number));
            }
        }
    });
    if let Some(scene) = shown.scene.as_ref().filter(|s| s.structures().len() > 1) {
        structures_ui(ui, scene);
    }
}

fn structures_ui(ui: &mut egui::Ui, scene: &SceneHeader) {
    let title = format!("{} structures", scene.structures().len());
    egui::CollapsingHeader::new(theme::small(title)).show(ui, |ui| {
        let grid = egui::Grid::new("structures").num_columns(3).striped(true);
        grid.spacing([10.0, 2.0]).show(ui, |ui| {
            for structure in scene.structures() {
                ui.label(theme::small(structure.name.read()));
                let volume_m3 = f64::from(structure.element_count) * scene.spacing_m.powi(3);
                ui.label(theme::small(format::volume(volume_m3)));
                ui.label(theme::small(role_name(structure.role)));
                ui.end_row();
            }
        });
    });
}

fn role_name(bits: u32) -> &'static str {
    match bits {
        b if b & role::TARGET != 0 => "target",
        b if b & role::FIXED != 0 => "fixed",
        b if b & role::SPARE != 0 => "spared",
        _ => "",
    }
}
