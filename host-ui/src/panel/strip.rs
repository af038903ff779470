//! A plot over time: minimum and maximum as a band, and the value under the pointer.

use super::axis::{grid, number, plot, upwards};
use egui::Color32;
use egui_plot::{FilledArea, GridMark, Line, PlotPoints, VLine};
use stylet_base::format;

/// Share of the time axis: half the width of an isolated point, and the distance at which a pointer
/// selects a piece.
const LONE_SHARE: f64 = 0.001;
const BESIDE_SHARE: f64 = 0.005;

pub struct Strip<'a> {
    pub name: &'a str,
    /// Unit and decimals of the value under the pointer.
    pub unit: (&'a str, usize),
    pub color: Color32,
    pub height: f32,
    /// The ends of the axis of time.
    pub seconds: [f64; 2],
    /// Smallest range of the vertical axis.
    pub least: [f64; 2],
    /// Time, minimum and maximum, in pieces; the data has gaps between them.
    pub pieces: &'a [Vec<[f64; 3]>],
    /// Moments on the axis of time, each with its colour and words.
    pub marks: &'a [(f64, Color32, String)],
    /// True for a plot from zero to the maximum, if only that counts.
    pub worst_only: bool,
}

impl Strip<'_> {
    pub fn show(&self, ui: &mut egui::Ui) {
        let [from_s, to_s] = self.seconds;
        let length_s = to_s - from_s;
        let shown = plot(self.name, self.height)
            .y_grid_spacer(upwards)
            .y_axis_formatter(|mark: GridMark, _: &_| number(mark))
            .include_x(from_s)
            .include_x(to_s)
            .include_y(self.least[0])
            .include_y(self.least[1])
            .x_grid_spacer(move |_| grid([from_s, to_s], length_s / 5.0))
            .x_axis_formatter(move |mark: GridMark, _: &_| {
                // At the edge a label would be cut off.
                if to_s - mark.value < 0.04 * length_s {
                    String::new()
                } else {
                    format!("{} s", number(mark))
                }
            })
            .show(ui, |plot| {
                for (at_s, color, _) in self.marks {
                    plot.vline(VLine::new("moment", *at_s).color(*color).width(1.5));
                }
                for piece in self.pieces {
                    let piece = widened(piece, length_s * LONE_SHARE);
                    let [xs, lows, highs] = [0, 1, 2].map(|n| piece.iter().map(|p| p[n]).collect::<Vec<f64>>());
                    let lows = if self.worst_only { vec![0.0; xs.len()] } else { lows };
                    let band = FilledArea::new(self.name, &xs, &lows, &highs).fill_color(self.color);
                    plot.add(band.allow_hover(false));
                    // A band whose limits are equal has no width.
                    if !self.worst_only {
                        let middle = piece.iter().map(|[x, low, high]| [*x, 0.5 * (low + high)]);
                        let line = Line::new(self.name, PlotPoints::from_iter(middle)).color(self.color);
                        plot.line(line.width(1.3).allow_hover(false));
                    }
                }
            });
        if let Some(place) = shown.response.hover_pos()
            && let Some(text) = self.value_at(shown.transform.value_from_position(place).x)
        {
            shown.response.on_hover_text_at_pointer(text);
        }
    }

    /// Returns the value that is nearest in time.
    fn value_at(&self, seconds: f64) -> Option<String> {
        let beside_s = (self.seconds[1] - self.seconds[0]) * BESIDE_SHARE;
        let marked = self.marks.iter().find(|(at_s, ..)| (at_s - seconds).abs() <= beside_s);
        if let Some((at_s, _, words)) = marked {
            return Some(format!("{at_s:.1} s: {words}"));
        }
        let points: Vec<[f64; 3]> = self.pieces.concat();
        if self.is_in_gap(seconds) {
            return Some(format!("{seconds:.1} s: no tick was seen"));
        }
        let after = points.partition_point(|[x, ..]| *x < seconds);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let near = near.filter_map(|n| points.get(n));
        let [at_s, low, high] = near.min_by(|a, b| (a[0] - seconds).abs().total_cmp(&(b[0] - seconds).abs()))?;
        let (unit, decimals) = self.unit;
        let [low, high] = [low, high].map(|v| format::decimal(*v, decimals));
        Some(if self.worst_only {
            format!("{at_s:.1} s: at most {high} {unit}")
        } else if low == high {
            format!("{at_s:.1} s: {high} {unit}")
        } else {
            format!("{at_s:.1} s: {low} to {high} {unit}")
        })
    }

    /// Returns whether a time lies between two pieces, and not close to one of them.
    fn is_in_gap(&self, seconds: f64) -> bool {
        let [from_s, to_s] = self.seconds;
        let beside_s = (to_s - from_s) * BESIDE_SHARE;
        self.pieces.windows(2).any(|pair| {
            let end = pair[0].last().map_or(f64::MAX, |[x, ..]| *x);
            let begin = pair[1].first().map_or(f64::MIN, |[x, ..]| *x);
            (end + beside_s..begin - beside_s).contains(&seconds)
        })
    }
}

/// Widens a single point, which would be invisible.
fn widened(piece: &[[f64; 3]], half_s: f64) -> Vec<[f64; 3]> {
    match piece {
        &[[x, low, high]] => vec![[x - half_s, low, high], [x + half_s, low, high]],
        many => many.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_value_under_the_pointer_is_shown_with_its_time_and_unit() {
        let pieces = [vec![[-2.0, -1e-9, 0.0], [-1.96, 1.0, 3.456], [-1.92, 3.5, 3.5]]];
        let mut strip = Strip {
            name: "force",
            unit: ("N", 2),
            color: Color32::WHITE,
            height: 50.0,
            seconds: [-10.0, 0.0],
            least: [0.0, 1.0],
            pieces: &pieces,
            marks: &[],
            worst_only: false,
        };
        let value = |strip: &Strip<'_>, at_s| strip.value_at(at_s).expect("some");
        assert_eq!(value(&strip, -9.0), "-2.0 s: 0.00 N");
        assert_eq!(value(&strip, -1.97), "-2.0 s: 1.00 to 3.46 N");
        assert_eq!(value(&strip, -1.0), "-1.9 s: 3.50 N");
        strip.worst_only = true;
        assert_eq!(value(&strip, -1.97), "-2.0 s: at most 3.46 N");
        let parted = [vec![[-4.0, 1.0, 1.0]], vec![[-1.0, 2.0, 2.0]]];
        strip.pieces = &parted;
        assert_eq!(value(&strip, -2.5), "-2.5 s: no tick was seen");
        assert_eq!(value(&strip, -3.98), "-4.0 s: at most 1.00 N");
        let marks = [(-2.5, Color32::WHITE, "mark: left lobe".to_owned())];
        strip.marks = &marks;
        assert_eq!(value(&strip, -2.46), "-2.5 s: mark: left lobe");
        assert_eq!(value(&strip, -2.4), "-2.4 s: no tick was seen");
        strip.pieces = &[];
        assert_eq!(strip.value_at(0.0), None);
    }
}
