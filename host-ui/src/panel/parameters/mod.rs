//! The dialog of every parameter of tissue, needle and force, made from the table of the contract.

mod preset;

use crate::shown::Shown;
use crate::theme;
use egui::{Button, DragValue, RichText};
use std::cell::Cell;
use std::path::Path;
use stylet_base::format;
use stylet_host::link::Answer;
use stylet_shm_schema::{PARAMETER_COUNT, PARAMETERS, ParameterGroup, ParameterSpec, Refusal};

/// Note under a row.
#[derive(Clone, Debug, Default, PartialEq)]
enum RowNote {
    #[default]
    None,
    InForce(u64),
    Refused(&'static str),
    /// A number that was typed is beyond the limits, and not in force.
    Beyond(f64),
}

/// State of the dialog. One change at a time is under way; edits made meanwhile go with the next.
pub struct ParametersState {
    pub open: bool,
    search: String,
    preset_path: String,
    /// Edited values that are not yet in force, SI.
    drafts: [Option<f64>; PARAMETER_COUNT],
    in_flight: Option<(u64, Vec<(usize, f64)>)>,
    /// True if values were edited since the last request.
    unsent: bool,
    notes: [RowNote; PARAMETER_COUNT],
    foot: Option<(bool, String)>,
}

impl Default for ParametersState {
    fn default() -> Self {
        Self {
            open: false,
            search: String::new(),
            preset_path: "parameters.toml".to_owned(),
            drafts: [None; PARAMETER_COUNT],
            in_flight: None,
            unsent: false,
            notes: [const { RowNote::None }; PARAMETER_COUNT],
            foot: None,
        }
    }
}

impl ParametersState {
    /// Returns pairs for `SetParameters`, if there are edits and no request is under way.
    pub fn request(&self) -> Option<Vec<(usize, f64)>> {
        if !self.unsent || self.in_flight.is_some() {
            return None;
        }
        let pairs: Vec<_> = self
            .drafts
            .iter()
            .enumerate()
            .filter_map(|(i, d)| Some((i, (*d)?)))
            .collect();
        (!pairs.is_empty()).then_some(pairs)
    }

    pub fn sent(&mut self, command_id: u64, pairs: Vec<(usize, f64)>) {
        self.unsent = false;
        self.in_flight = Some((command_id, pairs));
    }

    pub fn not_sent(&mut self, why: String) {
        self.unsent = false;
        self.drafts = [None; PARAMETER_COUNT];
        self.foot = Some((true, why));
    }

    pub fn waiting_for(&self) -> Option<u64> {
        self.in_flight.as_ref().map(|(id, _)| *id)
    }

    /// Takes an answer. A refusal marks the parameters involved; the full reasons stand at the
    /// foot.
    pub fn answered(&mut self, answer: &Answer) {
        if let Some((_, pairs)) = self.in_flight.take() {
            self.note(pairs, answer);
        }
    }

    /// Takes changes that were not sent because the core would refuse them.
    pub fn refused(&mut self, pairs: Vec<(usize, f64)>, refusal: Refusal) {
        self.unsent = false;
        self.note(pairs, &Err(refusal));
    }

    fn note(&mut self, pairs: Vec<(usize, f64)>, answer: &Answer) {
        for (index, value) in pairs {
            let (Some(spec), Some(draft)) = (PARAMETERS.get(index), self.drafts.get_mut(index)) else {
                continue;
            };
            if *draft == Some(value) {
                *draft = None;
            }
            self.notes[index] = match answer {
                Ok(tick) => RowNote::InForce(*tick),
                Err(refusal) => RowNote::Refused(reason_for(spec, refusal)),
            };
        }
        self.foot = Some(match answer {
            Ok(tick) => (false, format!("In force since tick {}", format::count(*tick))),
            Err(refusal) => (true, format!("Refused, nothing changed: {refusal}")),
        });
    }

    /// Forgets the request under way, because the core is gone.
    pub fn forget(&mut self) {
        self.in_flight = None;
        self.drafts = [None; PARAMETER_COUNT];
        self.unsent = false;
    }

    /// Writes the values in force to the named file.
    fn save_preset(&mut self, shown: &Shown) {
        let set = shown.parameters.map(|p| p.set).unwrap_or_default();
        self.foot = Some(match preset::save(Path::new(self.preset_path.trim()), &set) {
            Ok(()) => (false, format!("Saved to {}", self.preset_path.trim())),
            Err(why) => (true, why.to_string()),
        });
    }

