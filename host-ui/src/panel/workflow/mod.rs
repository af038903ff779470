//! The left panel: the steps of the procedure, one of them open, with its main action and its
//! preconditions.

mod debrief;
mod guide;
pub(super) mod job;
mod left;
mod plan;
mod progress;
mod run;
pub(super) mod scene;

use crate::action::Action;
use crate::recent::Recent;
use crate::shown::{Note, SeedError, Shown, own_errors};
use crate::theme;
use crate::theme::Press;
use crate::words::{counted, sentence};
use egui::text::LayoutJob;
use egui::{Align2, Button, FontId, RichText, Sense, Stroke, TextStyle, Vec2};
pub use guide::Guide;
#[cfg(test)]
pub use guide::{MetMembranes, lesson};
pub use plan::{PlanState, editor_ui};
pub use progress::{Progress, Undo, is_at_next_seed, is_needle_done, missing, next_action, progress, undo_action};
pub use run::{SCRIPTED_STEPS, run_ui};
use stylet_base::format;
use stylet_shm_schema::Request;

/// State that the panel keeps between frames: text being typed, and the step opened by hand.
#[derive(Default)]
pub struct WorkflowState {
    pub scene_path: String,
    pub plan: PlanState,
    /// Recent files from the settings.
    pub recent: Vec<Recent>,
    /// Guide through the first insertion.
    pub guide: Guide,
    opened: Option<Progress>,
    was: Option<Progress>,
}

impl WorkflowState {
    /// Creates a state that offers the file loaded last.
    pub fn with_file(path: &str) -> Self {
        Self {
            scene_path: path.to_owned(),
            ..Self::default()
        }
    }

    /// Returns whether the step was open in the last frame.
    pub fn is_open(&self, step: Progress) -> bool {
        self.opened.or(self.was) == Some(step)
    }

    /// Opens a step that is not the present one.
    pub fn open_by_hand(&mut self, step: Progress) {
        self.opened = Some(step);
    }

    /// Opens the present step again.
    pub fn open_present(&mut self) {
        self.opened = None;
    }

    /// Returns the open step: the present one, unless another was opened by hand since the
    /// procedure advanced.
    fn open(&mut self, now: Progress) -> Progress {
        if self.was != Some(now) {
            (self.was, self.opened) = (Some(now), None);
        }
        self.opened.unwrap_or(now)
    }
}

pub fn workflow_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut WorkflowState) -> Vec<Action> {
    let mut actions = Vec::new();
    let now = progress(shown);
    let open = state.open(now);
    guide::guide_ui(ui, shown, &mut state.guide);
    for step in Progress::ALL {
        if step == open {
            step_ui(ui, (step, now), shown, state, &mut actions);
        } else if head_ui(ui, (step, now), shown).clicked() {
            state.open_by_hand(step);
        }
    }
    actions
}

/// Lines of the last answer, and of its buttons.
const NOTE_LINES: [usize; 2] = [1, 3];
const SHORT: f32 = 420.0;

fn note_lines(ui: &egui::Ui) -> usize {
    NOTE_LINES[usize::from(ui.ctx().content_rect().height() >= SHORT)]
}

/// Returns the height of [`foot_ui`], independent of its content.
pub fn foot_height(ui: &egui::Ui) -> f32 {
    let line = ui.text_style_height(&TextStyle::Small) + 1.0;
    ui.spacing().interact_size.y + 2.0 * theme::GAP + note_lines(ui) as f32 * line
}

/// Draws the force, and the last answer for the operator, under the steps.
pub fn foot_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    ui.add_space(theme::GAP);
    force_ui(ui, shown, actions);
    let kept = (shown.removed > 0).then(|| {
        let seeds = counted(shown.removed, "seed");
        Note::done(format!("Ctrl+Z restores the {seeds} that the reset removed."))
    });
    let Some(note) = shown.note.as_ref().or(kept.as_ref()) else {
        return;
    };
    let tokens = theme::of(ui);
    let color = if note.refused { tokens.bad } else { tokens.weak };
    let font = TextStyle::Small.resolve(ui.style());
    let mut job = LayoutJob::simple(note.text.clone(), font, color, ui.available_width());
    (job.wrap.max_rows, job.wrap.break_anywhere) = (note_lines(ui), false);
    // A label cut off with three dots shows the whole text on hover.
    ui.add(egui::Label::new(job).wrap());
}

