//! A histogram as SVG, or the values themselves where they are few, with published values as lines.

use crate::figures::{Distribution, MANY};
use crate::published::Published;
use plotters::prelude::*;
use stylet_report::picture::{BLUE, Canvas, DrawError, Drawn, INK, ORANGE, axes, drawn, label};

const SIZE: (u32, u32) = (560, 300);
const MOST_BINS: usize = 40;
/// Percentile beyond which values count in the last bar, so that one outlier does not compress all
/// others into one.
const LAST_PERCENTILE: f64 = 99.5;

/// Edges of equal bars from below the smallest value to above nearly all.
struct Bars {
    from: f64,
    width: f64,
    counts: Vec<usize>,
    /// Number of values beyond the last bar, which are counted in it.
    beyond: usize,
    /// Both ends of the axis.
    axis: [f64; 2],
}

impl Bars {
    fn of(d: &Distribution, published: &[&Published]) -> Self {
        let least = d.percentile(0.0).unwrap_or(0.0);
        let last = if d.values.len() < MANY { 100.0 } else { LAST_PERCENTILE };
        let most = d.percentile(last).unwrap_or(1.0);
        // Published values widen the axis, not the bars.
        let drawn = |limit: f64, choose: fn(f64, f64) -> f64| published.iter().map(|p| p.value).fold(limit, choose);
        let wanted = ((d.values.len() as f64).sqrt() as usize).clamp(8, MOST_BINS);
        let width = round_width((most - least).max(1e-6 * most.abs().max(1e-6)) / wanted as f64);
        let from = (least / width).floor() * width;
        let count = ((most - from) / width).floor() as usize + 1;
        let room = 2.0 * width;
        let low = drawn(from, f64::min);
        let to = from + width * count as f64;
        let high = drawn(to, f64::max);
        let axis = [
            if low < from { low - room } else { from },
            if high > to { high + room } else { to },
        ];
        let mut counts = vec![0; count];
        let mut beyond = 0;
        for &value in &d.values {
            let bar = ((value - from) / width).max(0.0) as usize;
            beyond += usize::from(bar >= count);
            counts[bar.min(count - 1)] += 1;
        }
        Self {
            from,
            width,
            counts,
            beyond,
            axis,
        }
    }
}

/// Returns 1, 2 or 5 times a power of ten, at least `width`.
fn round_width(width: f64) -> f64 {
    let power = 10.0_f64.powf(width.log10().floor());
    let times = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|t| t * power >= width * (1.0 - 1e-9));
    times.unwrap_or(10.0) * power
}

/// Returns the picture; published values in orange, in the order of their numbers in the caption.
pub fn distribution(d: &Distribution, published: &[&Published]) -> Result<(String, usize), DrawError> {
    let bars = Bars::of(d, published);
    let svg = drawn(SIZE, |root| draw(root, d, published, &bars))?;
    Ok((svg, if d.values.len() < MANY { 0 } else { bars.beyond }))
}

fn draw(root: &Canvas, d: &Distribution, published: &[&Published], bars: &Bars) -> Drawn {
    let [low, high] = bars.axis;
    let share = |count: usize| 100.0 * count as f64 / d.values.len() as f64;
    let is_few = d.values.len() < MANY;
    let highest = match is_few {
        true => d.values.len() as f64 + 1.0,
        false => bars.counts.iter().copied().map(share).fold(0.0, f64::max) * 1.18,
    };
    let mut chart = ChartBuilder::on(root)
        .margin(8)
        .margin_right(16)
        .x_label_area_size(44)
        .y_label_area_size(52)
        .build_cartesian_2d(low..high, 0.0..highest)?;
    // So many that neighbouring labels differ.
    let digits = (-((high - low) / 8.0).log10()).ceil().clamp(0.0, 6.0) as usize;
    let of_y = if is_few { "s, in order" } else { "s (%)" };
    let names = [&format!("{} ({})", d.name, d.unit), &format!("{}{of_y}", d.each)];
    let of_x = |x: &f64| format!("{:.*}", digits, x + 0.0);
    axes(&mut chart, names.map(String::as_str), |mesh| {
        mesh.disable_x_mesh()
            .x_labels(8)
            .y_labels(5)
            .x_label_formatter(&of_x)
            .y_label_formatter(&|y| format!("{y:.0}"));
    })?;
    if is_few {
        let places = d.values.iter().enumerate().map(|(n, &value)| (value, (n + 1) as f64));
        chart.draw_series(places.map(|place| Circle::new(place, 4, BLUE.filled())))?;
    }
    let gap = 0.04 * bars.width;
    let counts: &[usize] = if is_few { &[] } else { &bars.counts };
    chart.draw_series(counts.iter().enumerate().map(|(n, &count)| {
        let left = bars.from + n as f64 * bars.width;
        Rectangle::new(
            [(left + gap, 0.0), (left + bars.width - gap, share(count))],
            BLUE.mix(0.75).filled(),
        )
    }))?;
    if let Some(median) = d.percentile(50.0) {
        chart.draw_series([PathElement::new(
            [(median, 0.0), (median, highest)],
            INK.stroke_width(2),
        )])?;
    }
    for (n, p) in published.iter().enumerate() {
        let line = [(p.value, 0.0), (p.value, highest * 0.9)];
        chart.draw_series(DashedLineSeries::new(line, 6, 4, ORANGE.stroke_width(2)))?;
        let style = label(15).color(&ORANGE);
        let half_a_letter = 0.008 * (high - low);
        chart.draw_series([Text::new(
            (n + 1).to_string(),
            (p.value - half_a_letter, highest * 0.985),
            style,
        )])?;
    }
    Ok(())
}
