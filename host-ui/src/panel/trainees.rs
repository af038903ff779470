//! The list of trainees: the state of each, a click to follow one, a click to stop a hand.

use crate::action::{Action, TraineeAction};
use crate::theme;
use egui::{Color32, RichText};
use std::time::Duration;
use stylet_base::format;
use stylet_host::roster::Glance;
use stylet_shm_schema::{Fault, flags};

/// Silence after which a core is called silent.
const SILENT_AFTER: Duration = Duration::from_millis(1500);
/// Widths of name and state, with much room and with little.
const WIDTHS: [f32; 2] = [130.0, 210.0];
const NARROW_WIDTHS: [f32; 2] = [100.0, 140.0];
const TITLE_AND_EDGES: f32 = 110.0;
/// Width of the whole list with wide columns, and its distance from its neighbours.
const LIST_WIDTH: f32 = 720.0;
const MARGIN: f32 = 24.0;
const NARROW_MARGIN: f32 = 8.0;
/// Number of trainees with a key: F2 to F9.
pub const KEYS: usize = 8;

/// Urgency of a line in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    Good,
    Warn,
    Bad,
}

/// Text on one trainee: on the needle, and on the force.
#[derive(Debug, PartialEq)]
struct Line {
    level: Level,
    state: String,
    force: String,
    seeds: String,
    heard: String,
}

impl Line {
    fn of(glance: &Glance) -> Self {
        let nothing = |level, state: String, heard: String| Self {
            level,
            state,
            force: "n/a".to_owned(),
            seeds: "n/a".to_owned(),
            heard,
        };
        let Some(since) = glance.heard.map(|at| at.elapsed()) else {
            return nothing(Level::Bad, "no rt-core yet".to_owned(), "never".to_owned());
        };
        let heard = format!("{:.1} s ago", since.as_secs_f64());
        if since > SILENT_AFTER {
            let words = format!("silent for {:.0} s: ended, or disconnected", since.as_secs_f64());
            return nothing(Level::Bad, words, heard);
        }
        if let Some(line) = glance.relayed.filter(|line| line.is_heard == 0) {
            let age_s = line.snapshot_age_ns as f64 * 1e-9;
            return nothing(
                Level::Bad,
                format!("no data from the relay for {age_s:.0} s"),
                format!("{age_s:.1} s ago"),
            );
        }
        let Some(state) = glance.state else {
            return nothing(Level::Warn, "connecting".to_owned(), heard);
        };
        let exercises: Vec<String> = glance
            .session
            .iter()
            .flat_map(|s| s.exercises.all())
            .map(|e| e.to_string())
            .collect();
        let (level, mut words) = match Fault::from_number(state.fault) {
            Some(Fault::None) => (Level::Good, needle(&state)),
            Some(fault) => (Level::Bad, format!("fault: {}", short(fault))),
            None => (Level::Bad, "a fault that this program does not know".to_owned()),
        };
        if !exercises.is_empty() {
            words = format!("{words}; exercise: {}", exercises.join(", "));
        }
        let force_n = state.force_on_hand_n.iter().map(|c| c * c).sum::<f64>().sqrt();
        let planned = glance.plan.filter(|p| p.generation > 0).map_or(0, |p| p.seed_count);
        Self {
            level: if level == Level::Good && !exercises.is_empty() {
                Level::Warn
            } else {
                level
            },
            state: words,
            force: format::force(force_n),
            seeds: match planned {
                0 => state.seed_count.to_string(),
                n if u64::from(state.seed_count) <= n => format!("{} of {n}", state.seed_count),
                n => format!("{}; needle {n}", state.seed_count),
            },
            heard,
        }
    }
}

fn needle(state: &stylet_shm_schema::HapticState) -> String {
    if state.flags & (flags::IN_CONTACT | flags::PUNCTURED) == 0 {
        return match state.flags & flags::ENGAGED {
            0 => "outside, force off".to_owned(),
            _ => "outside".to_owned(),
        };
    }
    let rests = stylet_procedure::tolerance::is_at_rest(state.speed_m_per_s);
    let pace = if rests { ", at rest" } else { "" };
    format!("{:.0} mm past the membrane{pace}", state.depth_m * 1e3)
}

fn short(fault: Fault) -> &'static str {
    match fault {
        Fault::DeviceLost => "device lost",
        Fault::DeviceSilent => "device silent",
        Fault::TissueStale | Fault::TissueUnsolved => "tissue late or unsolved",
        Fault::OverrunStreak | Fault::LoopStopped => "force loop late or stopped",
        _ => "force off",
    }
}

/// Draws the list. `followed` is the trainee that the window shows.
pub fn trainees_ui(ctx: &egui::Context, glances: &[Glance], followed: Option<usize>) -> Option<Action> {
    if glances.is_empty() {
        return None;
    }
    let window = egui::Window::new("Trainees").auto_sized();
    let is_narrow = ctx.content_rect().width() < theme::LEFT_WIDTH + LIST_WIDTH + 2.0 * MARGIN;
    let (left, widths) = match is_narrow {
        true => (NARROW_MARGIN, NARROW_WIDTHS),
        false => (theme::LEFT_WIDTH + MARGIN, WIDTHS),
    };
    let shown = window
        .anchor(egui::Align2::LEFT_BOTTOM, [left, -MARGIN])
        .show(ctx, |ui| {
            let room = ui.ctx().content_rect().height() - TITLE_AND_EDGES;
            let scroll = egui::ScrollArea::vertical().max_height(room).min_scrolled_height(room);
            scroll.show(ui, |ui| list_ui(ui, glances, followed, widths)).inner
        });
    shown.and_then(|shown| shown.inner.flatten()).map(Action::Trainee)
}

