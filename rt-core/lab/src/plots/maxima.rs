//! The worst wake-up of each window over hours, part by part.

use super::{Decades, chart, decade_above, legend, number};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use stylet_report::picture::{BLUE, DrawError, INK, ORANGE, axes, drawn, label};

const SIZE: (u32, u32) = (1_120, 320);

/// One part of a campaign.
pub struct MaximaPart<'a> {
    pub name: &'a str,
    /// Duration of each window, s, with its worst wake-up and longest tick in microseconds.
    pub windows: Vec<(f64, f64, f64)>,
}

/// Returns begin and end of each window in seconds of measurement, without the breaks between sessions.
fn places(parts: &[MaximaPart]) -> Vec<Vec<(f64, f64)>> {
    let mut at = 0.0;
    let mut place = |part: &MaximaPart| {
        let windows = part.windows.iter().map(|window| {
            let begin = at;
            at += window.0;
            (begin, at)
        });
        windows.collect()
    };
    parts.iter().map(&mut place).collect()
}

/// Plots wake-ups and own work, in logarithmic microseconds over hours; lines separate the parts.
pub fn maxima(parts: &[MaximaPart]) -> Result<String, DrawError> {
    drawn(SIZE, |root| {
        let places = places(parts);
        let end_s = places.iter().flatten().map(|(_, end)| *end).fold(1.0, f64::max);
        let (unit_s, unit) = if end_s >= 7_200.0 {
            (3_600.0, "hours")
        } else {
            (60.0, "minutes")
        };
        let all = || parts.iter().flat_map(|p| p.windows.iter().flat_map(|w| [w.1, w.2]));
        let low = all().fold(10.0, f64::min).max(0.1).log10().floor();
        // The legend has the highest decade to itself.
        let high = 10.0 * decade_above(all().fold(10.0, f64::max));
        let mut chart =
            chart(root, 58).build_cartesian_2d(0.0..end_s / unit_s, Decades(10_f64.powf(low)..high, number))?;
        let names = [&format!("{unit} of measurement"), "worst in a window, \u{b5}s"];
        axes(&mut chart, names, |mesh| {
            mesh.disable_x_mesh().x_label_formatter(&|v| number(*v));
        })?;
        for (part, at) in parts.iter().zip(&places) {
            let begin = at.first().map_or(0.0, |(s, _)| s / unit_s);
            if begin > 0.0 {
                chart.draw_series([PathElement::new(
                    [(begin, 10_f64.powf(low)), (begin, high)],
                    INK.mix(0.4).stroke_width(1),
                )])?;
            }
            let style = label(12).pos(Pos::new(HPos::Left, VPos::Bottom));
            chart.draw_series([Text::new(
                part.name.to_owned(),
                (begin + 0.004 * end_s / unit_s, 10_f64.powf(low) * 1.1),
                style,
            )])?;
            for (color, of) in [(BLUE, 1), (ORANGE, 2)] {
                let steps = at.iter().zip(&part.windows).flat_map(|((from, to), w)| {
                    let us = if of == 1 { w.1 } else { w.2 }.max(0.1);
                    [(from / unit_s, us), (to / unit_s, us)]
                });
                chart.draw_series(LineSeries::new(steps, color.stroke_width(2)))?;
            }
        }
        legend(root, &[("wake-up".to_owned(), BLUE), ("whole tick".to_owned(), ORANGE)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each session's last window was drawn as wide as the others, and an hour in five sessions was 74 minutes wide.
    #[test]
    fn windows_are_as_wide_as_they_were_measured() {
        let part = |lengths: &[f64]| MaximaPart {
            name: "none",
            windows: lengths.iter().map(|s| (*s, 10.0, 5.0)).collect(),
        };
        // Two sessions were ended within a window.
        let at = places(&[part(&[300.0, 100.0, 300.0, 20.0]), part(&[300.0])]);
        let first = vec![(0.0, 300.0), (300.0, 400.0), (400.0, 700.0), (700.0, 720.0)];
        assert_eq!(at, [first, vec![(720.0, 1_020.0)]]);
    }
}
