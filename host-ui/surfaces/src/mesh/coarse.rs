//! Fewer triangles about the same vertices, for pictures that are replaced at once.

use super::SurfaceVertex;
use std::collections::HashMap;

/// Side of the cubes whose vertices become one, as a part of the largest side of the surface,
/// within limits.
const PART: f32 = 1.0 / 14.0;
const CELL_M: [f32; 2] = [2.5e-3, 8e-3];

/// Cube, and whether the surface faces outwards there.
type Cell = ([i32; 3], bool);

/// Returns indices of a surface on some of the same vertices: in each cube, the one nearest to the
/// middle of those there (vertex clustering, Rossignac and Borrel 1993). They move with the
/// surface.
pub fn coarse(vertices: &[SurfaceVertex], indices: &[u32]) -> Vec<u32> {
    let place = |vertex: u32| vertices[vertex as usize].place_m;
    let bounds = [0, 1, 2].map(|a| {
        let along = || indices.iter().map(|&vertex| place(vertex)[a]);
        [along().fold(f32::MAX, f32::min), along().fold(f32::MIN, f32::max)]
    });
    let side_m = bounds.iter().map(|[low, high]| high - low).fold(0.0, f32::max);
    let cell_m = (side_m * PART).clamp(CELL_M[0], CELL_M[1]);
    // Both faces of a thin wall lie in one cube and stay apart: one faces away from the middle, the
    // other towards it.
    let cell = |vertex: u32| -> Cell {
        let SurfaceVertex { place_m, normal } = vertices[vertex as usize];
        let from_middle = |a: usize| place_m[a] - 0.5 * (bounds[a][0] + bounds[a][1]);
        let away: f32 = (0..3).map(|a| normal[a] * from_middle(a)).sum();
        (place_m.map(|c| (c / cell_m).floor() as i32), away > 0.0)
    };
    let mut sums: HashMap<Cell, ([f32; 3], f32)> = HashMap::new();
    for &vertex in indices {
        let (sum, count) = sums.entry(cell(vertex)).or_default();
        for (sum, c) in sum.iter_mut().zip(place(vertex)) {
            *sum += c;
        }
        *count += 1.0;
    }
    let from_middle = |vertex: u32, (sum, count): &([f32; 3], f32)| -> f32 {
        let at = place(vertex);
        (0..3).map(|a| (at[a] - sum[a] / count).powi(2)).sum()
    };
    let mut nearest: HashMap<Cell, u32> = HashMap::new();
    for &vertex in indices {
        let cell = cell(vertex);
        let sum = &sums[&cell];
        let kept = nearest.entry(cell).or_insert(vertex);
        if from_middle(vertex, sum) < from_middle(*kept, sum) {
            *kept = vertex;
        }
    }
    indices
        .chunks_exact(3)
        .map(|corners| [0, 1, 2].map(|c| nearest[&cell(corners[c])]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .flatten()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a ball of this many rings, each with twice as many vertices.
    fn ball(radius_m: f32, rings: u32) -> (Vec<SurfaceVertex>, Vec<u32>) {
        let across = 2 * rings;
        let mut vertices = Vec::new();
        for ring in 0..=rings {
            for n in 0..across {
                let (polar, around) = (
                    std::f32::consts::PI * ring as f32 / rings as f32,
                    std::f32::consts::TAU * n as f32 / across as f32,
                );
                let normal = [polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()];
                vertices.push(SurfaceVertex {
                    place_m: normal.map(|c| c * radius_m),
                    normal,
                });
            }
        }
        let at = |ring: u32, n: u32| ring * across + n % across;
        let mut indices = Vec::new();
        for ring in 0..rings {
            for n in 0..across {
                let [a, b, c, d] = [at(ring, n), at(ring, n + 1), at(ring + 1, n), at(ring + 1, n + 1)];
                indices.extend([a, c, b, b, c, d]);
            }
        }
        (vertices, indices)
    }

    fn volume(vertices: &[SurfaceVertex], indices: &[u32]) -> f64 {
        indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] =
                    [0, 1, 2].map(|i| nalgebra::Vector3::from(vertices[t[i] as usize].place_m).map(f64::from));
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn a_ball_keeps_its_volume_with_a_tenth_of_the_triangles() {
        let (vertices, indices) = ball(0.022, 90);
        let fewer = coarse(&vertices, &indices);
        assert!(fewer.len() * 10 < indices.len(), "{} of {}", fewer.len(), indices.len());
        let ratio = volume(&vertices, &fewer) / volume(&vertices, &indices);
        assert!((0.95..=1.0).contains(&ratio), "{ratio}");
    }

    /// Tests the wall of a bladder.
    #[test]
    fn a_thin_wall_keeps_its_volume() {
        let (mut vertices, mut indices) = ball(0.022, 90);
        let (inner, around) = ball(0.0205, 90);
        let first = vertices.len() as u32;
        let turned = |v: &SurfaceVertex| SurfaceVertex {
            place_m: v.place_m,
            normal: v.normal.map(|c| -c),
        };
        vertices.extend(inner.iter().map(turned));
        indices.extend(
            around
                .chunks_exact(3)
                .flat_map(|t| [t[0], t[2], t[1]].map(|v| first + v)),
        );
        let fewer = coarse(&vertices, &indices);
        let ratio = volume(&vertices, &fewer) / volume(&vertices, &indices);
        assert!((0.9..=1.1).contains(&ratio), "{ratio}");
    }

    #[test]
    fn parts_smaller_than_a_cube_have_no_triangles() {
        let (mut vertices, indices) = ball(0.001, 8);
        vertices
            .iter_mut()
            .for_each(|v| v.place_m = v.place_m.map(|c| c + 0.5 * CELL_M[0]));
        assert!(coarse(&vertices, &indices).is_empty());
        assert!(coarse(&[], &[]).is_empty());
    }
}