fn list_ui(ui: &mut egui::Ui, glances: &[Glance], followed: Option<usize>, widths: [f32; 2]) -> Option<TraineeAction> {
    let mut asked = None;
    egui::Grid::new("trainees")
        .num_columns(7)
        .striped(true)
        .spacing([12.0, 4.0])
        .show(ui, |ui| {
            theme::heads(ui, ["trainee", "needle", "force", "seeds", "heard", "", ""]);
            for (number, glance) in glances.iter().enumerate() {
                asked = row_ui(ui, (number, glance), followed == Some(number), widths).or(asked.take());
                ui.end_row();
            }
        });
    if ui.button("Stop every hand").clicked() {
        asked = Some(TraineeAction::StopAll);
    }
    asked
}

fn row_ui(
    ui: &mut egui::Ui,
    (number, glance): (usize, &Glance),
    is_followed: bool,
    [name_width, state_width]: [f32; 2],
) -> Option<TraineeAction> {
    let (tokens, line) = (theme::of(ui), Line::of(glance));
    let color: Color32 = match line.level {
        Level::Good => tokens.text,
        Level::Warn => tokens.warn,
        Level::Bad => tokens.bad,
    };
    let name = egui::Button::selectable(is_followed, glance.trainee.name.as_str()).wrap();
    let name = column(ui, name_width, name);
    let key = if number < KEYS {
        format!(" (key F{})", number + 2)
    } else {
        String::new()
    };
    let name = name.on_hover_text(format!("Follow{key}; instance {}", glance.trainee.instance.name()));
    column(
        ui,
        state_width,
        egui::Label::new(RichText::new(&line.state).color(color)).wrap(),
    );
    ui.monospace(&line.force);
    ui.monospace(&line.seeds);
    ui.label(theme::small(&line.heard));
    let stop = ui
        .button("Stop hand")
        .on_hover_text(format!("Stop the hand of {}", glance.trainee.name));
    if stop.clicked() {
        return Some(TraineeAction::Stop(number));
    }
    let has_seeds = glance.state.is_some_and(|state| state.seed_count > 0);
    let debrief = ui
        .add_enabled(has_seeds, egui::Button::new("Debrief"))
        .on_hover_text(format!(
            "Writes the debrief of {} from this window's data: debrief.html and score.json",
            glance.trainee.name
        ))
        .on_disabled_hover_text("No seed lies in the tissue yet");
    if debrief.clicked() {
        return Some(TraineeAction::Debrief(number));
    }
    name.clicked().then_some(TraineeAction::Follow(number))
}

/// Draws a column as wide as its text, which wraps beyond a limit.
fn column(ui: &mut egui::Ui, most: f32, widget: impl egui::Widget) -> egui::Response {
    let shown = ui.vertical(|ui| {
        ui.set_max_width(most);
        ui.add(widget)
    });
    shown.inner
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use std::time::Instant;
    use stylet_host::roster::Trainee;
    use stylet_shm_schema::Instance;
    use stylet_shm_schema::{Exercise, HapticState, PlanInForce, Relayed, Session};

    fn glance() -> Glance {
        let mut state = HapticState::zeroed();
        (state.tick, state.flags, state.depth_m) = (5, flags::ENGAGED | flags::PUNCTURED, 0.034);
        (state.force_on_hand_n, state.seed_count, state.speed_m_per_s) = ([0.0, 3.0, 4.0], 2, 0.05);
        let mut plan = PlanInForce::zeroed();
        (plan.generation, plan.seed_count) = (1, 5);
        Glance {
            trainee: Trainee {
                name: "Otto".to_owned(),
                instance: Instance::default(),
            },
            heard: Some(Instant::now()),
            state: Some(state),
            session: Some(Session::zeroed()),
            plan: Some(plan),
            relayed: None,
        }
    }

    #[test]
    fn a_line_shows_needle_and_problem() {
        let mut one = glance();
        let line = Line::of(&one);
        assert_eq!(
            (line.level, line.state.as_str(), line.seeds.as_str()),
            (Level::Good, "34 mm past the membrane", "2 of 5")
        );
        assert_eq!(line.force, format::force(5.0));
        if let Some(session) = &mut one.session {
            session.exercises.put(Exercise::StiffTissue { factor: 2.0 });
        }
        let line = Line::of(&one);
        assert_eq!(line.level, Level::Warn);
        assert!(
            line.state.ends_with("exercise: tissue 2.0 times as stiff"),
            "{}",
            line.state
        );
        if let Some(state) = &mut one.state {
            state.fault = Fault::DeviceLost as u32;
        }
        let line = Line::of(&one);
        assert_eq!(line.level, Level::Bad);
        assert!(line.state.starts_with("fault: device lost"), "{}", line.state);
        one.relayed = Some(Relayed {
            snapshot_age_ns: 7_000_000_000,
            ..Relayed::zeroed()
        });
        assert_eq!(Line::of(&one).state, "no data from the relay for 7 s");
        one.heard = Instant::now().checked_sub(Duration::from_secs(12));
        assert!(
            Line::of(&one).state.starts_with("silent for 12 s"),
            "{}",
            Line::of(&one).state
        );
        one.heard = None;
        assert_eq!(Line::of(&one).state, "no rt-core yet");
    }
}
