//! The trade-off as a picture: time of a tick against error, one panel for each spacing, with its Pareto front.

use crate::models::Family;
use crate::table::{Point, pareto};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::ops::Range;
use std::path::Path;

const SIZE: (u32, u32) = (1320, 620);
const TITLE: u32 = 52;
const LEGEND: u32 = 64;
const TEXT: RGBColor = RGBColor(40, 44, 52);
const GRID: RGBColor = RGBColor(225, 228, 232);
const FONT: &str = "sans-serif";

/// Returns Okabe and Ito's colours, which the colour-blind can distinguish; each with another shape.
fn colour(family: Family) -> RGBColor {
    match family {
        Family::Sweeps => RGBColor(0, 114, 178),
        Family::Relaxed => RGBColor(0, 158, 115),
        Family::Fem => RGBColor(213, 94, 0),
        Family::FemDouble => RGBColor(204, 121, 167),
    }
}

fn mark<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    family: Family,
    (x, y): (i32, i32),
) -> Result<(), Box<dyn Error>>
where
    DB::ErrorType: 'static,
{
    let style = colour(family).filled();
    let polygon =
        |corners: &[(i32, i32)]| Polygon::new(corners.iter().map(|(a, b)| (x + a, y + b)).collect::<Vec<_>>(), style);
    match family {
        Family::Sweeps => area.draw(&Circle::new((x, y), 5, style))?,
        Family::Relaxed => area.draw(&Rectangle::new([(x - 5, y - 5), (x + 5, y + 5)], style))?,
        Family::Fem => area.draw(&polygon(&[(0, -7), (7, 0), (0, 7), (-7, 0)]))?,
        Family::FemDouble => area.draw(&polygon(&[
            (0, -7),
            (2, -2),
            (7, 0),
            (2, 2),
            (0, 7),
            (-2, 2),
            (-7, 0),
            (-2, -2),
        ]))?,
    }
    Ok(())
}

pub fn draw(points: &[Point], path: &Path) -> Result<(), Box<dyn Error>> {
    let mut svg = String::new();
    draw_into(&mut svg, points)?;
    // As wide as its window, at most as drawn: a fixed size would scroll sideways in a narrow one.
    let fixed = format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1);
    let fitted = format!("style=\"width:100%;max-width:{}px;height:auto\"", SIZE.0);
    std::fs::write(path, svg.replacen(&fixed, &fitted, 1))?;
    Ok(())
}

fn draw_into(svg: &mut String, points: &[Point]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (title, rest) = root.split_vertically(TITLE);
    let (panels, legend) = rest.split_vertically(SIZE.1 - TITLE - LEGEND);
    let bold = (FONT, 22).into_font().color(&TEXT);
    title.draw(&Text::new(
        "Time of a tick against error, insertions that nothing was fitted to",
        (24, 18),
        bold,
    ))?;
    let mut spacings: Vec<f64> = points.iter().map(|p| p.spacing_mm).collect();
    spacings.sort_by(|a, b| b.total_cmp(a));
    spacings.dedup();
    let ranges = Ranges::of(points);
    for (area, spacing_mm) in panels.split_evenly((1, spacings.len())).iter().zip(spacings) {
        let here: Vec<&Point> = points.iter().filter(|p| p.spacing_mm == spacing_mm).collect();
        panel(area, &here, &ranges)?;
    }
    draw_legend(&legend)?;
    root.present()?;
    Ok(())
}

/// Common to all panels, so that they can be compared by eye.
struct Ranges {
    micros: Range<f64>,
    percent: Range<f64>,
}

impl Ranges {
    fn of(points: &[Point]) -> Ranges {
        let range = |value: fn(&Point) -> f64| {
            let low = points.iter().map(value).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(value).fold(0.0, f64::max);
            0.6 * low..1.6 * high
        };
        Ranges {
            micros: range(|p| p.mean_us),
            percent: range(|p| p.rms_percent.max(1e-4)),
        }
    }
}

fn panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    points: &[&Point],
    ranges: &Ranges,
) -> Result<(), Box<dyn Error>>
where
    DB::ErrorType: 'static,
{
    let caption = format!("{:.2} mm, {} elements", points[0].spacing_mm, points[0].elements);
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .caption(caption, (FONT, 16).into_font().color(&TEXT))
        .x_label_area_size(44)
        .y_label_area_size(62)
        .build_cartesian_2d(ranges.micros.clone().log_scale(), ranges.percent.clone().log_scale())?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(WHITE)
        .axis_style(TEXT)
        .x_desc("mean time of a tick, µs")
        .y_desc("RMS error, % of the tip's travel")
        .label_style((FONT, 13).into_font().color(&TEXT))
        .x_label_formatter(&|us| plain(*us))
        .y_label_formatter(&|percent| plain(*percent))
        .draw()?;
    let at = |p: &Point| (p.mean_us, p.rms_percent.max(1e-4));
    let front = pareto(points).into_iter().map(at);
    chart.draw_series(LineSeries::new(front, RGBColor(150, 155, 165).stroke_width(2)))?;
    // What is off without any model, over the same insertions.
    let Range { start, end } = ranges.micros.clone();
    // At the right end no model is as far off as these.
    let nulls = [
        ("nothing moves", points[0].nothing_moves_percent),
        // Short: to its left are models.
        ("best shift", points[0].best_shift_percent),
    ];
    for (name, percent) in nulls {
        let line = DashedLineSeries::new([(start, percent), (end, percent)], 5, 4, TEXT.stroke_width(1));
        chart.draw_series(line)?;
        let at = (end / 1.15, percent * 1.06);
        let style = (FONT, 12)
            .into_font()
            .color(&TEXT)
            .pos(Pos::new(HPos::Right, VPos::Bottom));
        chart.draw_series([Text::new(name, at, style)])?;
    }
    let plotting = chart.plotting_area();
    for point in points {
        let (x, y) = plotting.map_coordinate(&at(point));
        let (left, top) = area.get_base_pixel();
        mark(area, point.family, (x - left, y - top))?;
    }
    Ok(())
}

fn plain(value: f64) -> String {
    if value >= 1.0 {
        format!("{value:.0}")
    } else {
        format!("{value}")
    }
}

fn draw_legend<DB: DrawingBackend>(area: &DrawingArea<DB, Shift>) -> Result<(), Box<dyn Error>>
where
    DB::ErrorType: 'static,
{
    let style = (FONT, 14).into_font().color(&TEXT);
    // As wide as the name needs.
    let width = |name: &str| 44 + 8 * name.len() as i32;
    let mut x = 40;
    for family in Family::ALL {
        mark(area, family, (x, 24))?;
        area.draw(&Text::new(family.name(), (x + 12, 16), style.clone()))?;
        x += width(family.name());
    }
    area.draw(&PathElement::new(
        [(x - 8, 24), (x + 8, 24)],
        RGBColor(150, 155, 165).stroke_width(2),
    ))?;
    area.draw(&Text::new("Pareto front", (x + 14, 16), style))?;
    Ok(())
}