fn hinted(response: egui::Response, blocked: Option<String>) -> egui::Response {
    match blocked {
        Some(why) => response.on_disabled_hover_text(why),
        None => response,
    }
}

/// Draws one line: the step's number in a dot that shows its progress, its name, and the progress
/// in a word.
fn head_ui(ui: &mut egui::Ui, (step, now): (Progress, Progress), shown: &Shown) -> egui::Response {
    let tokens = theme::of(ui);
    let size = Vec2::new(ui.available_width(), 24.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let name = format!("{}  {}", step.number(), step.name());
    theme::named(&response, egui::accesskit::Role::Button, || &name);
    if response.hovered() || response.has_focus() {
        ui.painter().rect_filled(rect, 4.0, tokens.widget);
    }
    let live = shown.is_live();
    let (word, color, filled) = if live && now > step {
        ("done", tokens.good, true)
    } else if live && now == step {
        ("now", tokens.accent, true)
    } else {
        ("", tokens.weak, false)
    };
    let dot = rect.left_center() + Vec2::new(12.0, 0.0);
    if filled {
        ui.painter().circle_filled(dot, 9.0, color);
    } else {
        ui.painter().circle_stroke(dot, 8.5, Stroke::new(1.0, color));
    }
    let ink = if filled { tokens.on_signal } else { tokens.weak };
    let number = step.number().to_string();
    let text = |at, anchor, text: &str, size, color| {
        ui.painter().text(at, anchor, text, FontId::proportional(size), color);
    };
    text(dot, Align2::CENTER_CENTER, &number, 12.0, ink);
    let color_of_name = if live && now == step { tokens.text } else { tokens.weak };
    text(
        dot + Vec2::new(18.0, 0.0),
        Align2::LEFT_CENTER,
        step.name(),
        13.5,
        color_of_name,
    );
    let end = rect.right_center() - Vec2::new(4.0, 0.0);
    text(end, Align2::RIGHT_CENTER, word, 11.5, color);
    response
}

/// Draws the open step.
fn step_ui(
    ui: &mut egui::Ui,
    (step, now): (Progress, Progress),
    shown: &Shown,
    state: &mut WorkflowState,
    actions: &mut Vec<Action>,
) {
    let tokens = theme::of(ui);
    let current = step == now && shown.is_live();
    let color = if current { tokens.accent } else { tokens.line };
    theme::card(ui).stroke(Stroke::new(1.0, color)).show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        head_ui(ui, (step, now), shown);
        let blocked = missing(shown, step);
        match &blocked {
            Some(why) => drop(ui.label(RichText::new(sentence(why)).color(tokens.warn))),
            // Details follow below.
            None if step == Progress::Plan && shown.planning.implant.is_some() => {}
            None if step == Progress::Debrief => {}
            None => drop(ui.label(theme::weak(what(step, shown)))),
        }
        let ready = blocked.is_none() && !shown.running;
        match step {
            Progress::Scene => scene::scene_ui(ui, shown, state, actions),
            Progress::Plan => plan::plan_ui(ui, shown, state, ready, actions),
            Progress::Place => place_ui(ui, shown, ready, actions),
            Progress::Insert => insert_ui(ui, shown, ready, actions),
            Progress::Drop => drop_ui(ui, shown, ready, actions),
            Progress::Retract => retract_ui(ui, shown, actions),
            Progress::Debrief => debrief::debrief_ui(ui, shown, actions),
        }
        // Steps with a needle in have these rows next to its buttons.
        if matches!(step, Progress::Plan | Progress::Place | Progress::Debrief) {
            left::left_ui(ui, shown, actions);
        }
    });
}

