//! Where a plane cuts a triangle mesh: lines, joined end to end.

use std::collections::HashMap;

/// An edge of the mesh by its two vertices, the smaller first.
type Edge = (u32, u32);

/// One line; closed when its first point is its last.
pub type Line = Vec<[f32; 3]>;

/// How far each point lies before the plane `normal · p = offset`.
pub fn sides(points_m: &[[f32; 3]], normal: [f32; 3], offset_m: f32) -> Vec<f32> {
    points_m
        .iter()
        .map(|p| p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2] - offset_m)
        .collect()
}

/// Cuts a mesh at the plane of these [`sides`]. Triangles with a vertex that is not there are left out.
pub fn cut(points_m: &[[f32; 3]], triangles: &[[u32; 3]], side: &[f32]) -> Vec<Line> {
    let mut next: HashMap<Edge, Edge> = HashMap::new();
    for triangle in triangles {
        if let Some((from, to)) = crossed(side, triangle) {
            next.insert(from, to);
        }
    }
    let place = |(a, b): Edge| {
        let (pa, pb) = (points_m[a as usize], points_m[b as usize]);
        let (da, db) = (side[a as usize], side[b as usize]);
        let share = da / (da - db);
        [0, 1, 2].map(|i| pa[i] + share * (pb[i] - pa[i]))
    };
    join(next)
        .into_iter()
        .map(|line| line.into_iter().map(place).collect())
        .collect()
}

/// The edges through which the plane enters and leaves a triangle; a vertex on the plane counts as in front.
fn crossed(side: &[f32], triangle: &[u32; 3]) -> Option<(Edge, Edge)> {
    let mut front = [false; 3];
    for (f, &v) in front.iter_mut().zip(triangle) {
        *f = *side.get(v as usize)? >= 0.0;
    }
    // The corner that is alone on its side.
    let alone = (0..3).find(|&i| front[i] != front[(i + 1) % 3] && front[i] != front[(i + 2) % 3])?;
    let [a, b, c] = [0, 1, 2].map(|i| triangle[(alone + i) % 3]);
    let edge = |u: u32, v: u32| (u.min(v), u.max(v));
    let (first, second) = (edge(a, b), edge(a, c));
    // Always the same way round, so that the lines of neighbouring triangles join head to tail.
    Some(if front[alone] { (first, second) } else { (second, first) })
}

/// Chains of edges, each followed until it closes or ends.
fn join(mut next: HashMap<Edge, Edge>) -> Vec<Vec<Edge>> {
    let ends: std::collections::HashSet<Edge> = next.values().copied().collect();
    // Open lines first, from their beginnings; in the order of the mesh, so that the same cut gives the same lines.
    let mut starts: Vec<Edge> = next.keys().copied().collect();
    starts.sort_unstable_by_key(|edge| (ends.contains(edge), *edge));
    let mut lines = Vec::new();
    for start in starts {
        let Some(mut at) = next.remove(&start) else { continue };
        let mut line = vec![start, at];
        while let Some(further) = next.remove(&at) {
            line.push(further);
            at = further;
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere of triangles about the origin.
    fn sphere(radius: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        const RINGS: u32 = 24;
        const SIDES: u32 = 48;
        let mut points = Vec::new();
        for ring in 0..=RINGS {
            let (s, c) = (std::f32::consts::PI * ring as f32 / RINGS as f32).sin_cos();
            for side in 0..SIDES {
                let (ys, yc) = (std::f32::consts::TAU * side as f32 / SIDES as f32).sin_cos();
                points.push([radius * s * yc, radius * s * ys, radius * c]);
            }
        }
        let at = |ring: u32, side: u32| ring * SIDES + side % SIDES;
        let mut triangles = Vec::new();
        for ring in 0..RINGS {
            for side in 0..SIDES {
                triangles.push([at(ring, side), at(ring + 1, side), at(ring + 1, side + 1)]);
                triangles.push([at(ring, side), at(ring + 1, side + 1), at(ring, side + 1)]);
            }
        }
        (points, triangles)
    }

    #[test]
    fn a_sphere_is_cut_in_one_closed_circle_of_the_right_length() {
        let (points, triangles) = sphere(1.0);
        for offset in [0.0, 0.3, -0.62] {
            let lines = cut(&points, &triangles, &sides(&points, [0.0, 0.6, 0.8], offset));
            assert_eq!(lines.len(), 1, "one line at {offset}");
            let line = &lines[0];
            assert_eq!(line.first(), line.last(), "closed");
            let length: f32 = line
                .windows(2)
                .map(|p| (0..3).map(|i| (p[0][i] - p[1][i]).powi(2)).sum::<f32>().sqrt())
                .sum();
            let expected = std::f32::consts::TAU * (1.0 - offset * offset).sqrt();
            assert!((length / expected - 1.0).abs() < 0.01, "{length} against {expected}");
            for p in line {
                assert!((0.6 * p[1] + 0.8 * p[2] - offset).abs() < 1e-5, "{p:?} is in the plane");
            }
        }
        assert!(cut(&points, &triangles, &sides(&points, [0.0, 0.0, 1.0], 2.0)).is_empty());
    }

    #[test]
    fn a_triangle_with_a_corner_that_is_not_there_is_left_out() {
        let points = [[0.0, 0.0, -1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        let lines = cut(&points, &[[0, 1, 2], [0, 1, 9]], &sides(&points, [0.0, 0.0, 1.0], 0.0));
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].len(), 2);
    }
}
