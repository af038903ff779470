//! The pictures of a report, as SVG.

mod limits;
mod maxima;
mod osadl;
mod trend;

pub use limits::Limit;
pub use maxima::{MaximaPart, maxima};
pub use osadl::osadl;
pub use trend::{TrendPoint, trend, trend_range_us};

use crate::report::WindowRow;
use hdrhistogram::Histogram;
use plotters::coord::ranged1d::{KeyPointHint, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
pub use stylet_report::picture::{BLUE, DrawError, INK, ORANGE};
use stylet_report::picture::{Canvas, Drawn, axes, drawn, label};

const SIZE: (u32, u32) = (560, 300);

fn picture(draw: impl FnOnce(&Canvas) -> Drawn) -> Result<String, DrawError> {
    drawn(SIZE, draw)
}

/// Writes a number short, without trailing zeros: 0.1, 20, 5000.
fn number(value: f64) -> String {
    let text = if value >= 10.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.3}")
    };
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Formats a fraction of samples as a percentage or, when small, as one in N.
fn share(value: f64) -> String {
    if value >= 0.01 {
        format!("{} %", number(value * 100.0))
    } else {
        format!("1e{:.0}", value.log10())
    }
}

/// A logarithmic axis with key points only at powers of ten.
#[derive(Clone)]
struct Decades(std::ops::Range<f64>, fn(f64) -> String);

