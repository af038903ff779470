//! Pictures of dose-volume histograms and of distributions, as SVG.

use super::Dvh;
use super::error::DoseError;
use plotters::prelude::*;
use std::path::Path;

const SIZE: (u32, u32) = (900, 560);
/// Colours of Okabe-Ito, without its yellow, which is invisible on white.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
const STEPS: usize = 400;

/// Draws cumulative histograms up to three times the prescription, which is marked.
pub fn dvh(path: &Path, curves: &[(&str, &Dvh)], prescription_gy: f64) -> Result<(), DoseError> {
    let most_gy = 3.0 * prescription_gy;
    let lines: Vec<(String, Vec<(f64, f64)>)> = curves
        .iter()
        .map(|(name, dvh)| {
            let share = |gy: f64| dvh.at_least_m3(gy) / dvh.volume_m3() * 100.0;
            let at = |i: usize| i as f64 * most_gy / STEPS as f64;
            ((*name).to_owned(), (0..=STEPS).map(|i| (at(i), share(at(i)))).collect())
        })
        .collect();
    let picture = draw(&lines, prescription_gy, most_gy).map_err(|e| DoseError::Picture {
        path: path.to_owned(),
        why: e.to_string(),
    })?;
    Ok(stylet_base::write_whole(path, picture.as_bytes())?)
}

fn draw(
    lines: &[(String, Vec<(f64, f64)>)],
    prescription_gy: f64,
    most_gy: f64,
) -> Result<String, Box<dyn std::error::Error>> {
    let mut picture = String::new();
    let root = SVGBackend::with_string(&mut picture, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(20)
        .x_label_area_size(50)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..most_gy, 0.0..105.0)?;
    chart
        .configure_mesh()
        .x_desc("Dose (Gy)")
        .y_desc("Volume with at least this dose (%)")
        .light_line_style(TRANSPARENT)
        .label_style(("sans-serif", 16))
        .axis_desc_style(("sans-serif", 18))
        .draw()?;
    let grey = RGBColor(110, 110, 110);
    for share in [1.0, 1.5, 2.0] {
        let gy = share * prescription_gy;
        chart.draw_series(DashedLineSeries::new([(gy, 0.0), (gy, 100.0)], 4, 4, grey.into()))?;
        let label = format!("{:.0} %", share * 100.0);
        chart.draw_series([Text::new(
            label,
            (gy, 104.0),
            ("sans-serif", 15).into_font().color(&grey),
        )])?;
    }
    for (i, (name, points)) in lines.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(points.iter().copied(), style))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .margin(14)
        .legend_area_size(30)
        .background_style(WHITE)
        .border_style(RGBColor(180, 180, 180))
        .label_font(("sans-serif", 16))
        .draw()?;
    root.present()?;
    drop(chart);
    drop(root);
    Ok(picture)
}
