//! Outlines of a body in a plane as closed rings, and the part of a ring inside a picture as a closed ring.

use crate::plan::anatomy::Body;
use nalgebra::Vector3;
use stylet_surfaces::mesh::cut::{Line, Sides, cut};

/// Place in a picture.
pub type Place = (f64, f64);

/// Returns the rings in which a plane cuts the surface of the body, one for each piece and each
/// hole; scene frame, m.
pub fn rings(body: &Body, on_plane_m: Vector3<f64>, normal: Vector3<f64>) -> Vec<Vec<Vector3<f64>>> {
    let (points_m, triangles) = body.surface();
    let offset_m = on_plane_m.dot(&normal) as f32;
    let sides = Sides::of(points_m, normal.map(|c| c as f32).into(), offset_m);
    let ring = |line: Line| {
        // The surface is closed, so the last point repeats the first.
        let points = line.into_iter().skip(1);
        points.map(|p| Vector3::from(p.map(f64::from))).collect()
    };
    cut(points_m, triangles, &sides).into_iter().map(ring).collect()
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
    use crate::plan::anatomy::ball;

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
        let body = Body::new("nerves", &points_m, &triangles).expect("closed");
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
