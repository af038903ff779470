//! The cut of a plane through a triangle mesh: lines, joined end to end.

/// An edge of the mesh by its two vertices, the smaller first.
type Edge = (u32, u32);

/// One line; closed when its first point is its last.
pub type Line = Vec<[f32; 3]>;

/// Side of a plane for each point.
pub struct Sides {
    /// Distance before the plane.
    before_m: Vec<f32>,
    /// True in front of the plane or on it. One byte each, because every triangle reads three of
    /// them.
    front: Vec<bool>,
}

impl Sides {
    /// Classifies points by the plane `normal · p = offset`.
    pub fn of(points_m: &[[f32; 3]], normal: [f32; 3], offset_m: f32) -> Self {
        let before_m = |p: &[f32; 3]| p[0] * normal[0] + p[1] * normal[1] + p[2] * normal[2] - offset_m;
        let before_m: Vec<f32> = points_m.iter().map(before_m).collect();
        let front = before_m.iter().map(|m| *m >= 0.0).collect();
        Self { before_m, front }
    }
}

/// Cuts a mesh at the plane of these sides. Leaves out triangles with a missing vertex.
pub fn cut(points_m: &[[f32; 3]], triangles: &[[u32; 3]], sides: &Sides) -> Vec<Line> {
    let place = |(a, b): Edge| {
        let (pa, pb) = (points_m[a as usize], points_m[b as usize]);
        let (da, db) = (sides.before_m[a as usize], sides.before_m[b as usize]);
        let share = da / (da - db);
        [0, 1, 2].map(|i| pa[i] + share * (pb[i] - pa[i]))
    };
    let crossed = triangles.iter().filter_map(|triangle| crossed(&sides.front, triangle));
    join(crossed.collect())
        .into_iter()
        .map(|line| line.into_iter().map(place).collect())
        .collect()
}

/// Returns the edges through which the plane enters and leaves a triangle.
fn crossed(front: &[bool], triangle: &[u32; 3]) -> Option<(Edge, Edge)> {
    let [a, b, c] = triangle.map(|v| front.get(v as usize).copied());
    let front = [a?, b?, c?];
    if front[0] == front[1] && front[1] == front[2] {
        return None;
    }
    // The corner that is alone on its side.
    let alone = (0..3).find(|&i| front[i] != front[(i + 1) % 3] && front[i] != front[(i + 2) % 3])?;
    let [a, b, c] = [0, 1, 2].map(|i| triangle[(alone + i) % 3]);
    let edge = |u: u32, v: u32| (u.min(v), u.max(v));
    let (first, second) = (edge(a, b), edge(a, c));
    // Always in the same direction, so that the lines of neighbouring triangles join head to tail.
    Some(if front[alone] { (first, second) } else { (second, first) })
}

/// Joins edges into chains, each until it closes or ends; in the order of the mesh, so that equal
/// cuts give equal lines.
fn join(mut segments: Vec<(Edge, Edge)>) -> Vec<Vec<Edge>> {
    segments.sort_unstable();
    let next_of = |(_, to): &(Edge, Edge)| segments.binary_search_by_key(to, |(from, _)| *from).ok();
    let next: Vec<Option<usize>> = segments.iter().map(next_of).collect();
    let mut is_entered = vec![false; segments.len()];
    for &n in next.iter().flatten() {
        is_entered[n] = true;
    }
    // Open lines first, from their starts.
    let (inner, first): (Vec<usize>, Vec<usize>) = (0..segments.len()).partition(|&n| is_entered[n]);
    let mut is_left = vec![true; segments.len()];
    let mut lines = Vec::new();
    for start in first.into_iter().chain(inner) {
        if !is_left[start] {
            continue;
        }
        let mut line = vec![segments[start].0];
        let mut at = Some(start);
        while let Some(n) = at.filter(|&n| is_left[n]) {
            is_left[n] = false;
            line.push(segments[n].1);
            at = next[n];
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a sphere of triangles about the origin.
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
            let lines = cut(&points, &triangles, &Sides::of(&points, [0.0, 0.6, 0.8], offset));
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
        assert!(cut(&points, &triangles, &Sides::of(&points, [0.0, 0.0, 1.0], 2.0)).is_empty());
    }

    /// Returns the number of triangles that the plane crosses, and the length of the cut, triangle
    /// by triangle.
    fn twin(points: &[[f32; 3]], triangles: &[[u32; 3]], normal: [f32; 3], offset: f32) -> (usize, f64) {
        let before = |p: [f32; 3]| (0..3).map(|i| f64::from(p[i] * normal[i])).sum::<f64>() - f64::from(offset);
        let (mut count, mut length) = (0, 0.0);
        for triangle in triangles {
            let corners = triangle.map(|v| points[v as usize]);
            let mut met = Vec::new();
            for (p, q) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
                let (dp, dq) = (before(p), before(q));
                if (dp >= 0.0) != (dq >= 0.0) {
                    met.push([0, 1, 2].map(|i| f64::from(p[i]) + dp / (dp - dq) * f64::from(q[i] - p[i])));
                }
            }
            if let [p, q] = met[..] {
                count += 1;
                length += (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt();
            }
        }
        (count, length)
    }

    /// Tests two spheres, one with a hole, cut in closed and in open lines.
    #[test]
    fn the_cut_crosses_each_met_triangle_once() {
        let (mut points, mut triangles) = sphere(1.0);
        let (other, its) = sphere(0.7);
        let first = points.len() as u32;
        points.extend(other.iter().map(|p| [p[0] + 0.4, p[1], p[2] + 0.9]));
        triangles.extend(its.iter().skip(300).map(|t| t.map(|v| v + first)));
        // In random order.
        triangles.sort_unstable_by_key(|t| t[0].wrapping_mul(2_654_435_761));
        let normal = [0.48, 0.6, 0.64];
        let (mut open, mut closed) = (0, 0);
        for step in -9..=14 {
            let offset = step as f32 * 0.1 + 0.013;
            let lines = cut(&points, &triangles, &Sides::of(&points, normal, offset));
            let pieces: usize = lines.iter().map(|line| line.len() - 1).sum();
            let long = |p: &[[f32; 3]]| (0..3).map(|i| f64::from(p[0][i] - p[1][i]).powi(2)).sum::<f64>().sqrt();
            let length: f64 = lines.iter().flat_map(|line| line.windows(2)).map(long).sum();
            let expected = twin(&points, &triangles, normal, offset);
            assert_eq!(pieces, expected.0, "at {offset}");
            assert!(
                (length - expected.1).abs() < 1e-4 * expected.1.max(1.0),
                "{length} at {offset}, not {}",
                expected.1
            );
            let (whole, broken): (Vec<&Line>, Vec<&Line>) = lines.iter().partition(|line| line.first() == line.last());
            assert!(whole.len() + broken.len() <= 3, "{} lines at {offset}", lines.len());
            (open, closed) = (open + broken.len(), closed + whole.len());
        }
        assert!(open > 0 && closed > 0, "{open} open, {closed} closed");
    }

    #[test]
    fn triangles_with_missing_corners_are_left_out() {
        let points = [[0.0, 0.0, -1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        let lines = cut(
            &points,
            &[[0, 1, 2], [0, 1, 9]],
            &Sides::of(&points, [0.0, 0.0, 1.0], 0.0),
        );
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].len(), 2);
    }
}
