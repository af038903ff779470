//! The right panel: force and depth of the last seconds, or force and speed of the whole procedure,
//! and the timing of the loop.

use super::histogram::histogram_ui;
use super::history::{History, Percentiles, Quantity, WINDOW_S};
use super::setup;
use super::strip::Strip;
use crate::shown::Shown;
use crate::theme;
use crate::words::Explained;
use egui::{Color32, RichText};
use stylet_base::format;
use stylet_base::seen::Seen;
use stylet_host::moments::{Moment, MomentKind, Moments};
use stylet_implant::score::Trace;

/// Height of the parts under the plots over time, and of the title over each.
const UNDER_PLOTS: f32 = 432.0;
/// The same for a core that this window steps: it has no latency, and no times of ticks.
const UNDER_STEPPED: f32 = 150.0;
const TITLE: f32 = 20.0;
const PLOT_HEIGHTS: [f32; 2] = [48.0, 190.0];
/// Height of a line on unseen ticks.
const SEEN_LINE: f32 = 20.0;
/// Height of the legend of the marks.
const MARKS_LINE: f32 = 22.0;
/// Height of the line of the second device.
const SECOND_LINE: f32 = 16.0;

/// Draws the plots, which share the free part of `height`. With `whole` they cover the whole
/// procedure.
pub fn plots_ui(
    ui: &mut egui::Ui,
    shown: &Shown,
    history: &History,
    moments: &Moments,
    whole: Option<&Trace>,
    height: f32,
) {
    let marks = marks(ui, moments, |time_ns| history.before_s(time_ns));
    let whole = whole.filter(|trace| !trace.is_empty());
    let marked = kinds_of_marks(moments, history, whole);
    let lines = usize::from(!history.timing.seen.is_all())
        + usize::from(whole.is_some_and(|trace| !trace.motion().seen.is_all()));
    let second = if shown.second_hand().is_some() {
        SECOND_LINE
    } else {
        0.0
    };
    let (plots, under) = match shown.is_stepped {
        true => (Quantity::ALL.len() as f32 - 1.0, UNDER_STEPPED),
        false => (Quantity::ALL.len() as f32, UNDER_PLOTS),
    };
    let legend = if marked.is_empty() { 0.0 } else { MARKS_LINE };
    let free = height - under - plots * TITLE - second - legend - lines as f32 * SEEN_LINE;
    let each = (free / plots).clamp(PLOT_HEIGHTS[0], PLOT_HEIGHTS[1]);
    let recent = |ui: &mut egui::Ui, name, color, unit, least, quantity| {
        Strip {
            name,
            unit,
            color,
            height: each,
            seconds: [-WINDOW_S, 0.0],
            least,
            pieces: &history.curve(quantity),
            marks: &marks,
            worst_only: matches!(quantity, Quantity::WakeUs),
        }
        .show(ui);
    };
    let tokens = theme::of(ui);
    tension_ui(ui, shown);
    marks_ui(ui, &marked);
    let now = |value: Option<String>| value.unwrap_or_else(|| "n/a".to_owned());
    match whole {
        Some(trace) => whole_ui(ui, trace, moments, each),
        None => {
            let force = now(shown.resistance_n().map(format::force));
            title(ui, "Force along the needle, N", &force, tokens.force).explained("force on the hand");
            recent(ui, "force", tokens.force, ("N", 2), [-0.5, 2.0], Quantity::ResistanceN);
            let depth = now(shown.state.map(|s| format::length(s.depth_m)));
            title(ui, "Past the membrane, mm", &depth, tokens.depth).explained("past the membrane");
            recent(
                ui,
                "past the membrane",
                tokens.depth,
                ("mm", 1),
                [0.0, 10.0],
                Quantity::DepthMm,
            );
        }
    }
    if shown.is_stepped {
        return setup::setup_ui(ui, shown);
    }
    let worst = now(shown
        .state
        .map(|s| format::microseconds(Some(format::us(s.worst_wake_ns)))));
    title(ui, "Wake-up latency, µs", &format!("worst {worst}"), tokens.wake).explained("wake-up latency");
    recent(
        ui,
        "wake-up latency",
        tokens.wake,
        ("µs", 1),
        [0.0, 50.0],
        Quantity::WakeUs,
    );
    histogram_ui(ui, &history.timing);
    timing_ui(ui, shown, history);
    setup::setup_ui(ui, shown);
}

