//! Histograms of wake-up latency and work of the force loop. Both axes are logarithmic, so that one
//! late tick in a minute is visible.

use super::axis::{marks, plot};
use super::history::{BINS, Timing, bin_low_us};
use crate::theme;
use egui::RichText;
use egui_plot::{Bar, BarChart, GridMark};
use stylet_base::format;

/// Height of a bar of one tick.
const ONE_TICK: f64 = 0.4;
/// Number of powers of ten that fit above it.
const DECADES: f64 = 4.8;

pub fn histogram_ui(ui: &mut egui::Ui, timing: &Timing) {
    let tokens = theme::of(ui);
    ui.horizontal(|ui| {
        ui.label(RichText::new("Ticks by wake-up").color(tokens.wake).size(12.5));
        ui.label(RichText::new("and work").color(tokens.work).size(12.5));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let seen = timing.seen;
            if seen.is_all() {
                ui.monospace(format!("{} ticks", format::count(seen.seen)));
            } else {
                let text = format!("{} of {} seen", format::count(seen.seen), format::count(seen.ran()));
                ui.label(RichText::new(text).monospace().size(11.0).color(tokens.warn));
            }
        });
    });
    let shown = plot("wake-up histogram", 66.0)
        .include_x(0.0)
        .include_x(BINS as f64)
        .include_y(0.0)
        .include_y(ONE_TICK + DECADES)
        .x_grid_spacer(|_| marks(0.0, 5.0, 5))
        .y_grid_spacer(|_| marks(ONE_TICK, 2.0, 2))
        .x_axis_formatter(|mark: GridMark, _: &_| {
            // At the edge a label would be cut off.
            if mark.value < BINS as f64 {
                decade(bin_low_us(mark.value.max(0.0) as usize))
            } else {
                String::new()
            }
        })
        .y_axis_formatter(|mark: GridMark, _: &_| format!("{:.0}", 10.0_f64.powf(mark.value - ONE_TICK)))
        .show(ui, |plot| {
            // Side by side in each bin, so that neither hides the other.
            for (name, counts, beside, color) in [
                ("wake-up", &timing.wake_histogram, 0.25, tokens.wake),
                ("work", &timing.work_histogram, 0.75, tokens.work),
            ] {
                let chart = BarChart::new(name, bars(counts, beside)).color(color);
                plot.bar_chart(chart.allow_hover(false));
            }
        });
    if let Some(place) = shown.response.hover_pos() {
        let bin = shown.transform.value_from_position(place).x.max(0.0) as usize;
        shown
            .response
            .on_hover_text_at_pointer(bin_text(timing, bin.min(BINS - 1)));
    }
}

fn bars(counts: &[u32; BINS], beside: f64) -> Vec<Bar> {
    let counts = counts.iter().enumerate().filter(|(_, n)| **n > 0);
    let bar = |(bin, n): (usize, &u32)| Bar::new(bin as f64 + beside, f64::from(*n).log10() + ONE_TICK).width(0.45);
    counts.map(bar).collect()
}

/// Describes a bin.
fn bin_text(timing: &Timing, bin: usize) -> String {
    let us = |bin: usize| format::microseconds(Some(bin_low_us(bin)));
    let range = match bin {
        0 => format!("Below {}", us(1)),
        bin if bin + 1 < BINS => format!("{} to {}", us(bin), us(bin + 1)),
        bin => format!("{} and more", us(bin)),
    };
    let [wake, work] = [timing.wake_histogram[bin], timing.work_histogram[bin]].map(|n| format::count(u64::from(n)));
    format!("{range}\nticks by wake-up: {wake}\nticks by work: {work}")
}

fn decade(us: f64) -> String {
    if us >= 999.0 {
        format!("{:.0} ms", us * 1e-3)
    } else {
        format!("{us:.0} µs")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_count_ticks_by_duration() {
        let mut timing = Timing::default();
        timing.wake_histogram[5] = 1_234;
        timing.work_histogram[5] = 1;
        assert_eq!(
            bin_text(&timing, 5),
            "10.0 µs to 15.8 µs\nticks by wake-up: 1 234\nticks by work: 1"
        );
        assert!(bin_text(&timing, 0).starts_with("Below 1.6 µs"));
        assert!(bin_text(&timing, BINS - 1).starts_with("63.1 ms and more"));
    }

    /// Checks that a bar reaches the mark of its number of ticks.
    #[test]
    fn bars_end_where_the_axis_says() {
        let mut counts = [0; BINS];
        (counts[3], counts[7]) = (100, 1);
        let bars = bars(&counts, 0.25);
        assert_eq!(bars.len(), 2);
        let marks = marks(ONE_TICK, 2.0, 2);
        assert_eq!([bars[0].value, bars[1].value], [marks[1].value, marks[0].value]);
        assert_eq!([bars[0].argument, bars[1].argument], [3.25, 7.25]);
    }
}
