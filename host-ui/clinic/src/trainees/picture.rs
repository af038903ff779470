//! One figure of one trainee over the sessions, as SVG in the page.

use maud::{Markup, html};
use stylet_base::format;

const SIZE: [f64; 2] = [360.0, 190.0];
/// Margins: left, right, above, below.
const EDGES: [f64; 4] = [46.0, 12.0, 12.0, 30.0];

/// Draws values session by session; all trainees share the scale.
pub fn curve(values: &[Option<f64>], most: f64, sessions: usize, decimals: usize) -> Markup {
    let [width, height] = SIZE;
    let [left, right, above, below] = EDGES;
    let x = |n: f64| left + (n + 0.5) / sessions.max(1) as f64 * (width - left - right);
    let y = |value: f64| height - below - value / most * (height - above - below);
    let places = values.iter().enumerate().filter_map(|(n, v)| Some((n, (*v)?)));
    let places: Vec<(usize, f64)> = places.collect();
    let line: Vec<String> = places
        .iter()
        .map(|(n, v)| format!("{:.1},{:.1}", x(*n as f64), y(*v)))
        .collect();
    html! {
        svg viewBox=(format!("0 0 {width} {height}")) role="img" {
            @for part in [0.0, 0.5, 1.0] {
                @let at = y(part * most);
                line x1=(left) x2=(width - right) y1=(at) y2=(at) stroke="#d9dee3" {}
                text x=(left - 6.0) y=(at + 4.0) text-anchor="end" font-size="12" fill="#5b6570" {
                    (format::decimal(part * most, decimals))
                }
            }
            @for n in 0..sessions {
                text x=(x(n as f64)) y=(height - 10.0) text-anchor="middle" font-size="12" fill="#5b6570" { (n + 1) }
            }
            polyline points=(line.join(" ")) fill="none" stroke="#0072b2" stroke-width="1.6" {}
            @for (n, value) in &places {
                circle cx=(x(*n as f64)) cy=(y(*value)) r="4" fill="#0072b2" {
                    title { "session " (n + 1) ": " (format::decimal(*value, decimals)) }
                }
            }
        }
    }
}
