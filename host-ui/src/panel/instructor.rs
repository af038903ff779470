//! The instructor's dialog: marks, and faults injected as exercises.

use crate::action::Action;
use crate::shown::Shown;
use crate::theme;
use egui::{DragValue, RichText};
use stylet_base::format;
use stylet_host::moments::Moments;
use stylet_shm_schema::{
    EXERCISE_STIFFNESS_RANGE, Exercise, MARK_BEFORE_RANGE_S, MARK_BYTES, MOST_MOVED_M, Mark, Request, Text,
};
use web_time::Instant;

/// Number of moments in the list.
const LISTED: usize = 5;
const WIDTH: f32 = 420.0;
const TITLE_AND_EDGES: f32 = 70.0;

pub struct InstructorState {
    open: bool,
    /// True in the frame in which the dialog opens: the text field takes the focus.
    is_new: bool,
    words: String,
    /// Time at which the text was begun; the mark gets this time.
    since: Option<Instant>,
    factor: f64,
    moved_mm: [f64; 3],
}

impl Default for InstructorState {
    fn default() -> Self {
        Self {
            open: false,
            is_new: false,
            words: String::new(),
            since: None,
            factor: 2.0,
            moved_mm: [3.0, 0.0, 0.0],
        }
    }
}

impl InstructorState {
    /// Opens or closes the dialog; opening sets the time of a mark.
    pub fn toggle(&mut self) {
        self.open = !self.open;
        (self.is_new, self.since) = (self.open, self.open.then(Instant::now));
    }

    pub fn close(&mut self) {
        self.open = false;
    }

    /// Returns the mark with the text of the field and the time at which it was begun.
    fn mark(&mut self) -> Request {
        let ago_s = self.since.take().map_or(0.0, |since| since.elapsed().as_secs_f64());
        let words = std::mem::take(&mut self.words);
        let words = Text::<MARK_BYTES>::new(words.trim());
        let words = words.exact().map_or("", str::trim);
        let [_, longest_s] = MARK_BEFORE_RANGE_S;
        Request::Mark(Mark {
            text: if words.is_empty() { "mark" } else { words }.to_owned(),
            before_s: ago_s.min(longest_s),
        })
    }
}

pub fn instructor_ui(
    ctx: &egui::Context,
    shown: &Shown,
    moments: &Moments,
    state: &mut InstructorState,
) -> Option<Action> {
    let mut open = state.open;
    let window = egui::Window::new("Instructor").open(&mut open);
    let window = window.collapsible(false).resizable(false).default_width(WIDTH);
    let answer = window.show(ctx, |ui| {
        ui.set_max_width(WIDTH);
        let room = ui.ctx().content_rect().height() - TITLE_AND_EDGES;
        let scroll = egui::ScrollArea::vertical().max_height(room).min_scrolled_height(room);
        scroll.show(ui, |ui| dialog_ui(ui, shown, moments, state)).inner
    });
    state.open &= open;
    state.is_new = false;
    answer.and_then(|shown| shown.inner.flatten()).map(Action::Send)
}

fn dialog_ui(ui: &mut egui::Ui, shown: &Shown, moments: &Moments, state: &mut InstructorState) -> Option<Request> {
    let live = ui.add_enabled_ui(shown.is_live(), |ui| {
        let mark = mark_ui(ui, state);
        ui.separator();
        mark.or(exercises_ui(ui, shown, state))
    });
    ui.separator();
    moments_ui(ui, moments);
    live.inner
}

fn mark_ui(ui: &mut egui::Ui, state: &mut InstructorState) -> Option<Request> {
    let label = ui.label(theme::strong("Mark this moment"));
    let row = ui.horizontal(|ui| {
        let field = egui::TextEdit::singleline(&mut state.words).char_limit(MARK_BYTES);
        let field = ui
            .add(field.hint_text("a few words").desired_width(300.0))
            .labelled_by(label.id);
        if state.is_new {
            field.request_focus();
        }
        if field.changed() {
            state.since.get_or_insert_with(Instant::now);
        }
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        ui.button("Mark").clicked() || entered
    });
    ui.label(theme::small(
        "Time-stamped when you opened this window or started typing. Appears in recordings, curves and debrief.",
    ));
    row.inner.then(|| state.mark())
}

fn exercises_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut InstructorState) -> Option<Request> {
    let mut request = None;
    let mut begin = |ui: &mut egui::Ui, words: &str, exercise: Exercise| {
        if ui.button(words).clicked() {
            request = Some(Request::BeginExercise(exercise));
        }
    };
    ui.label(theme::strong("Inject a fault as an exercise"));
    ui.horizontal(|ui| {
        begin(ui, "Lose the device", Exercise::DeviceLost);
        ui.label(theme::small("the force stays off until it is re-armed"));
    });
    ui.horizontal(|ui| {
        begin(ui, "Stiffen the tissue", Exercise::StiffTissue { factor: state.factor });
        let [low, high] = EXERCISE_STIFFNESS_RANGE;
        let drag = DragValue::new(&mut state.factor).range(low..=high).speed(0.05);
        ui.add(drag.max_decimals(1).suffix(" times"));
        ui.label(theme::small("for needles inserted from now on"));
    });
    ui.horizontal(|ui| {
        let by_m = state.moved_mm.map(|mm| mm * 1e-3);
        begin(ui, "Move the gland", Exercise::BodyMoved { by_m });
        // Limits each axis, so that no three of them exceed the total.
        let most_mm = MOST_MOVED_M * 1e3 / 3.0_f64.sqrt();
        for (mm, axis) in state.moved_mm.iter_mut().zip(["x ", "y ", "z "]) {
            let drag = DragValue::new(mm).range(-most_mm..=most_mm).speed(0.1);
            ui.add(drag.max_decimals(1).prefix(axis).suffix(" mm"));
        }
    });
    let in_force: Vec<_> = shown.session.iter().flat_map(|s| s.exercises.all()).collect();
    for exercise in &in_force {
        ui.label(RichText::new(format!("Exercise: {exercise}")).color(theme::of(ui).warn));
    }
    let end = ui.add_enabled(!in_force.is_empty(), egui::Button::new("End all exercises"));
    if end.on_hover_text("A reset ends them too").clicked() {
        request = Some(Request::EndExercises);
    }
    request
}

fn moments_ui(ui: &mut egui::Ui, moments: &Moments) {
    ui.label(theme::strong("Last moments"));
    let mut none = true;
    for moment in moments.all().rev().take(LISTED) {
        none = false;
        let at = format::seconds(moment.time_ns);
        let line = format!("{at:.1} s  {}: {}", moment.kind.name(), moment.text);
        ui.add(egui::Label::new(theme::small(&line)).wrap());
    }
    if none {
        ui.label(theme::small("none since rt-core started"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_marks_are_shortened_to_the_core_s_limit() {
        for words in ["", "  apex ", &"é".repeat(90)] {
            let mut state = InstructorState::default();
            state.toggle();
            state.words = words.to_owned();
            let request = state.mark();
            let command = request.encode(1, 1).expect("fits");
            assert_eq!(Request::decode(&command), Ok(request));
        }
    }
}
