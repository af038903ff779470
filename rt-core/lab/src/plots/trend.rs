//! The wake-ups of one PC over its reports.

use super::{Decades, decade_above, number};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use stylet_report::picture::{BLUE, DrawError, ORANGE, axes, drawn, label};

const SIZE: (u32, u32) = (400, 220);

/// One report of a trend.
pub struct TrendPoint {
    /// Seconds since an epoch.
    pub time_s: f64,
    pub p50_us: Option<f64>,
    pub tail_us: Option<f64>,
    /// 95 % interval of the tail.
    pub interval_us: Option<[f64; 2]>,
    pub passed: bool,
}

impl TrendPoint {
    fn values(&self) -> impl Iterator<Item = f64> {
        let [low, high] = self.interval_us.map_or([None, None], |ends| ends.map(Some));
        [self.p50_us, self.tail_us, low, high].into_iter().flatten()
    }
}

/// Powers of ten around all points, so that pictures of several PCs share one scale.
pub fn trend_range_us<'a>(points: impl Iterator<Item = &'a TrendPoint>) -> [f64; 2] {
    let fold = |[low, high]: [f64; 2], us: f64| [low.min(us), high.max(us)];
    let [low, high] = points.flat_map(TrendPoint::values).fold([9.0, 50.0], fold);
    [10_f64.powf(low.max(0.1).log10().floor()), decade_above(high * 1.8)]
}

/// Returns the unit in which a length of time is a short number.
fn unit(seconds: f64) -> (f64, &'static str) {
    let units = [(86_400.0, "days"), (3_600.0, "hours"), (60.0, "minutes")];
    units
        .into_iter()
        .find(|(length, _)| seconds >= 2.0 * length)
        .unwrap_or((1.0, "seconds"))
}

/// Plots p50 and the tail, named `tail`, over time; a bar is the 95 % interval, a filled point a report that passed.
pub fn trend(points: &[TrendPoint], tail: &str, range_us: [f64; 2]) -> Result<String, DrawError> {
    drawn(SIZE, |root| {
        let first_s = points.iter().map(|p| p.time_s).fold(f64::MAX, f64::min);
        let span_s = (points.iter().map(|p| p.time_s).fold(first_s, f64::max) - first_s).max(1.0);
        let (unit_s, unit_name) = unit(span_s);
        let span = span_s / unit_s;
        let x = |p: &TrendPoint| (p.time_s - first_s) / unit_s;
        let mut chart = ChartBuilder::on(root)
            .margin(8)
            .margin_right(18)
            .set_label_area_size(LabelAreaPosition::Left, 46)
            .set_label_area_size(LabelAreaPosition::Bottom, 36)
            .build_cartesian_2d(-0.03 * span..span * 1.03, Decades(range_us[0]..range_us[1], number))?;
        let names = [&format!("{unit_name} since the first report"), "\u{b5}s"];
        axes(&mut chart, names, |mesh| {
            mesh.disable_x_mesh()
                .x_labels(5)
                .x_label_formatter(&|v| number(v.max(0.0)));
        })?;
        let line = |of: fn(&TrendPoint) -> Option<f64>| -> Vec<(f64, f64)> {
            points.iter().filter_map(|p| of(p).map(|us| (x(p), us))).collect()
        };
        let (p50, late) = (line(|p| p.p50_us), line(|p| p.tail_us));
        for (values, color) in [(&p50, BLUE), (&late, ORANGE)] {
            chart.draw_series(LineSeries::new(values.iter().copied(), color.stroke_width(2)))?;
        }
        for p in points {
            let x = x(p);
            if let Some([from, to]) = p.interval_us {
                chart.draw_series([PathElement::new([(x, from), (x, to)], ORANGE.mix(0.6).stroke_width(3))])?;
            }
            if let Some(us) = p.tail_us {
                let style = if p.passed { ORANGE.filled() } else { WHITE.filled() };
                chart.draw_series([Circle::new((x, us), 4, style)])?;
                chart.draw_series([Circle::new((x, us), 4, ORANGE.stroke_width(2))])?;
            }
        }
        // The names are below and above the first points.
        for (values, name, side, factor) in [(&p50, "p50", VPos::Top, 0.8), (&late, tail, VPos::Bottom, 1.25)] {
            if let Some(&(x, us)) = values.first() {
                let style = label(12).pos(Pos::new(HPos::Left, side));
                chart.draw_series([Text::new(name.to_owned(), (x, us * factor), style)])?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_short_numbers_and_all_pictures_have_one_scale() {
        assert_eq!(
            [30.0, 600.0, 9_000.0, 2e6].map(|s| unit(s).1),
            ["seconds", "minutes", "hours", "days"]
        );
        let point = |tail_us| TrendPoint {
            time_s: 0.0,
            p50_us: Some(12.0),
            tail_us: Some(tail_us),
            interval_us: None,
            passed: true,
        };
        assert_eq!(trend_range_us([point(20.0), point(800.0)].iter()), [1.0, 10_000.0]);
    }
}
