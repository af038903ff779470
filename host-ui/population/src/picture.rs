//! A histogram as SVG, with published values as lines.

use crate::error::PopulationError;
use crate::figures::Distribution;
use crate::published::Published;
use plotters::prelude::*;

const SIZE: (u32, u32) = (560, 300);
const BLUE: RGBColor = RGBColor(0, 114, 178);
const ORANGE: RGBColor = RGBColor(213, 94, 0);
const INK: RGBColor = RGBColor(70, 70, 70);
const FAINT: RGBColor = RGBColor(225, 225, 225);
const FONT: &str = "sans-serif";
const MOST_BINS: usize = 40;
/// Percentile beyond which values count in the last bar, so that one outlier does not compress all
/// others into one.
const LAST_PERCENTILE: f64 = 99.5;

type Drawn = Result<(), Box<dyn std::error::Error>>;

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
        let most = d.percentile(LAST_PERCENTILE).unwrap_or(1.0);
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

/// Returns the histogram; published values in orange, in the order of their numbers in the caption.
pub fn histogram(d: &Distribution, published: &[&Published]) -> Result<(String, usize), PopulationError> {
    let bars = Bars::of(d, published);
    let mut text = String::new();
    draw(&mut text, d, published, &bars).map_err(|e| PopulationError::Picture(e.to_string()))?;
    Ok((text, bars.beyond))
}

fn draw(text: &mut String, d: &Distribution, published: &[&Published], bars: &Bars) -> Drawn {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    let [low, high] = bars.axis;
    let share = |count: usize| 100.0 * count as f64 / d.values.len() as f64;
    let highest = bars.counts.iter().copied().map(share).fold(0.0, f64::max) * 1.18;
    let mut chart = ChartBuilder::on(&root)
        .margin(8)
        .margin_right(16)
        .x_label_area_size(44)
        .y_label_area_size(52)
        .build_cartesian_2d(low..high, 0.0..highest)?;
    let digits = usize::from(high - low < 4.0);
    chart
        .configure_mesh()
        .x_desc(format!("{} ({})", d.name, d.unit))
        .y_desc(format!("{}s (%)", d.each))
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .x_labels(8)
        .y_labels(5)
        .x_label_formatter(&|x| format!("{:.*}", digits, x + 0.0))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .label_style((FONT, 13).into_font().color(&INK))
        .axis_desc_style((FONT, 14).into_font().color(&INK))
        .draw()?;
    let gap = 0.04 * bars.width;
    chart.draw_series(bars.counts.iter().enumerate().map(|(n, &count)| {
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
        let style = (FONT, 15).into_font().color(&ORANGE);
        let half_a_letter = 0.008 * (high - low);
        chart.draw_series([Text::new(
            (n + 1).to_string(),
            (p.value - half_a_letter, highest * 0.985),
            style,
        )])?;
    }
    root.present()?;
    Ok(())
}
