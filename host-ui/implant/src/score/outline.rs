//! Outlines of a body in a plane as closed rings, and the part of a ring inside a picture as a closed ring.

use crate::plan::anatomy::Body;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Place in a picture.
pub type Place = (f64, f64);

/// Two corners of the surface on different sides of the plane, the one in front of it first.
type Edge = (u32, u32);

/// Returns the rings in which a plane cuts the surface of the body, one for each piece and each
/// hole; scene frame, m.
pub fn rings(body: &Body, on_plane_m: Vector3<f64>, normal: Vector3<f64>) -> Vec<Vec<Vector3<f64>>> {
    let (points_m, triangles) = body.surface();
    let at = |n: u32| Vector3::from(points_m[n as usize].map(f64::from));
    let side = |n: u32| (at(n) - on_plane_m).dot(&normal);
    // The surface is closed, so a path that enters an edge in one triangle leaves it in the next.
    let mut next: BTreeMap<Edge, Vec<Edge>> = BTreeMap::new();
    for &[a, b, c] in triangles {
        let (mut from, mut to) = (None, None);
        for (p, q) in [(a, b), (b, c), (c, a)] {
            match (side(p) > 0.0, side(q) > 0.0) {
                (true, false) => from = Some((p, q)),
                (false, true) => to = Some((q, p)),
                _ => {}
            }
        }
        if let (Some(from), Some(to)) = (from, to) {
            next.entry(from).or_default().push(to);
        }
    }
    let crossing = |(front, behind): Edge| {
        let (before, after) = (side(front), side(behind));
        at(front) + (at(behind) - at(front)) * (before / (before - after))
    };
    let mut rings = Vec::new();
    while let Some((&first, _)) = next.first_key_value() {
        let (mut ring, mut edge) = (Vec::new(), first);
        while let Some(to) = taken(&mut next, edge) {
            ring.push(crossing(edge));
            edge = to;
            if edge == first {
                break;
            }
        }
        rings.push(ring);
    }
    rings
}

/// Removes one continuation from an edge.
fn taken(next: &mut BTreeMap<Edge, Vec<Edge>>, edge: Edge) -> Option<Edge> {
    let ways = next.get_mut(&edge)?;
    let to = ways.pop();
    if ways.is_empty() {
        next.remove(&edge);
    }
    to
}

/// Returns the part of a ring inside the square of this half side about the origin, closed along
/// its border; empty if there is none. (Sutherland and Hodgman 1974.)
pub fn clipped(ring: &[Place], half: f64) -> Vec<Place> {
    let mut inside = ring.to_vec();
    // Distance of a place inside each of the four sides.
    let sides: [fn(Place) -> f64; 4] = [|p| p.0, |p| -p.0, |p| p.1, |p| -p.1];
    for side in sides {
        let within = |p: Place| side(p) + half;
        let whole = std::mem::take(&mut inside);
        for (n, &to) in whole.iter().enumerate() {
            let from = whole[(n + whole.len() - 1) % whole.len()];
            let (before, after) = (within(from), within(to));
            if (before < 0.0) != (after < 0.0) {
                let share = before / (before - after);
                inside.push((from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share));
            }
            if after >= 0.0 {
                inside.push(to);
            }
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::anatomy::{ball, body_of};

    /// Returns the outline in mm, as in the picture: across is x, up is y.
    fn drawn(body: &Body, half_mm: f64) -> Vec<Vec<Place>> {
        rings(body, Vector3::zeros(), Vector3::z())
            .into_iter()
            .map(|ring| ring.iter().map(|p| (p.x * 1e3, p.y * 1e3)).collect::<Vec<_>>())
            .map(|ring| clipped(&ring, half_mm))
            .filter(|ring| !ring.is_empty())
            .collect()
    }

    fn area_mm2(ring: &[Place]) -> f64 {
        let next = ring.iter().cycle().skip(1);
        ring.iter()
            .zip(next)
            .map(|(a, b)| a.0 * b.1 - a.1 * b.0)
            .sum::<f64>()
            .abs()
            / 2.0
    }

    /// Returns the longest side that does not lie on the border.
    fn longest_mm(ring: &[Place], half_mm: f64) -> f64 {
        let is_on = |a: f64, b: f64| (a.abs() - half_mm).abs() < 1e-9 && (a - b).abs() < 1e-9;
        let next = ring.iter().cycle().skip(1);
        let sides = ring
            .iter()
            .zip(next)
            .filter(|(a, b)| !is_on(a.0, b.0) && !is_on(a.1, b.1));
        sides.map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1)).fold(0.0, f64::max)
    }

    /// Guards against an open outline, cut at the border and joined across the picture.
    #[test]
    fn a_body_beyond_the_border_is_a_closed_ring_along_the_border() {
        let body = ball("rectum", [0.012, 0.0, 0.0], [0.016, 0.02, 0.02]);
        let found = drawn(&body, 15.0);
        assert_eq!(found.len(), 1);
        assert!(
            found[0]
                .iter()
                .all(|p| p.0.abs() <= 15.0 + 1e-9 && p.1.abs() <= 15.0 + 1e-9)
        );
        assert!(longest_mm(&found[0], 15.0) < 3.0, "no line runs across the picture");
        // The ellipse from -4 to 15 mm across, by its own integral, cut at 15 mm up and down.
        let steps = 20_000;
        let width = 19.0 / f64::from(steps);
        let half_height = |x: f64| (20.0 * (1.0 - ((x - 12.0) / 16.0).powi(2)).max(0.0).sqrt()).min(15.0);
        let exact: f64 = (0..steps)
            .map(|n| 2.0 * half_height(-4.0 + (f64::from(n) + 0.5) * width) * width)
            .sum();
        let area = area_mm2(&found[0]);
        assert!((area / exact - 1.0).abs() < 0.01, "{area} mm2 against {exact} mm2");
    }

    /// Guards against rays from the middle between two pieces, which drew one star of both.
    #[test]
    fn a_body_of_two_pieces_is_two_rings() {
        let balls = [-0.009, 0.009].map(|x| ball("nerve", [x, 0.0, 0.0], [0.005; 3]));
        let (mut points_m, mut triangles) = (Vec::new(), Vec::new());
        for one in &balls {
            let (points, corners) = one.surface();
            let before = points_m.len();
            points_m.extend(points.iter().map(|p| p.map(f64::from)));
            triangles.extend(corners.iter().map(|t| t.map(|n| n as usize + before)));
        }
        let body = body_of("nerves", &points_m, &triangles).expect("closed");
        let found = drawn(&body, 20.0);
        assert_eq!(found.len(), 2);
        for ring in &found {
            let area = area_mm2(ring);
            assert!((area / (std::f64::consts::PI * 25.0) - 1.0).abs() < 0.02, "{area} mm2");
            assert!(longest_mm(ring, 20.0) < 1.0);
            let is_left = ring[0].0 < 0.0;
            assert!(ring.iter().all(|p| (p.0 < 0.0) == is_left), "each about its own middle");
        }
        // Beyond the border there is nothing to draw.
        assert_eq!(drawn(&body, 3.0).len(), 0);
    }
}
