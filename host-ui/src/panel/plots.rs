//! The right panel: force and depth of the last seconds, or force and speed of the whole procedure, and the timing of the loop.

use super::axis::{LINES, grid, marks, number, upwards};
use super::history::{BINS, History, Percentiles, Quantity, WINDOW_S, bin_low_us};
use super::{Shown, setup};
use crate::score::Trace;
use crate::{format, theme};
use egui::{Color32, RichText};
use egui_plot::{AxisHints, Bar, BarChart, FilledArea, GridMark, Line, Plot, PlotPoints, PlotUi};

/// What stands between and under the three plots over time.
const BESIDE_PLOTS: f32 = 492.0;
const PLOT_HEIGHTS: [f32; 2] = [48.0, 150.0];

/// The plots share what of `height` the rest leaves. With `whole` they look back on all of the procedure.
pub fn plots_ui(ui: &mut egui::Ui, shown: &Shown, history: &History, whole: Option<&Trace>, height: f32) {
    let each = ((height - BESIDE_PLOTS) / 3.0).clamp(PLOT_HEIGHTS[0], PLOT_HEIGHTS[1]);
    let recent = |ui: &mut egui::Ui, (name, color), least, quantity| {
        let points = history.curve(quantity);
        strip(ui, (name, least), each, |plot| curve(plot, name, color, &points));
    };
    let tokens = theme::of(ui);
    tension_ui(ui, shown);
    let now = |value: Option<String>| value.unwrap_or_else(|| "n/a".to_owned());
    match whole.filter(|trace| !trace.is_empty()) {
        Some(trace) => whole_ui(ui, trace, each),
        None => {
            let force = now(shown.resistance_n().map(format::force));
            title(ui, "Force along the needle, N", &force, tokens.force);
            recent(ui, ("force", tokens.force), [-0.5, 2.0], Quantity::ResistanceN);
            let depth = now(shown.state.map(|s| format::length(s.depth_m)));
            title(ui, "Depth, mm", &depth, tokens.depth);
            recent(ui, ("depth", tokens.depth), [0.0, 10.0], Quantity::DepthMm);
        }
    }
    let worst = now(shown
        .state
        .map(|s| format::microseconds(Some(format::us(s.worst_wake_ns)))));
    title(ui, "Wake-up latency, us", &format!("worst {worst}"), tokens.wake);
    // Of latencies the worst counts.
    let worst = history.curve(Quantity::WakeUs).into_iter();
    let worst: Vec<[f64; 3]> = worst.map(|[x, _, high]| [x, 0.0, high]).collect();
    strip(ui, ("wake-up latency", [0.0, 50.0]), each, |plot| {
        plot.add(area("wake-up latency", tokens.wake, &worst));
    });
    histogram_ui(ui, history);
    timing_ui(ui, shown, history);
    setup::setup_ui(ui, shown);
}

/// From the first contact with tissue on.
fn whole_ui(ui: &mut egui::Ui, trace: &Trace, height: f32) {
    let (tokens, motion) = (theme::of(ui), trace.motion());
    let peak = format!("peak {}", format::force(motion.peak_force_n));
    title(ui, "Whole procedure: force, N", &peak, tokens.force);
    whole_strip(ui, &trace.force_n(), ("whole force", tokens.force, height));
    let peak = format!("peak inwards {}", format::speed(motion.peak_insertion_m_per_s));
    title(ui, "Speed, mm/s", &peak, tokens.depth);
    whole_strip(ui, &trace.speed_mm_per_s(), ("whole speed", tokens.depth, height));
}

/// `points`: smallest and largest over seconds.
fn whole_strip(ui: &mut egui::Ui, points: &[[f64; 3]], (name, color, height): (&str, Color32, f32)) {
    let end_s = points.last().map_or(1.0, |[seconds, ..]| seconds.max(1.0));
    plot(name, height)
        .y_grid_spacer(upwards)
        .y_axis_formatter(|mark: GridMark, _: &_| number(mark))
        .include_x(0.0)
        .include_x(end_s)
        .include_y(0.0)
        .include_y(1.0)
        .x_grid_spacer(move |_| grid([0.0, end_s], end_s / 5.0))
        .x_axis_formatter(move |mark: GridMark, _: &_| {
            // On the edge a label would be cut off.
            if mark.value > 0.96 * end_s {
                String::new()
            } else {
                format!("{} s", number(mark))
            }
        })
        .show(ui, |plot| curve(plot, name, color, points));
}

/// From smallest to largest, and a line through the middle where both are the same.
fn curve(plot: &mut PlotUi<'_>, name: &str, color: Color32, points: &[[f64; 3]]) {
    plot.add(area(name, color, points));
    let middle = points.iter().map(|[x, low, high]| [*x, 0.5 * (low + high)]);
    plot.line(Line::new(name, PlotPoints::from_iter(middle)).color(color).width(1.3));
}

fn area(name: &str, color: Color32, points: &[[f64; 3]]) -> FilledArea {
    let [xs, lows, highs] = [0, 1, 2].map(|n| points.iter().map(|p| p[n]).collect::<Vec<f64>>());
    FilledArea::new(name, &xs, &lows, &highs).fill_color(color)
}

/// What the membrane does before it gives way, which a mouse cannot let one feel.
fn tension_ui(ui: &mut egui::Ui, shown: &Shown) {
    let tokens = theme::of(ui);
    let tension = shown.membrane_tension();
    let words = match tension {
        Some(share) => format!("{:.0} % of the puncture", share * 100.0),
        None if shown.has_punctured() => "punctured".to_owned(),
        None if shown.state.is_none() => "n/a".to_owned(),
        None => "slack".to_owned(),
    };
    title(ui, "Membrane tension", &words, tokens.text);
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
    response.widget_info(|| {
        let text = format!("Membrane tension {words}");
        egui::WidgetInfo::labeled(egui::accesskit::Role::ProgressIndicator, true, text)
    });
}