impl Ranged for Decades {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let place = (value.max(self.0.start) / self.0.start).ln() / (self.0.end / self.0.start).ln();
        limit.0 + (place * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if !matches!(
            hint.weight(),
            plotters::coord::ranged1d::KeyPointWeight::Bold | plotters::coord::ranged1d::KeyPointWeight::Any
        ) {
            return Vec::new();
        }
        let (first, last) = (self.0.start.log10().ceil() as i32, self.0.end.log10().floor() as i32);
        (first..=last).map(|p| 10_f64.powi(p)).collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for Decades {
    fn format(value: &f64) -> String {
        number(*value)
    }

    fn format_ext(&self, value: &f64) -> String {
        (self.1)(*value)
    }
}

/// Returns the next power of ten, rounding up.
fn decade_above(value: f64) -> f64 {
    10_f64.powi(value.max(1e-9).log10().ceil() as i32)
}

/// A series of a picture: its histogram and how it is drawn.
pub struct Series<'a> {
    pub name: &'a str,
    pub color: RGBColor,
    pub histogram: &'a Histogram<u64>,
    pub limits: Vec<Limit>,
}

/// Plots the histogram of the wake-up latency: linear microseconds, logarithmic count. The legend gives the number past
/// the right edge.
pub fn wake_histogram(series: &[Series]) -> Result<String, DrawError> {
    picture(|root| {
        // Wide enough for the body; a long tail would squeeze it into a line, and has another picture.
        let at = |s: &Series, q| s.histogram.value_at_quantile(q) as f64 / 1e3;
        let wide = |s: &Series| (at(s, 0.999) * 1.25).min(at(s, 0.99) * 4.0);
        let right = series.iter().map(wide).fold(1.0, f64::max);
        let bin_us = (right / 100.0).max(0.05);
        let right = bin_us * 100.0;
        let counted: Vec<Vec<u64>> = series.iter().map(|s| bins(s.histogram, bin_us, 100)).collect();
        let top = counted.iter().flatten().copied().max().unwrap_or(1).max(1) as f64;
        let high = decade_above(top);
        // Legend and names of limits have the highest decade to themselves.
        let mut chart = chart(root, 58).build_cartesian_2d(0.0..right, Decades(0.5..10.0 * high, number))?;
        mesh(&mut chart, "wake-up latency, \u{b5}s", "ticks in a bin")?;
        for s in series {
            limits::lines(root, &mut chart, &s.limits, right, [0.5, 4.0 * high], s.color)?;
        }
        for (s, counts) in series.iter().zip(&counted) {
            let style = s.color.mix(0.75).filled();
            chart.draw_series(counts.iter().enumerate().filter(|(_, n)| **n > 0).map(|(i, &n)| {
                let (from, to) = (i as f64 * bin_us, (i + 1) as f64 * bin_us);
                if s.color == BLUE {
                    Rectangle::new([(from, 0.5), (to, n as f64)], style)
                } else {
                    // A line across the top, so that the background stays visible.
                    Rectangle::new([(from, n as f64 * 0.88), (to, n as f64)], style)
                }
            }))?;
        }
        legend(
            root,
            &series.iter().map(|s| (beyond(s, right), s.color)).collect::<Vec<_>>(),
        )
    })
}

fn bins(histogram: &Histogram<u64>, bin_us: f64, count: usize) -> Vec<u64> {
    let mut all = vec![0; count];
    for value in histogram.iter_recorded() {
        let index = (value.value_iterated_to() as f64 / 1e3 / bin_us) as usize;
        if let Some(bin) = all.get_mut(index) {
            *bin += value.count_at_value();
        }
    }
    all
}

fn beyond(series: &Series, right_us: f64) -> String {
    let h = series.histogram;
    let past = h.len() - h.count_between(0, (right_us * 1e3) as u64);
    match past {
        0 => series.name.to_owned(),
        n => format!("{}, {n} later than {right_us:.0} \u{b5}s", series.name),
    }
}

/// Plots the parts of a tick's time: for each stage a bar from p50 to p99.9 and a point at the maximum.
pub fn stages(rows: &[(String, Histogram<u64>)]) -> Result<String, DrawError> {
    picture(|root| {
        let us = |ns: u64| (ns as f64 / 1e3).max(0.01);
        let longest = rows.iter().map(|(_, h)| us(h.max())).fold(0.1, f64::max);
        let count = rows.len() as f64;
        let mut chart =
            chart(root, 128).build_cartesian_2d(Decades(0.01..decade_above(longest), number), 0.0..count)?;
        axes(&mut chart, ["microseconds: bar p50 to p99.9, point max", ""], |mesh| {
            mesh.disable_y_mesh().disable_y_axis();
        })?;
        for (row, (name, h)) in rows.iter().enumerate() {
            let y = count - row as f64 - 0.5;
            let [p50, p999] = [0.5, 0.999].map(|q| us(h.value_at_quantile(q)));
            let color = if name == "whole tick" { ORANGE } else { BLUE };
            chart.draw_series([PathElement::new(
                [(p50, y), (us(h.max()), y)],
                color.mix(0.35).stroke_width(1),
            )])?;
            chart.draw_series([Rectangle::new(
                [(p50, y - 0.18), (p999.max(p50 * 1.03), y + 0.18)],
                color.filled(),
            )])?;
            chart.draw_series([Circle::new((us(h.max()), y), 3, color.filled())])?;
            let (_, at) = chart.backend_coord(&(0.01, y));
            let style = label(12).pos(Pos::new(HPos::Right, VPos::Center));
            root.draw(&Text::new(name.clone(), (128, at), style))?;
        }
        Ok(())
    })
}

/// Plots the worst wake-up and the longest tick of each window of the run, the windows with missed deadlines, and the
/// limit of the worst wake-up.
pub fn windows(windows: &[WindowRow], window_s: f64, limit_us: f64) -> Result<String, DrawError> {
    picture(|root| {
        let right = windows.last().map_or(1.0, |w| w.at_s + window_s);
        let us = |us: f64| us.max(0.1);
        let all = || windows.iter().flat_map(|w| [us(w.worst_wake_us), us(w.worst_work_us)]);
        let low = all().fold(f64::MAX, f64::min).min(1.0).log10().floor();
        let high = all().fold(limit_us.max(1.0), f64::max);
        let mut chart = chart(root, 58)
            // The legend has the highest decade to itself.
            .build_cartesian_2d(0.0..right, Decades(10_f64.powf(low)..10.0 * decade_above(high), number))?;
        mesh(&mut chart, "time into the run, s", "worst in a window, \u{b5}s")?;
        for (color, of) in [
            (BLUE, (|w| w.worst_wake_us) as fn(&WindowRow) -> f64),
            (ORANGE, |w| w.worst_work_us),
        ] {
            let line = windows.iter().map(|w| (w.at_s + window_s / 2.0, us(of(w))));
            chart.draw_series(LineSeries::new(line, color.stroke_width(1)))?;
        }
        limits::level(root, &mut chart, limit_us, right, BLUE)?;
        let missed = windows.iter().filter(|w| w.missed > 0);
        let place = |w: &WindowRow| (w.at_s + window_s / 2.0, us(w.worst_wake_us));
        chart.draw_series(missed.map(|w| Cross::new(place(w), 4, INK.stroke_width(2))))?;
        let count: u64 = windows.iter().map(|w| u64::from(w.missed)).sum();
        let entries = [
            ("wake-up".to_owned(), BLUE),
            ("whole tick".to_owned(), ORANGE),
            (format!("\u{d7} missed deadlines: {count}"), INK),
        ];
        legend(root, &entries)
    })
}

/// Plots the fraction of ticks later than each latency, both axes logarithmic.
pub fn tail(series: &[Series]) -> Result<String, DrawError> {
    picture(|root| {
        let longest = series.iter().map(|s| s.histogram.max()).max().unwrap_or(1) as f64 / 1e3;
        let limits = series.iter().flat_map(|s| &s.limits).map(|limit| limit.us);
        let longest = limits.fold(longest, f64::max);
        let shortest = series.iter().map(|s| s.histogram.min()).min().unwrap_or(0) as f64 / 1e3;
        let left = 10_f64.powi(shortest.max(0.1).log10().floor() as i32);
        let most = series.iter().map(|s| s.histogram.len()).max().unwrap_or(1).max(10) as f64;
        let least = 10_f64.powi((0.5 / most).log10().floor() as i32);
        let mut chart = chart(root, 58).build_cartesian_2d(
            Decades(left..decade_above(longest.max(left * 10.0)), number),
            Decades(least..1.0, share),
        )?;
        mesh(&mut chart, "microseconds", "share of ticks above")?;
        for s in series {
            limits::gates(root, &mut chart, &s.limits, least, s.color)?;
            chart.draw_series(LineSeries::new(above(s.histogram), s.color.stroke_width(2)))?;
        }
        let entries: Vec<_> = series.iter().map(|s| (s.name.to_owned(), s.color)).collect();
        legend_at_left(root, &entries)
    })
}

/// Returns latencies in microseconds and the fraction of samples above them.
fn above(histogram: &Histogram<u64>) -> Vec<(f64, f64)> {
    let count = histogram.len() as f64;
    let mut left = count;
    let mut line = Vec::new();
    for value in histogram.iter_recorded() {
        let us = (value.value_iterated_to() as f64 / 1e3).max(0.1);
        line.push((us, left / count));
        left -= value.count_at_value() as f64;
    }
    line
}

/// Returns a chart with the usual margins; `left` is the width of the labels at its left.
fn chart<'a, 'b>(root: &'a Canvas<'b>, left: i32) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut chart = ChartBuilder::on(root);
    chart.margin(10).margin_right(22);
    chart
        .set_label_area_size(LabelAreaPosition::Left, left)
        .set_label_area_size(LabelAreaPosition::Bottom, 40);
    chart
}

