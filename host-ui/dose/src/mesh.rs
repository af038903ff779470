//! A closed triangle mesh as a region.

use super::error::DoseError;
use super::structure::{Region, bounds};

/// Triangles, sorted into columns along x, so that a ray meets only those of its column.
pub struct Mesh {
    low_m: [f64; 3],
    high_m: [f64; 3],
    columns: [usize; 2],
    /// Triangles of each column, row by row over y and z.
    triangles: Vec<Vec<[[f64; 3]; 3]>>,
}

impl Mesh {
    /// Creates a region. The mesh must be closed: each edge of a triangle belongs to exactly one
    /// other triangle, in the opposite direction.
    pub fn new(points_m: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<Self, DoseError> {
        check_closed(points_m, triangles)?;
        let (low_m, high_m) = bounds(points_m);
        let per_side = ((triangles.len() as f64).sqrt() as usize).clamp(1, 512);
        let columns = [per_side; 2];
        let mut mesh = Self {
            low_m,
            high_m,
            columns,
            triangles: vec![Vec::new(); per_side * per_side],
        };
        for t in triangles {
            let corners = t.map(|i| points_m[i]);
            let (low, high) = bounds(&corners);
            let (from, to) = (mesh.column(low), mesh.column(high));
            for z in from[1]..=to[1] {
                for y in from[0]..=to[0] {
                    mesh.triangles[z * columns[0] + y].push(corners);
                }
            }
        }
        Ok(mesh)
    }

    fn column(&self, point: [f64; 3]) -> [usize; 2] {
        [0, 1].map(|c| {
            let (low, high) = (self.low_m[c + 1], self.high_m[c + 1]);
            let share = (point[c + 1] - low) / (high - low).max(f64::MIN_POSITIVE);
            ((share * self.columns[c] as f64) as usize).min(self.columns[c] - 1)
        })
    }
}

impl Region for Mesh {
    fn bounds_m(&self) -> ([f64; 3], [f64; 3]) {
        (self.low_m, self.high_m)
    }

    fn contains(&self, point: [f64; 3]) -> bool {
        if (0..3).any(|a| point[a] < self.low_m[a] || point[a] > self.high_m[a]) {
            return false;
        }
        let [y, z] = self.column(point);
        let met = self.triangles[z * self.columns[0] + y]
            .iter()
            .filter(|t| is_before(point, t))
            .count();
        met % 2 == 1
    }
}

/// Returns whether the ray from the point towards +x goes through the triangle.
fn is_before(p: [f64; 3], [a, b, c]: &[[f64; 3]; 3]) -> bool {
    // Twice the area on the y-z plane that the point spans with an edge; edges common to two
    // triangles give the same number.
    let span = |u: &[f64; 3], v: &[f64; 3]| (u[1] - p[1]) * (v[2] - p[2]) - (u[2] - p[2]) * (v[1] - p[1]);
    let (wa, wb, wc) = (span(b, c), span(c, a), span(a, b));
    let all = wa + wb + wc;
    let same_side = (wa >= 0.0) == (wb >= 0.0) && (wb >= 0.0) == (wc >= 0.0);
    same_side && all != 0.0 && (wa * a[0] + wb * b[0] + wc * c[0]) / all > p[0]
}

fn check_closed(points_m: &[[f64; 3]], triangles: &[[usize; 3]]) -> Result<(), DoseError> {
    if triangles.is_empty() || triangles.iter().flatten().any(|&i| i >= points_m.len()) {
        return Err(DoseError::Mesh(
            "the mesh has no triangles, or a triangle with a missing corner",
        ));
    }
    if points_m.iter().flatten().any(|v| !v.is_finite()) {
        return Err(DoseError::Mesh("the mesh has a corner that is not a number"));
    }
    let edges = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let mut forward: Vec<(usize, usize)> = edges.clone().collect();
    let mut backward: Vec<(usize, usize)> = edges.map(|(a, b)| (b, a)).collect();
    forward.sort_unstable();
    backward.sort_unstable();
    if forward != backward {
        return Err(DoseError::Mesh(
            "the mesh is not closed, or some of its triangles are turned inside out",
        ));
    }
    Ok(())
}
