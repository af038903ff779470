//! Lines on the screen, without the points that nobody could see.

use egui::Pos2;

/// Distance from a line that can be seen (points).
const SEEN: f32 = 0.15;
/// Most points left out in a row.
const MOST: usize = 16;

/// Leaves out the points of a line that lie within [`SEEN`] of it without them: a driver without a
/// graphics card pays for each piece.
pub fn simplified(points: impl Iterator<Item = Pos2>) -> Vec<Pos2> {
    let mut kept = Vec::new();
    // Points since the last one that was kept.
    let mut after: Vec<Pos2> = Vec::with_capacity(MOST);
    for point in points {
        let Some(&from) = kept.last() else {
            kept.push(point);
            continue;
        };
        let straight = after.iter().all(|p| distance(*p, [from, point]) <= SEEN);
        if !straight || after.len() == MOST {
            kept.extend(after.last());
            after.clear();
        }
        after.push(point);
    }
    kept.extend(after.last());
    kept
}

/// Returns the distance of a point from a piece of a line.
fn distance(point: Pos2, [from, to]: [Pos2; 2]) -> f32 {
    let along = to - from;
    let share = (point - from).dot(along) / along.length_sq().max(f32::MIN_POSITIVE);
    point.distance(from + share.clamp(0.0, 1.0) * along)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    #[test]
    fn a_simplified_outline_lies_where_it_lay() {
        let circle = |n: u32| {
            let (sin, cos) = (TAU * n as f32 / 720.0).sin_cos();
            Pos2::new(100.0 * cos, 60.0 * sin)
        };
        let kept = simplified((0..=720).map(circle));
        assert!(kept.len() < 100, "{} points", kept.len());
        assert!(kept[0].distance(kept[kept.len() - 1]) < 1e-3, "the outline is open");
        for point in (0..720).map(circle) {
            let off = kept.windows(2).map(|ends| distance(point, [ends[0], ends[1]]));
            let off = off.fold(f32::MAX, f32::min);
            assert!(off <= SEEN + 1e-3, "{point:?} is {off} beside the line");
        }
    }

    #[test]
    fn a_straight_line_keeps_its_ends() {
        let kept = simplified((0..10).map(|n| Pos2::new(n as f32, 2.0)));
        assert_eq!(kept, [Pos2::new(0.0, 2.0), Pos2::new(9.0, 2.0)]);
        assert!(simplified(std::iter::empty()).is_empty());
    }
}