    /// Takes every value of a file, or none and shows every error.
    fn load_preset(&mut self) {
        match preset::load(Path::new(self.preset_path.trim())) {
            Ok(values) => values.into_iter().for_each(|(index, value)| self.edit(index, value)),
            Err(why) => self.foot = Some((true, why.to_string())),
        }
    }

    fn edit(&mut self, index: usize, value: f64) {
        self.drafts[index] = Some(value);
        self.notes[index] = RowNote::None;
        self.unsent = true;
    }
}

fn reason_for(spec: &ParameterSpec, refusal: &Refusal) -> &'static str {
    let own = refusal
        .reasons
        .iter()
        .find(|reason| reason.parameter() == Some(spec.id));
    own.and_then(|reason| reason.code())
        .map_or("refused with others, see below", |code| code.message())
}

pub fn parameters_ui(ctx: &egui::Context, shown: &Shown, state: &mut ParametersState) {
    let mut open = state.open;
    let screen = ctx.content_rect().size();
    let room = screen - egui::vec2(24.0, 24.0);
    egui::Window::new("Parameters")
        .open(&mut open)
        .default_size(egui::vec2(700.0, 600.0).min(room))
        .default_pos([300.0_f32.min(screen.x - 712.0).max(12.0), 90.0_f32.min(screen.y / 8.0)])
        .max_size(room)
        .collapsible(false)
        .show(ctx, |ui| {
            if shown.parameters.is_none() {
                ui.label(
                    RichText::new("rt-core has not reported its parameters yet; these are the defaults.")
                        .color(theme::of(ui).warn),
                );
            }
            search_ui(ui, state);
            let height = (screen.y - 240.0).clamp(80.0, 640.0);
            egui::ScrollArea::both()
                .max_height(height)
                .min_scrolled_height(height)
                .auto_shrink([false, true])
                .show(ui, |ui| {
                    let found = found(&state.search);
                    for group in ParameterGroup::ALL {
                        group_ui(ui, shown, state, (group, &found));
                    }
                    if found.is_empty() {
                        ui.label(theme::weak("No parameter matches."));
                    }
                });
            ui.separator();
            foot_ui(ui, shown, state);
        });
    state.open = open;
}

fn search_ui(ui: &mut egui::Ui, state: &mut ParametersState) {
    ui.horizontal(|ui| {
        let label = ui.label(theme::weak("Search"));
        let edit = egui::TextEdit::singleline(&mut state.search)
            .hint_text("name, key, source or help text")
            .desired_width(300.0);
        ui.add(edit).labelled_by(label.id);
        if ui.add_enabled(!state.search.is_empty(), Button::new("Clear")).clicked() {
            state.search.clear();
        }
    });
}

/// Returns the places in the table whose text contains every word of the search.
fn found(search: &str) -> Vec<usize> {
    let wanted = search.to_lowercase();
    let has = |spec: &ParameterSpec| {
        let text = [
            spec.label,
            spec.key,
            spec.unit,
            spec.source,
            spec.help,
            spec.group.name(),
        ]
        .join(" ");
        let text = text.to_lowercase();
        wanted.split_whitespace().all(|word| text.contains(word))
    };
    (0..PARAMETERS.len()).filter(|&i| has(&PARAMETERS[i])).collect()
}

fn group_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut ParametersState, (group, found): (ParameterGroup, &[usize])) {
    if !found.iter().any(|&i| PARAMETERS[i].group == group) {
        return;
    }
    ui.heading(group.name());
    egui::Grid::new(group.name())
        .num_columns(5)
        .striped(true)
        .spacing([14.0, 4.0])
        .show(ui, |ui| {
            for &index in found.iter().filter(|&&i| PARAMETERS[i].group == group) {
                row_ui(ui, shown, state, index, &PARAMETERS[index]);
            }
        });
    ui.add_space(4.0);
}

/// Draws text in a column of the same width in every group, so that the groups align.
fn column(ui: &mut egui::Ui, width: f32, text: RichText) -> egui::Response {
    ui.horizontal(|ui| {
        ui.set_min_width(width);
        ui.label(text)
    })
    .inner
}

