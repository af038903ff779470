//! Plots without interaction: axes, marks and labels.

use egui::Rangef;
use egui_plot::{AxisHints, GridInput, GridMark, Plot};

/// Distance between two values on a vertical axis, in points, so that each is legible.
const BETWEEN_VALUES: f32 = 20.0;
/// Spacing of grid lines: invisible below the first, drawn in full at the second.
const LINES: Rangef = Rangef { min: 8.0, max: 300.0 };

/// Returns a plot without interaction, so that a plot that moves is not dragged by accident.
pub fn plot(name: &str, height: f32) -> Plot<'static> {
    Plot::new(name.to_owned())
        .height(height)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .allow_axis_zoom_drag(false)
        .show_x(false)
        .show_y(false)
        .custom_x_axes(vec![AxisHints::new_x().label_spacing(25.0..=35.0)])
        .custom_y_axes(vec![AxisHints::new_y().min_thickness(34.0).label_spacing(12.0..=20.0)])
        .grid_spacing(LINES)
        .show_background(true)
        .set_margin_fraction(egui::vec2(0.0, 0.08))
}

/// Returns marks at multiples of 1, 2 or 5 times a power of ten, with at least this spacing.
pub fn grid([from, to]: [f64; 2], at_least: f64) -> Vec<GridMark> {
    if !(at_least > 0.0 && at_least.is_finite() && to >= from && (to - from) / at_least < 100.0) {
        return Vec::new();
    }
    let power = 10.0_f64.powf(at_least.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|n| n * power);
    let step_size = steps.into_iter().find(|s| *s >= at_least * (1.0 - 1e-9));
    let step_size = step_size.unwrap_or(10.0 * power);
    let [first, last] = [(from / step_size).ceil(), (to / step_size).floor()].map(|n| n as i64);
    let mark = |n: i64| GridMark {
        value: n as f64 * step_size,
        step_size,
    };
    (first..=last).map(mark).collect()
}

/// Returns the marks of a vertical axis.
pub fn upwards(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    // The offered step is as wide as the nearest visible lines.
    grid(
        [low, high],
        input.base_step_size * f64::from(BETWEEN_VALUES / LINES.min),
    )
}

/// Formats a mark with as many decimals as the grid needs.
pub fn number(mark: GridMark) -> String {
    let decimals = (-mark.step_size.log10() - 1e-9).ceil().max(0.0) as usize;
    format!("{:.decimals$}", mark.value)
}

/// Returns evenly spaced marks from `first` on.
pub fn marks(first: f64, step: f64, count: usize) -> Vec<GridMark> {
    (0..=count)
        .map(|i| GridMark {
            value: first + i as f64 * step,
            step_size: step,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_lie_on_round_numbers_and_no_nearer_than_asked() {
        let labels =
            |from, to, at_least| -> Vec<String> { grid([from, to], at_least).into_iter().map(number).collect() };
        assert_eq!(labels(0.0, 18.6, 18.6 / 5.0), ["0", "5", "10", "15"]);
        assert_eq!(labels(-0.7, 4.3, 5.0 / 2.4), ["0"]);
        assert_eq!(labels(-0.7, 4.3, 4.8 / 2.4), ["0", "2", "4"]);
        assert_eq!(labels(0.0, 1.0, 0.3), ["0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 0.35, 0.1), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(-60.0, 110.0, 100.0), ["0", "100"]);
        assert_eq!(labels(0.0, 9_000.0, 3_001.0), ["0", "5000"]);
        for bad in [[0.0, f64::NAN], [0.0, f64::INFINITY], [1.0, 0.0]] {
            assert!(grid(bad, 0.1).is_empty(), "{bad:?}");
        }
        // A hundred points for 10 N, of which 20 between two values are 2 N.
        let input = GridInput {
            bounds: (-0.5, 9.5),
            base_step_size: 0.1 * f64::from(LINES.min),
        };
        assert_eq!(
            upwards(input).into_iter().map(number).collect::<Vec<_>>(),
            ["0", "2", "4", "6", "8"]
        );
        assert!(grid([0.0, 1.0], 0.0).is_empty() && grid([0.0, 1.0], 1e-9).is_empty());
    }
}
