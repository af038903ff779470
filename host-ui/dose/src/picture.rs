//! Pictures of dose-volume histograms, as SVG.

use super::Dvh;
use plotters::prelude::*;
use stylet_report::picture::{COLOURS, DrawError, FAINT, INK, axes, drawn, label};

const STEPS: usize = 400;

/// One structure of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Curve<'a> {
    /// Name of the structure.
    pub name: &'a str,
    /// The histogram that is drawn through.
    pub dvh: &'a Dvh,
    /// The histogram that is drawn dashed: the dose as planned.
    pub planned: Option<&'a Dvh>,
}

fn places(dvh: &Dvh, most_gy: f64) -> impl Iterator<Item = (f64, f64)> + Clone {
    let at = move |i: usize| i as f64 * most_gy / STEPS as f64;
    (0..=STEPS).map(move |i| (at(i), dvh.at_least_m3(at(i)) / dvh.volume_m3() * 100.0))
}

/// Draws cumulative histograms up to three times the prescription, of which 100, 150 and 200 % are marked.
///
/// # Errors
/// Where the picture cannot be drawn.
pub fn dvh(size: (u32, u32), curves: &[Curve], prescription_gy: f64) -> Result<String, DrawError> {
    let most_gy = 3.0 * prescription_gy;
    drawn(size, |root| {
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(root)
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(56)
            .build_cartesian_2d(0.0..most_gy, 0.0..105.0)?;
        axes(&mut chart, ["Dose (Gy)", "Volume with at least this dose (%)"], |_| ())?;
        for share in [1.0, 1.5, 2.0] {
            let gy = share * prescription_gy;
            chart.draw_series(DashedLineSeries::new([(gy, 0.0), (gy, 100.0)], 3, 3, INK.into()))?;
            chart.draw_series([Text::new(format!("{:.0} %", share * 100.0), (gy, 104.0), label(13))])?;
        }
        for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
            let style = colour.stroke_width(2);
            if let Some(planned) = curve.planned {
                chart.draw_series(DashedLineSeries::new(places(planned, most_gy), 6, 4, style))?;
            }
            chart
                .draw_series(LineSeries::new(places(curve.dvh, most_gy), style))?
                .label(curve.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 22, y)], colour.stroke_width(3)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .margin(12)
            .legend_area_size(30)
            .background_style(WHITE)
            .border_style(FAINT)
            .label_font(label(15))
            .draw()?;
        Ok(())
    })
}