fn color_of(ui: &egui::Ui, kind: MomentKind) -> Color32 {
    let tokens = theme::of(ui);
    match kind {
        MomentKind::Mark => tokens.accent,
        MomentKind::Exercise => tokens.warn,
        MomentKind::Fault => tokens.bad,
    }
}

/// Returns the kinds of marks in the plots.
fn kinds_of_marks(moments: &Moments, history: &History, whole: Option<&Trace>) -> Vec<MomentKind> {
    let began_ns = whole.and_then(Trace::began_ns).unwrap_or(u64::MAX);
    let is_plotted = |m: &&Moment| m.time_ns >= began_ns || history.before_s(m.time_ns).is_some();
    let plotted: Vec<MomentKind> = moments.all().filter(is_plotted).map(|m| m.kind).collect();
    let all = [MomentKind::Mark, MomentKind::Exercise, MomentKind::Fault];
    all.into_iter().filter(|kind| plotted.contains(kind)).collect()
}

/// Names the vertical lines in the plots by their colours.
fn marks_ui(ui: &mut egui::Ui, kinds: &[MomentKind]) {
    if kinds.is_empty() {
        return;
    }
    ui.horizontal(|ui| {
        ui.label(theme::small("Lines in the plots:"));
        for kind in kinds {
            let text = RichText::new(kind.name()).small().color(color_of(ui, *kind));
            ui.label(text);
        }
    });
}

/// Returns the marks inside the range of a plot.
fn marks(ui: &egui::Ui, moments: &Moments, at_s: impl Fn(u64) -> Option<f64>) -> Vec<(f64, Color32, String)> {
    let shown = |m: &Moment| {
        Some((
            at_s(m.time_ns)?,
            color_of(ui, m.kind),
            format!("{}: {}", m.kind.name(), m.text),
        ))
    };
    moments.all().filter_map(shown).collect()
}

/// Draws the procedure from the first contact with tissue on.
fn whole_ui(ui: &mut egui::Ui, trace: &Trace, moments: &Moments, height: f32) {
    let began_ns = trace.began_ns().unwrap_or(u64::MAX);
    let marks = marks(ui, moments, |time_ns| {
        time_ns.checked_sub(began_ns).map(format::seconds)
    });
    let (tokens, motion) = (theme::of(ui), trace.motion());
    let whole = |ui: &mut egui::Ui, name, color, unit, pieces: Vec<Vec<[f64; 3]>>| {
        let last = pieces.last().and_then(|piece| piece.last());
        Strip {
            name,
            unit,
            color,
            height,
            seconds: [0.0, last.map_or(1.0, |[seconds, ..]| seconds.max(1.0))],
            least: [0.0, 1.0],
            pieces: &pieces,
            marks: &marks,
            worst_only: false,
        }
        .show(ui);
    };
    let peak = format!("peak {}", format::force(motion.peak_force_n));
    let of = match motion.is_from_middle {
        true => "Since this window opened",
        false => "Whole procedure",
    };
    title(ui, &format!("{of}: force, N"), &peak, tokens.force).explained("force on the hand");
    whole(ui, "whole force", tokens.force, ("N", 2), trace.force_n());
    let peak = format!("peak inwards {}", format::speed(motion.peak_insertion_m_per_s));
    title(ui, "Speed, mm/s", &peak, tokens.depth).explained("speed");
    whole(ui, "whole speed", tokens.depth, ("mm/s", 1), trace.speed_mm_per_s());
    seen_ui(ui, "peaks and curves", motion.seen);
}

/// Draws a remark if figures do not cover every tick.
fn seen_ui(ui: &mut egui::Ui, of: &str, seen: Seen) {
    if seen.is_all() {
        return;
    }
    let text = RichText::new(format!("{of}: {}", seen.words()))
        .small()
        .color(theme::of(ui).warn);
    ui.label(text).on_hover_text(
        "The other ticks ran, and their records did not reach this window. Deadlines that the core itself missed are no \
         ticks: they are counted under \"missed deadlines\".",
    );
}