/// Draws axes whose x labels have as few decimals as possible.
fn mesh<X, Y>(chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, Y>>, x: &str, y: &str) -> Drawn
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    axes(chart, [x, y], |mesh| {
        mesh.x_labels(6).x_label_formatter(&|v| number(*v));
    })
}

/// Draws a legend in the upper right corner.
fn legend(root: &Canvas, entries: &[(String, RGBColor)]) -> Drawn {
    let right = root.dim_in_pixel().0 as i32 - 30;
    for (i, (name, color)) in entries.iter().enumerate() {
        let y = 22 + 18 * i as i32;
        root.draw(&Rectangle::new([(right - 10, y - 5), (right, y + 5)], color.filled()))?;
        let style = label(12).pos(Pos::new(HPos::Right, VPos::Center));
        root.draw(&Text::new(name.clone(), (right - 16, y), style))?;
    }
    Ok(())
}

/// Draws a legend in the lower left corner, which a tail leaves empty.
fn legend_at_left(root: &Canvas, entries: &[(String, RGBColor)]) -> Drawn {
    for (i, (name, color)) in entries.iter().rev().enumerate() {
        let y = SIZE.1 as i32 - 66 - 18 * i as i32;
        root.draw(&Rectangle::new([(82, y - 5), (92, y + 5)], color.filled()))?;
        let style = label(12).pos(Pos::new(HPos::Left, VPos::Center));
        root.draw(&Text::new(name.clone(), (98, y), style))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::histogram;

    #[test]
    fn bins_and_tail_keep_every_sample() {
        let mut h = histogram();
        for us in 1..=1000_u64 {
            h.record(us * 1_000).expect("in range");
        }
        assert_eq!(bins(&h, 10.0, 101).iter().sum::<u64>(), 1000);
        let line = above(&h);
        assert!((line[0].1 - 1.0).abs() < 1e-12);
        // 500 of 1000 are at 501 us or above.
        let half = line.iter().find(|(us, _)| *us > 500.6).expect("in the line");
        assert!((half.1 - 0.5).abs() < 2e-3, "{half:?}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.1, 1.0, 25.0, 5000.0].map(number), ["0.1", "1", "25", "5000"]);
        assert_eq!([1.0, 0.01, 1e-4].map(share), ["100 %", "1 %", "1e-4"]);
    }
}
