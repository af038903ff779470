//! The latency plot of OSADL's test farm: each microsecond up to the maximum, logarithmic counts, a curve for each core.

use super::limits::{Limit, lines};
use super::{Decades, chart, decade_above, legend, mesh, number};
use crate::cyclictest::CoreWakes;
use plotters::prelude::*;
use stylet_report::picture::{BLUE, COLOURS, DrawError, drawn};

const SIZE: (u32, u32) = (1_120, 360);
/// Below one sample, so that a bin with one is seen.
const FLOOR: f64 = 0.8;

/// Plots the wake-ups of each core with the limits of the force loop, which is the first.
pub fn osadl(cores: &[CoreWakes], limits: &[Limit], missed: u64) -> Result<String, DrawError> {
    drawn(SIZE, |root| {
        root.fill(&WHITE)?;
        let longest_us = cores.iter().map(|of| of.wakes.max() / 1_000).max().unwrap_or(0);
        let bins: Vec<_> = cores.iter().map(CoreWakes::bins).collect();
        let most = bins
            .iter()
            .flat_map(|bins| bins.values())
            .max()
            .map_or(1.0, |n| *n as f64);
        let right = longest_us as f64 + 1.0;
        // The legend has the highest decade to itself.
        let top = 10.0 * decade_above(most);
        let mut chart = chart(root, 70).build_cartesian_2d(0.0..right, Decades(FLOOR..top, number))?;
        let x = format!("latency, \u{b5}s; largest {longest_us} \u{b5}s");
        mesh(&mut chart, &x, "number of latency samples")?;
        lines(root, &mut chart, limits, right, [FLOOR, 0.4 * top], BLUE)?;
        let colours = [BLUE].into_iter().chain(COLOURS.into_iter().filter(|c| *c != BLUE));
        let colours: Vec<RGBColor> = colours.collect();
        for (color, bins) in colours.iter().zip(&bins).rev() {
            chart.draw_series(LineSeries::new(steps(bins), color.stroke_width(1)))?;
        }
        let words = |(of, color): (&CoreWakes, &RGBColor)| {
            let core = of.core.map_or("any core".to_owned(), |core| format!("core {core}"));
            let largest_us = of.wakes.max() / 1_000;
            (format!("{core}: {}, largest {largest_us} \u{b5}s", of.thread), *color)
        };
        let mut entries: Vec<_> = cores.iter().zip(&colours).map(words).collect();
        if let Some((force, _)) = entries.first_mut() {
            *force += &format!(", missed deadlines: {missed}");
        }
        legend(root, &entries)
    })
}

/// Returns the outline of all bins; between them it is on the floor.
fn steps(bins: &std::collections::BTreeMap<u64, u64>) -> Vec<(f64, f64)> {
    let mut line: Vec<(f64, f64)> = Vec::with_capacity(4 * bins.len());
    let mut end_us = None;
    for (&us, &n) in bins {
        let (from, to) = (us as f64, us as f64 + 1.0);
        if end_us != Some(us) {
            line.extend(end_us.map(|end| (end as f64, FLOOR)));
            line.push((from, FLOOR));
        }
        line.extend([(from, n as f64), (to, n as f64)]);
        end_us = Some(us + 1);
    }
    line.extend(end_us.map(|end| (end as f64, FLOOR)));
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_microsecond_is_a_step_and_empty_ones_are_on_the_floor() {
        let bins = [(4, 2), (5, 7), (9, 1)].into_iter().collect();
        let outline = [
            (4.0, FLOOR),
            (4.0, 2.0),
            (5.0, 2.0),
            (5.0, 7.0),
            (6.0, 7.0),
            (6.0, FLOOR),
            (9.0, FLOOR),
            (9.0, 1.0),
            (10.0, 1.0),
            (10.0, FLOOR),
        ];
        assert_eq!(steps(&bins), outline);
    }
}
