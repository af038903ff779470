//! The wake-ups of one PC over its reports.

use super::{BLUE, Decades, DrawError, FAINT, ORANGE, decade_above, label, number, picture_of};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (400, 220);

/// One report of a trend.
pub struct TrendPoint {
    /// Days since an epoch.
    pub day: f64,
    pub p50_us: Option<f64>,
    pub p999_us: Option<f64>,
    pub interval_us: Option<[f64; 2]>,
    pub passed: bool,
}

/// p50 and p99.9 over the time; a bar is the 95 % interval, a full point a report that passed.
pub fn trend(points: &[TrendPoint]) -> Result<String, DrawError> {
    picture_of(SIZE, |root| {
        let first = points.iter().map(|p| p.day).fold(f64::MAX, f64::min);
        let days = (points.iter().map(|p| p.day).fold(first, f64::max) - first).max(1.0);
        let all = || {
            points
                .iter()
                .flat_map(|p| [p.p50_us, p.p999_us, p.interval_us.map(|i| i[1])])
                .flatten()
        };
        let low = all().fold(f64::MAX, f64::min).min(10.0).max(0.1).log10().floor();
        let high = decade_above(all().fold(50.0, f64::max) * 1.8);
        let mut chart = ChartBuilder::on(root)
            .margin(8)
            .margin_right(18)
            .set_label_area_size(LabelAreaPosition::Left, 46)
            .set_label_area_size(LabelAreaPosition::Bottom, 36)
            .build_cartesian_2d(-0.03 * days..days * 1.03, Decades(10_f64.powf(low)..high, number))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(FAINT)
            .light_line_style(TRANSPARENT)
            .axis_style(FAINT)
            .x_labels(5)
            .x_desc("days since the first report")
            .y_desc("\u{b5}s")
            .x_label_formatter(&|v| number(v.max(0.0)))
            .label_style(label())
            .draw()?;
        let line = |of: fn(&TrendPoint) -> Option<f64>| -> Vec<(f64, f64)> {
            points
                .iter()
                .filter_map(|p| of(p).map(|us| (p.day - first, us)))
                .collect()
        };
        let (p50, p999) = (line(|p| p.p50_us), line(|p| p.p999_us));
        for (values, color) in [(&p50, BLUE), (&p999, ORANGE)] {
            chart.draw_series(LineSeries::new(values.iter().copied(), color.stroke_width(2)))?;
        }
        for p in points {
            let x = p.day - first;
            if let Some([from, to]) = p.interval_us {
                chart.draw_series([PathElement::new([(x, from), (x, to)], ORANGE.mix(0.6).stroke_width(3))])?;
            }
            if let Some(us) = p.p999_us {
                let style = if p.passed { ORANGE.filled() } else { WHITE.filled() };
                chart.draw_series([Circle::new((x, us), 4, style)])?;
                chart.draw_series([Circle::new((x, us), 4, ORANGE.stroke_width(2))])?;
            }
        }
        // The names stand above the first points.
        for (values, name) in [(&p50, "p50"), (&p999, "p99.9")] {
            if let Some(&(x, us)) = values.first() {
                let style = label().pos(Pos::new(HPos::Left, VPos::Bottom));
                chart.draw_series([Text::new(name, (x, us * 1.25), style)])?;
            }
        }
        Ok(())
    })
}
