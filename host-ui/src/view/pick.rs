//! The place of a surface under the pointer.

use nalgebra::Vector3;
use stylet_surfaces::mesh::SurfaceVertex;

/// Returns the nearest place where a ray meets a triangle, from in front or from behind (Möller and
/// Trumbore).
pub fn pick(
    vertices: &[SurfaceVertex],
    triangles: &[[u32; 3]],
    eye_m: Vector3<f32>,
    ray: Vector3<f32>,
) -> Option<Vector3<f32>> {
    let met = |triangle: &[u32; 3]| {
        let corner = |i: usize| vertices.get(triangle[i] as usize).map(|v| Vector3::from(v.place_m));
        way(corner(0)?, corner(1)?, corner(2)?, eye_m, ray)
    };
    let nearest = triangles.iter().filter_map(met).min_by(f32::total_cmp)?;
    Some(eye_m + ray * nearest)
}

/// Returns the distance along the ray to the triangle.
fn way(a: Vector3<f32>, b: Vector3<f32>, c: Vector3<f32>, eye_m: Vector3<f32>, ray: Vector3<f32>) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = ray.cross(&ac);
    let volume = ab.dot(&p);
    // Areas of triangles are of the order of a square millimetre, and a ray in a triangle's plane
    // misses it.
    if volume.abs() < 1e-14 {
        return None;
    }
    let from_a = eye_m - a;
    let u = from_a.dot(&p) / volume;
    let q = from_a.cross(&ab);
    let v = ray.dot(&q) / volume;
    let way = ac.dot(&q) / volume;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && way > 0.0).then_some(way)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_the_nearest_of_two_walls() {
        let at = |x: f32, y: f32, z: f32| SurfaceVertex {
            place_m: [x, y, z],
            normal: [0.0; 3],
        };
        let mut vertices = Vec::new();
        for z in [0.02, 0.01] {
            vertices.extend([at(-0.01, -0.01, z), at(0.02, -0.01, z), at(-0.01, 0.02, z)]);
        }
        let triangles = [[0, 1, 2], [5, 4, 3], [0, 1, 77]];
        let eye = Vector3::new(0.0, 0.0, -0.05);
        let ray = Vector3::new(0.02, 0.01, 1.0).normalize();
        let met = pick(&vertices, &triangles, eye, ray).expect("met");
        assert!((met - Vector3::new(0.0012, 0.0006, 0.01)).norm() < 1e-6, "{met}");
        assert_eq!(pick(&vertices, &triangles, eye, -ray), None);
        assert_eq!(pick(&vertices, &triangles, eye, Vector3::x()), None);
    }
}
