//! Limits of the verdict in the pictures.

use super::{Decades, label};
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use stylet_report::picture::{Canvas, Drawn};

/// Largest time for a share of all ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    pub name: &'static str,
    /// Share of ticks that may take longer; 0 for a maximum.
    pub share: f64,
    pub us: f64,
}

impl Limit {
    /// Returns a limit of the maximum.
    pub fn worst(us: f64) -> Self {
        Self {
            name: "max",
            share: 0.0,
            us,
        }
    }
}

type Chart<'a, 'b, X> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, Decades>>;

/// Draws each limit up to `right_us` as a dashed line between two heights, with its name at the upper end.
pub fn lines<X: Ranged<ValueType = f64>>(
    root: &Canvas,
    chart: &mut Chart<'_, '_, X>,
    limits: &[Limit],
    right_us: f64,
    [bottom, top]: [f64; 2],
    color: RGBColor,
) -> Drawn {
    let in_range = limits.iter().filter(|limit| limit.us <= right_us);
    for (limit, row) in in_range.zip(0..) {
        dashed(chart, [(limit.us, bottom), (limit.us, top)], color)?;
        let (x, y) = chart.backend_coord(&(limit.us, top));
        // Names of limits close together are below each other.
        name(root, limit, (x + 4, y + 6 + 13 * row), color)?;
    }
    Ok(())
}

/// Draws each limit of a cumulative tail as a line that the curve has to pass below.
pub fn gates<X: Ranged<ValueType = f64>>(
    root: &Canvas,
    chart: &mut Chart<'_, '_, X>,
    limits: &[Limit],
    least: f64,
    color: RGBColor,
) -> Drawn {
    // Of limits of one time the strictest holds.
    let is_strictest = |limit: &&Limit| !limits.iter().any(|o| o.us == limit.us && o.share < limit.share);
    for limit in limits.iter().filter(is_strictest) {
        let low = limit.share.max(least);
        dashed(chart, [(limit.us, low), (limit.us, 1.0)], color)?;
        let (x, y) = chart.backend_coord(&(limit.us, low));
        let below = if limit.share > least { 6 } else { -6 };
        name(root, limit, (x + 4, y + below), color)?;
    }
    Ok(())
}

/// Draws a limit of the worst as a level up to `right`.
pub fn level<X: Ranged<ValueType = f64>>(
    root: &Canvas,
    chart: &mut Chart<'_, '_, X>,
    limit_us: f64,
    right: f64,
    color: RGBColor,
) -> Drawn {
    dashed(chart, [(0.0, limit_us), (right, limit_us)], color)?;
    let (x, y) = chart.backend_coord(&(0.0, limit_us));
    name(root, &Limit::worst(limit_us), (x + 3, y - 7), color)
}

fn dashed<X: Ranged<ValueType = f64>>(
    chart: &mut Chart<'_, '_, X>,
    [from, to]: [(f64, f64); 2],
    color: RGBColor,
) -> Drawn {
    let line = DashedLineSeries::new([from, to], 4, 3, color.mix(0.8).stroke_width(1));
    chart.draw_series(line)?;
    Ok(())
}

fn name(root: &Canvas, limit: &Limit, at: (i32, i32), color: RGBColor) -> Drawn {
    let style = label(11).color(&color).pos(Pos::new(HPos::Left, VPos::Center));
    Ok(root.draw(&Text::new(
        format!("{} \u{2264} {}", limit.name, super::number(limit.us)),
        at,
        style,
    ))?)
}
