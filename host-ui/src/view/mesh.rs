//! The gland's surface as the graphics card takes it: positions with smooth normals, indices.

use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;

const NORMAL_PASSES: usize = 2;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SurfaceVertex {
    pub place_m: [f32; 3],
    /// Not of unit length: the shader normalises.
    pub normal: [f32; 3],
}

/// Each normal is the sum of its triangles' area vectors; a triangle with a vertex that is not there is left out.
pub fn surface(positions_m: &[[f32; 3]], triangles: &[[u32; 3]], out: &mut Vec<SurfaceVertex>) {
    out.clear();
    out.extend(positions_m.iter().map(|&place_m| SurfaceVertex {
        place_m,
        normal: [0.0; 3],
    }));
    for triangle in triangles {
        let [i, j, k] = triangle.map(|index| index as usize);
        let (Some(a), Some(b), Some(c)) = (positions_m.get(i), positions_m.get(j), positions_m.get(k)) else {
            continue;
        };
        let (a, b, c) = (Vector3::from(*a), Vector3::from(*b), Vector3::from(*c));
        let area = (b - a).cross(&(c - a));
        for index in [i, j, k] {
            if let Some(vertex) = out.get_mut(index) {
                vertex.normal = (Vector3::from(vertex.normal) + area).into();
            }
        }
    }
    normalize(out);
    // A surface cut from a lattice has steps; the light should not show them.
    for _ in 0..NORMAL_PASSES {
        average(triangles, out);
        normalize(out);
    }
}

/// Adds to each normal those of its neighbours.
fn average(triangles: &[[u32; 3]], out: &mut [SurfaceVertex]) {
    let normals: Vec<[f32; 3]> = out.iter().map(|v| v.normal).collect();
    for triangle in triangles {
        let [i, j, k] = triangle.map(|index| index as usize);
        let (Some(a), Some(b), Some(c)) = (normals.get(i), normals.get(j), normals.get(k)) else {
            continue;
        };
        let sum = Vector3::from(*a) + Vector3::from(*b) + Vector3::from(*c);
        for index in [i, j, k] {
            if let Some(vertex) = out.get_mut(index) {
                vertex.normal = (Vector3::from(vertex.normal) + sum).into();
            }
        }
    }
}

fn normalize(vertices: &mut [SurfaceVertex]) {
    for vertex in vertices {
        let n = Vector3::from(vertex.normal);
        let length = n.norm();
        vertex.normal = if length > 0.0 {
            (n / length).into()
        } else {
            [0.0, 1.0, 0.0]
        };
    }
}

/// Only triangles whose vertices are all there, so that no index leaves the buffer.
pub fn indices(triangles: &[[u32; 3]], vertex_count: usize) -> Vec<u32> {
    triangles
        .iter()
        .filter(|t| t.iter().all(|&i| (i as usize) < vertex_count))
        .flatten()
        .copied()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_of_a_cube_points_outwards_and_bad_indices_are_left_out() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [0, 1, 99]];
        let mut out = Vec::new();
        surface(&positions, &triangles, &mut out);
        let n = Vector3::from(out[0].normal);
        assert!((n + Vector3::repeat(3.0_f32.sqrt().recip())).norm() < 1e-5, "{n}");
        assert_eq!(indices(&triangles, 4).len(), 9);
    }
}