fn what(step: Progress, shown: &Shown) -> String {
    match step {
        Progress::Scene => "A built-in scene, or a segmented volume of your own.".to_owned(),
        Progress::Plan => "Five seeds along one needle through the gland.".to_owned(),
        Progress::Place => {
            let which = plan::at_work(shown).map_or_else(String::new, |text| text + " ");
            format!("{which}Bring the tip to the entry of the path.")
        }
        Progress::Insert => {
            "Push to the deepest planned seed: the button, W and S, or drag the tip in a slice.".to_owned()
        }
        Progress::Drop => {
            let (dropped, planned) = (shown.own_seeds().len(), shown.planned().len());
            format!("{dropped} of {planned} seeds dropped. Drop one at each place while retracting.")
        }
        Progress::Retract => "All seeds are dropped. Take the needle out.".to_owned(),
        Progress::Debrief => String::new(),
    }
}

/// Draws the button of a step's main action.
fn main_button(ui: &mut egui::Ui, (name, action): (&str, Action), ready: bool, actions: &mut Vec<Action>) {
    let pressed = Press(name, "Enter, while this step is next").ui(ui, ready);
    actions.extend(pressed.then_some(action));
}

fn place_ui(ui: &mut egui::Ui, shown: &Shown, ready: bool, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        if !is_needle_done(shown) {
            main_button(ui, ("Place needle", Action::PlaceNeedle), ready, actions);
        }
        plan::next_needle_ui(ui, shown, actions);
    });
}

fn insert_ui(ui: &mut egui::Ui, shown: &Shown, ready: bool, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        main_button(ui, ("Insert", Action::Insert), ready, actions);
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
        // The slider rounds its value and reports a change; only the user may move the needle.
        let by_hand = response.dragged() || response.has_focus();
        if by_hand && (goal_mm - at_mm).abs() > 0.06 {
            actions.push(Action::MoveTo(format::metres(goal_mm)));
        }
    });
    retract_ui(ui, shown, actions);
}

fn drop_ui(ui: &mut egui::Ui, shown: &Shown, ready: bool, actions: &mut Vec<Action>) {
    let live = shown.is_live() && !shown.running;
    ui.horizontal(|ui| {
        let pressed = Press("Drop seed", "Space").ui(ui, ready);
        actions.extend(pressed.then_some(Action::DropSeed));
        let next = shown.next_seed_m().filter(|_| !is_at_next_seed(shown));
        let to_next = ui.add_enabled(live && next.is_some(), Button::new("To the next place"));
        if let (true, Some(depth_m)) = (to_next.clicked(), next) {
            actions.push(Action::MoveTo(depth_m));
        }
    });
    retract_ui(ui, shown, actions);
    plan::next_needle_ui(ui, shown, actions);
    debrief::seeds_ui(ui, shown, &own_rows(shown));
}

/// Returns the seeds of the present needle.
fn own_rows(shown: &Shown) -> Vec<(usize, SeedError)> {
    let needle = shown.planning.at_work().map_or(0, |(number, _)| number);
    own_errors(shown).into_iter().map(|row| (needle, row)).collect()
}

fn retract_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    let live = shown.is_live() && !shown.running;
    ui.horizontal(|ui| {
        if ui
            .add_enabled(live && shown.plan.is_some(), Button::new("Retract"))
            .clicked()
        {
            actions.push(Action::Retract);
        }
        let undo = Press("Undo seed", "Ctrl+Z").ui(ui, live && !shown.seeds.is_empty());
        actions.extend(undo.then_some(Action::Send(Request::UndoSeed)));
        left::leave_ui(ui, shown, actions);
    });
    left::left_ui(ui, shown, actions);
}

fn force_ui(ui: &mut egui::Ui, shown: &Shown, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        let live = shown.is_live() && shown.watched.is_none();
        let engaged = shown.is_engaged();
        let pressed = Press("Engage force", "Key E").ui(ui, live && !engaged);
        actions.extend(pressed.then_some(Action::Send(Request::Engage)));
        let pressed = Press("Disengage", "Key D").ui(ui, live && engaged);
        actions.extend(pressed.then_some(Action::Send(Request::Disengage)));
        let reset = Press(
            "Reset",
            "Returns the tissue to rest, removes the seeds, and clears peaks and worst cases; Ctrl+Z restores the seeds",
        )
        .ui(ui, live);
        actions.extend(reset.then_some(Action::Send(Request::Reset)));
    });
}

#[cfg(test)]
mod tests;