fn row_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut ParametersState, index: usize, spec: &ParameterSpec) {
    let in_force = shown.parameters.map_or(spec.default, |p| p.set.get(spec.id));
    let value = state.drafts[index].unwrap_or(in_force);
    let scale = spec.display_per_si;
    let (low, high) = (spec.min * scale, spec.max * scale);
    let label = column(ui, 165.0, spec.label.into()).on_hover_text(format!("{}\n{}", spec.help, spec.key));
    let mut displayed = value * scale;
    let beyond = Cell::new(None);
    let drag = DragValue::new(&mut displayed)
        .range(low..=high)
        .custom_parser(|text| {
            let value = typed(text, spec.unit)?;
            beyond.set((!(low..=high).contains(&value)).then_some(value));
            Some(value)
        })
        .speed((high - low) * 0.002)
        .max_decimals(4)
        .update_while_editing(false)
        .suffix(if spec.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", spec.unit)
        });
    let response = ui
        .add_enabled_ui(shown.is_live(), |ui| ui.add_sized([124.0, 22.0], drag))
        .inner;
    let response = response.labelled_by(label.id).on_hover_text(spec.help);
    if let Some(value) = beyond.get() {
        state.notes[index] = RowNote::Beyond(value);
    } else if response.changed() {
        state.edit(index, (displayed / scale).clamp(spec.min, spec.max));
    }
    column(ui, 95.0, theme::small(format!("{} to {}", plain(low), plain(high))));
    column(ui, 100.0, theme::small(spec.source)).on_hover_text(spec.help);
    ui.horizontal(|ui| {
        let changed = (value - spec.default).abs() > 1e-9 * spec.default.abs().max(1e-12);
        let reset = ui.add_enabled(changed && shown.is_live(), Button::new("Reset").small());
        theme::named(&reset, egui::accesskit::Role::Button, || {
            format!("Reset {}", spec.label)
        });
        if reset
            .on_hover_text(format!("Back to {} {}", plain(spec.default * scale), spec.unit))
            .clicked()
        {
            state.edit(index, spec.default);
        }
        note_ui(ui, state, index);
    });
    ui.end_row();
}

fn note_ui(ui: &mut egui::Ui, state: &ParametersState, index: usize) {
    if state.drafts[index].is_some() {
        ui.label(theme::small("sent"));
        return;
    }
    match &state.notes[index] {
        RowNote::None => {}
        RowNote::InForce(tick) => {
            ui.label(
                RichText::new(format!("since tick {}", format::count(*tick)))
                    .small()
                    .color(theme::of(ui).good),
            );
        }
        RowNote::Beyond(value) => {
            let text = format!("{} is beyond the limits; not changed", plain(*value));
            ui.label(RichText::new(text).small().color(theme::of(ui).bad));
        }
        RowNote::Refused(why) => {
            let text = RichText::new("refused").small().color(theme::of(ui).bad);
            ui.label(text).on_hover_text(*why);
        }
    }
}

fn foot_ui(ui: &mut egui::Ui, shown: &Shown, state: &mut ParametersState) {
    ui.horizontal_wrapped(|ui| {
        if ui
            .add_enabled(shown.is_live(), Button::new("Reset all parameters"))
            .clicked()
        {
            for (index, spec) in PARAMETERS.iter().enumerate() {
                state.edit(index, spec.default);
            }
        }
        if let Some(p) = &shown.parameters {
            let text = format!(
                "change {} in force since tick {}",
                p.generation,
                format::count(p.effective_tick)
            );
            ui.label(theme::small(text));
        }
    });
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(theme::weak("Preset"));
        let edit = egui::TextEdit::singleline(&mut state.preset_path).desired_width(260.0);
        ui.add(edit).labelled_by(label.id);
        let named = !state.preset_path.trim().is_empty();
        if ui.add_enabled(named, Button::new("Save preset")).clicked() {
            state.save_preset(shown);
        }
        if ui
            .add_enabled(named && shown.is_live(), Button::new("Load preset"))
            .clicked()
        {
            state.load_preset();
        }
    });
    if let Some((refused, text)) = &state.foot {
        let tokens = theme::of(ui);
        let color = if *refused { tokens.bad } else { tokens.good };
        ui.label(RichText::new(text).color(color));
    }
}

/// Reads a number that was typed, with or without its unit.
fn typed(text: &str, unit: &str) -> Option<f64> {
    let text = text.trim().trim_end_matches(unit).trim();
    text.replace('\u{2212}', "-").replace(',', ".").parse().ok()
}

/// Formats a value with as few digits as needed.
fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests;
