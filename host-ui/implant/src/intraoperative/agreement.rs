//! Agreement of two bodies: overlap, and the distance of their surfaces.

use crate::plan::anatomy::Body;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Pitch of the points at which inside and outside are compared, m.
const PITCH_M: f64 = 0.8e-3;
/// Most points of a surface whose distance to the other one is taken.
const PLACES: usize = 2000;

/// Agreement of two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Twice the common volume over the sum of both (Dice 1945): 1 if they are equal, 0 if they are
    /// disjoint.
    pub dice: f64,
    /// Mean distance of the surfaces, from both sides, by area, m.
    pub mean_m: f64,
    /// Largest distance of a point of one surface from the other, m.
    pub hausdorff_m: f64,
    /// Volumes of the first and the second body, m³.
    pub volumes_m3: [f64; 2],
}

impl Agreement {
    /// Compares two bodies; `None` if one of them has no volume.
    pub fn of(first: &Body, second: &Body) -> Option<Self> {
        let ((low_a, high_a), (low_b, high_b)) = (first.bounds_m(), second.bounds_m());
        let low_m = [0, 1, 2].map(|a| low_a[a].min(low_b[a]));
        let counts = [0, 1, 2].map(|a| ((high_a[a].max(high_b[a]) - low_m[a]) / PITCH_M).ceil() as usize + 1);
        let in_layer = |k: usize| {
            let mut sums = [0_usize; 3];
            for (i, j) in (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| (i, j))) {
                let at = [i, j, k];
                let place_m = [0, 1, 2].map(|a| low_m[a] + (at[a] as f64 + 0.5) * PITCH_M);
                let is_in = [first, second].map(|body| body.contains(place_m));
                let both = is_in[0] && is_in[1];
                [is_in[0], is_in[1], both]
                    .iter()
                    .zip(&mut sums)
                    .for_each(|(is, sum)| *sum += usize::from(*is));
            }
            sums
        };
        let add = |a: [usize; 3], b: [usize; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let [a, b, both] = (0..counts[2]).into_par_iter().map(in_layer).reduce(|| [0; 3], add);
        if a == 0 || b == 0 {
            return None;
        }
        let surfaces = [first, second].map(Triangles::of);
        let [(there_m, there_m2, farthest), (back_m, back_m2, farthest_back)] =
            [surfaces[0].off(&surfaces[1]), surfaces[1].off(&surfaces[0])];
        Some(Self {
            dice: 2.0 * both as f64 / (a + b) as f64,
            mean_m: (there_m + back_m) / (there_m2 + back_m2),
            hausdorff_m: farthest.max(farthest_back),
            volumes_m3: [a, b].map(|n| n as f64 * PITCH_M.powi(3)),
        })
    }
}

/// Triangles of a surface.
struct Triangles(Vec<[Vector3<f64>; 3]>);

impl Triangles {
    fn of(body: &Body) -> Self {
        let (corners_m, faces) = body.closed_surface();
        Self(
            faces
                .iter()
                .map(|face| face.map(|n| Vector3::from(corners_m[n])))
                .collect(),
        )
    }

    /// Returns the sum over points of this surface of area times distance from another, the sum of
    /// area, and the largest distance.
    fn off(&self, other: &Self) -> (f64, f64, f64) {
        let every = self.0.len().div_ceil(PLACES).max(1);
        let of = |[a, b, c]: &[Vector3<f64>; 3]| {
            let area_m2 = (b - a).cross(&(c - a)).norm() / 2.0;
            let off_m = other.off_m((a + b + c) / 3.0);
            (area_m2 * off_m, area_m2, off_m)
        };
        let add = |a: (f64, f64, f64), b: (f64, f64, f64)| (a.0 + b.0, a.1 + b.1, a.2.max(b.2));
        // Summed in order: partial sums in any order would round differently each time.
        let each: Vec<_> = self.0.par_iter().step_by(every).map(of).collect();
        each.into_iter().fold((0.0, 0.0, 0.0), add)
    }

    fn off_m(&self, place_m: Vector3<f64>) -> f64 {
        let square = |triangle: &[Vector3<f64>; 3]| (nearest(place_m, triangle) - place_m).norm_squared();
        self.0.iter().map(square).fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// Returns the point of a triangle nearest to a place (Ericson, Real-Time Collision Detection,
/// 2005, 5.1.5).
fn nearest(place: Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let (ab, ac, ap) = (b - a, c - a, place - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = place - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = place - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        return *a;
    }
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::anatomy::ball;

    /// Compares a ball within a ball, and one next to it, with the closed form.
    #[test]
    fn the_agreement_of_balls_matches_the_closed_form() {
        let middle = [0.05, 0.04, 0.06];
        let (small, large) = (ball("small", middle, [0.018; 3]), ball("large", middle, [0.020; 3]));
        let found = Agreement::of(&small, &large).expect("two bodies");
        let (a, b) = (0.018_f64.powi(3), 0.020_f64.powi(3));
        assert!((found.dice - 2.0 * a / (a + b)).abs() < 5e-3, "{found:?}");
        assert!(
            (found.mean_m - 2e-3).abs() < 0.1e-3 && (found.hausdorff_m - 2e-3).abs() < 0.1e-3,
            "{found:?}"
        );
        let beside = ball("beside", [0.053, 0.04, 0.06], [0.020; 3]);
        let found = Agreement::of(&large, &beside).expect("two bodies");
        // The common part of two balls of one radius is two caps; the distance from a ball that is
        // shifted by 3 mm is 3 mm at most.
        let (r, d) = (0.020_f64, 0.003_f64);
        let both = std::f64::consts::PI / 12.0 * (4.0 * r + d) * (2.0 * r - d).powi(2);
        let one = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        assert!((found.dice - both / one).abs() < 5e-3, "{found:?} {}", both / one);
        // Mean of | 3 mm cos | over a ball: half of it, and a little for the curvature.
        assert!((found.mean_m - 1.5e-3).abs() < 0.1e-3, "{found:?}");
        assert!((found.hausdorff_m - 3e-3).abs() < 0.1e-3, "{found:?}");
        assert_eq!(
            Agreement::of(&large, &ball("far", [0.3, 0.0, 0.0], [0.01; 3])).map(|f| f.dice),
            Some(0.0)
        );
    }

    #[test]
    fn the_nearest_point_of_a_triangle_matches_a_fine_grid() {
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]].map(Vector3::from);
        for place in [
            [0.4, 0.3, 0.5],
            [-0.5, -0.2, 0.1],
            [1.5, 0.1, 0.0],
            [0.2, 1.4, 0.3],
            [0.7, -0.4, 0.2],
            [-0.4, 0.6, 0.1],
            [0.9, 0.9, 0.0],
        ] {
            let place = Vector3::from(place);
            let on_grid =
                (0..=200).flat_map(|i| (0..=200 - i).map(move |j| (f64::from(i) / 200.0, f64::from(j) / 200.0)));
            let tried = on_grid.map(|(u, v)| triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v);
            let least = tried.map(|p| (p - place).norm()).fold(f64::INFINITY, f64::min);
            let found = (nearest(place, &triangle) - place).norm();
            assert!(found <= least + 1e-12 && found > least - 5e-3, "{found} {least}");
        }
    }
}