fn title(ui: &mut egui::Ui, name: &str, value: &str, color: Color32) {
    ui.horizontal(|ui| {
        ui.label(RichText::new(name).color(color).size(12.5));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.monospace(value);
        });
    });
}

/// Over seconds before now; the axis that goes up shows at least `least`.
fn strip(ui: &mut egui::Ui, (name, least): (&str, [f64; 2]), height: f32, draw: impl FnOnce(&mut PlotUi<'_>)) {
    plot(name, height)
        .y_grid_spacer(upwards)
        .y_axis_formatter(|mark: GridMark, _: &_| number(mark))
        .include_x(-WINDOW_S)
        .include_x(0.0)
        .include_y(least[0])
        .include_y(least[1])
        .x_grid_spacer(|_| marks(-WINDOW_S, 2.5, 4))
        .x_axis_formatter(|mark: GridMark, _: &_| {
            // The last mark lies on the edge, where a label would be cut off.
            if mark.value < 0.0 {
                format!("{} s", mark.value)
            } else {
                String::new()
            }
        })
        .show(ui, draw);
}

/// Only to be looked at: a plot that moves must not be dragged by accident.
fn plot(name: &str, height: f32) -> Plot<'static> {
    Plot::new(name.to_owned())
        .height(height)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_axis_zoom_drag(false)
        .show_x(false)
        .custom_x_axes(vec![AxisHints::new_x().label_spacing(25.0..=35.0)])
        .custom_y_axes(vec![AxisHints::new_y().min_thickness(34.0).label_spacing(12.0..=20.0)])
        .grid_spacing(LINES)
        .show_background(true)
        .set_margin_fraction(egui::vec2(0.0, 0.08))
}

/// Both axes logarithmic, because one late tick in a minute must be seen.
fn histogram_ui(ui: &mut egui::Ui, history: &History) {
    let (timing, tokens) = (&history.timing, theme::of(ui));
    let ticks = format!("{} ticks", format::count(timing.samples as u64));
    ui.horizontal(|ui| {
        ui.label(RichText::new("Ticks by wake-up").color(tokens.wake).size(12.5));
        ui.label(RichText::new("and work").color(tokens.work).size(12.5));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.monospace(ticks);
        });
    });
    // Side by side in each bin, so that neither hides the other.
    let bars = |counts: &[u32], beside: f64| -> Vec<Bar> {
        let counts = counts.iter().enumerate().filter(|(_, n)| **n > 0);
        counts
            .map(|(bin, n)| Bar::new(bin as f64 + beside, f64::from(*n).log10() + 0.3).width(0.45))
            .collect()
    };
    let (wake, work) = (bars(&timing.wake_histogram, 0.25), bars(&timing.work_histogram, 0.75));
    plot("wake-up histogram", 66.0)
        .include_x(0.0)
        .include_x(BINS as f64)
        .include_y(0.0)
        .include_y(4.8)
        .x_grid_spacer(|_| marks(0.0, 5.0, 5))
        .y_grid_spacer(|_| marks(0.0, 2.0, 2))
        .x_axis_formatter(|mark: GridMark, _: &_| {
            // On the edge a label would be cut off.
            if mark.value < BINS as f64 {
                decade(bin_low_us(mark.value.max(0.0) as usize))
            } else {
                String::new()
            }
        })
        .y_axis_formatter(|mark: GridMark, _: &_| format!("{:.0}", 10.0_f64.powf(mark.value)))
        .show(ui, |plot| {
            plot.bar_chart(BarChart::new("wake-up", wake).color(tokens.wake));
            plot.bar_chart(BarChart::new("work", work).color(tokens.work));
        });
}

fn decade(us: f64) -> String {
    if us >= 999.0 {
        format!("{:.0} ms", us * 1e-3)
    } else {
        format!("{us:.0} us")
    }
}

fn timing_ui(ui: &mut egui::Ui, shown: &Shown, history: &History) {
    ui.spacing_mut().interact_size.y = 14.0;
    egui::Grid::new("timing")
        .num_columns(5)
        .min_col_width(48.0)
        .spacing([6.0, 2.0])
        .show(ui, |ui| {
            for head in ["last 60 s", "p50", "p99", "p99.9", "max"] {
                ui.label(theme::small(head));
            }
            ui.end_row();
            percentile_row(ui, "wake-up", &history.timing.wake);
            percentile_row(ui, "tick work", &history.timing.work);
        });
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
        ui.label(RichText::new(text).color(color).strong());
        ui.label(theme::small(format!("of {} ticks", format::count(s.tick))));
    });
    let text = format!(
        "tissue: missed {}, worst work {}; records lost {}; gate acted {}",
        format::count(s.tissue_missed_deadlines),
        format::microseconds(Some(format::us(s.worst_tissue_work_ns))),
        format::count(s.records_lost),
        format::count(s.gate_interventions)
    );
    ui.label(theme::small(text));
}

fn percentile_row(ui: &mut egui::Ui, name: &str, p: &Percentiles) {
    ui.label(theme::small(name));
    for value in [p.p50, p.p99, p.p999, p.max] {
        let text = RichText::new(format::microseconds(value)).monospace().size(11.0);
        let response = ui.label(text);
        if value.is_none() {
            response.on_hover_text("Told only with at least ten samples beyond it");
        }
    }
    ui.end_row();
}