/// Draws the tension of the membrane before it gives way, which a mouse cannot render.
fn tension_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let tension = shown.membrane_tension();
    let words = match tension {
        Some(share) => format!("{:.0} % of the puncture", share * 100.0),
        None if shown.has_punctured() => "punctured".to_owned(),
        None if shown.state.is_none() => "n/a".to_owned(),
        None => "slack".to_owned(),
    };
    title(ui, "Membrane tension", &words, tokens.text)
        .explained("membrane tension")
        .explained("membrane")
        .explained("puncture");
    let size = egui::vec2(ui.available_width(), 8.0);
    let (rect, response) = ui.allocate_exact_size(size, egui::Sense::hover());
    let share = tension.unwrap_or(0.0) as f32;
    ui.painter().rect_filled(rect, 4.0, tokens.background);
    let mut filled = rect;
    filled.set_width(rect.width() * share);
    let color = if share > 0.8 { tokens.bad } else { tokens.force };
    ui.painter().rect_filled(filled, 4.0, color);
    let edge = rect.left() + 0.8 * rect.width();
    ui.painter()
        .vline(edge, rect.y_range(), egui::Stroke::new(1.0, tokens.weak));
    let name = || format!("Membrane tension {words}");
    theme::named(&response, egui::accesskit::Role::ProgressIndicator, name);
}

fn title(ui: &mut egui::Ui, name: &str, value: &str, color: Color32) -> egui::Response {
    let named = ui.horizontal(|ui| {
        let named = ui.label(RichText::new(name).color(color).size(12.5));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.monospace(value);
        });
        named
    });
    named.inner
}

fn timing_ui(ui: &mut egui::Ui, shown: &Shown, history: &History) {
    ui.spacing_mut().interact_size.y = 14.0;
    egui::Grid::new("timing")
        .num_columns(5)
        .min_col_width(48.0)
        .spacing([6.0, 2.0])
        .show(ui, |ui| {
            theme::heads(ui, ["last 60 s", "p50", "p99", "p99.9", "max"]);
            percentile_row(ui, "wake-up", &history.timing.wake);
            percentile_row(ui, "tick work", &history.timing.work);
        });
    seen_ui(ui, "last 60 s", history.timing.seen);
    let Some(s) = &shown.state else {
        ui.label(theme::small("missed deadlines n/a"));
        return;
    };
    ui.horizontal(|ui| {
        let tokens = theme::of(ui);
        let color = if s.missed_deadlines > 0 {
            tokens.warn
        } else {
            tokens.good
        };
        let text = format!("missed deadlines {}", format::count(s.missed_deadlines));
        ui.label(RichText::new(text).color(color).strong())
            .explained("missed deadline");
        // A procedure begins with a reset, but tick numbers continue, so no share is shown.
        ui.label(theme::small("since the last reset"))
            .on_hover_text(format!(
                "{} ticks since rt-core started; missed: {} since then, {} since the force was last turned on",
                format::count(s.tick),
                format::count(s.since_start.missed),
                format::count(s.since_armed.missed)
            ))
            .explained("tick");
    });
    let text = format!(
        "tissue: missed {}, worst work {}; lost in core {}; force limited {}",
        format::count(s.tissue_missed_deadlines),
        format::microseconds(Some(format::us(s.worst_tissue_work_ns))),
        format::count(s.records_lost),
        format::count(s.gate_interventions)
    );
    ui.label(theme::small(text)).explained("gate");
}

fn percentile_row(ui: &mut egui::Ui, name: &str, p: &Percentiles) {
    ui.label(theme::small(name));
    for value in [p.p50, p.p99, p.p999, p.max] {
        let text = RichText::new(format::microseconds(value)).monospace().size(11.0);
        let response = ui.label(text);
        if value.is_none() {
            response.on_hover_text("Shown only when at least ten samples lie beyond it");
        }
    }
    ui.end_row();
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use stylet_shm_schema::{Event, EventKind, TickRecord};

    /// Guards against orange lines that nothing named.
    #[test]
    fn lines_in_the_plots_are_named_while_they_are_in_them() {
        let mut history = History::default();
        let mut record = TickRecord::zeroed();
        record.due_ns = 100_000_000_000;
        history.take(&[record], [0.0, 0.0, 1.0]);
        let event = |sequence, kind: EventKind, time_ns| Event {
            sequence,
            time_ns,
            kind: kind as u32,
            ..Event::zeroed()
        };
        let mut moments = Moments::default();
        moments.take(&[
            event(1, EventKind::ExerciseBegun, 1_000),
            event(2, EventKind::FaultRaised, record.due_ns - 1_000),
            event(3, EventKind::Mark, record.due_ns),
        ]);
        assert_eq!(
            kinds_of_marks(&moments, &history, None),
            [MomentKind::Mark, MomentKind::Fault]
        );
    }
}
