//! The gland's surface for the graphics card: positions with smooth normals, indices. Only the
//! moving part is computed again.

pub mod coarse;
pub mod cut;

use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;
use std::ops::Range;

/// Smoothing passes of the normals, because a surface cut from a lattice has steps that light must
/// not show.
const SMOOTHINGS: usize = 2;
/// Smallest visible motion, a twentieth of a pixel, if a body of 100 mm fills a picture of 500
/// pixels.
const SEEN_M: f32 = 1e-5;
/// Longest gap between runs of vertices that are sent as one.
const GAP: usize = 64;

/// Vertex for the graphics card.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SurfaceVertex {
    /// Place in the scene frame.
    pub place_m: [f32; 3],
    /// Normal, not of unit length: the shader normalises.
    pub normal: [f32; 3],
}

/// Triangles about vertices that move.
#[derive(Debug, Default)]
pub struct Surface {
    vertices: Vec<SurfaceVertex>,
    /// Triangles whose vertices all exist.
    triangles: Vec<[u32; 3]>,
    /// Offsets: `triangles_of[first_of[v]..first_of[v + 1]]` have the vertex v.
    first_of: Vec<u32>,
    triangles_of: Vec<u32>,
    /// Unit normals before the smoothing, and after each pass but the last, which are those of the
    /// vertices.
    normals: [Vec<[f32; 3]>; SMOOTHINGS],
    near: VertexSet,
}

/// Set of vertices.
#[derive(Debug, Default)]
struct VertexSet {
    vertices: Vec<u32>,
    has: Vec<bool>,
}

impl Surface {
    /// Creates a surface; leaves out triangles with a missing vertex.
    pub fn new(positions_m: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        let count = positions_m.len();
        let triangles: Vec<[u32; 3]> = whole(triangles, count).collect();
        let mut first_of = vec![0_u32; count + 1];
        for &vertex in triangles.iter().flatten() {
            first_of[vertex as usize + 1] += 1;
        }
        for v in 0..count {
            first_of[v + 1] += first_of[v];
        }
        let mut next = first_of.clone();
        let mut triangles_of = vec![0; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for &vertex in triangle {
                let slot = &mut next[vertex as usize];
                triangles_of[*slot as usize] = t as u32;
                *slot += 1;
            }
        }
        let vertex = |&place_m: &[f32; 3]| SurfaceVertex {
            place_m,
            normal: [0.0; 3],
        };
        let mut surface = Self {
            vertices: positions_m.iter().map(vertex).collect(),
            triangles,
            first_of,
            triangles_of,
            normals: std::array::from_fn(|_| vec![[0.0; 3]; count]),
            near: VertexSet {
                vertices: (0..count as u32).collect(),
                has: vec![false; count],
            },
        };
        surface.light();
        surface
    }

    /// Returns the vertices with their normals, in the order of the positions.
    pub fn vertices(&self) -> &[SurfaceVertex] {
        &self.vertices
    }

    /// Like [`Self::vertices`].
    pub fn into_vertices(self) -> Vec<SurfaceVertex> {
        self.vertices
    }

    /// Returns the runs of vertices that have changed; none if nothing has moved. A vertex stays
    /// until its place is farther away than 10 um: otherwise creeping tissue would redraw the
    /// picture in each frame.
    pub fn move_to(&mut self, positions_m: &[[f32; 3]]) -> Vec<Range<usize>> {
        self.near.vertices.clear();
        for ((vertex, place_m), number) in self.vertices.iter_mut().zip(positions_m).zip(0..) {
            let away_m = [0, 1, 2].map(|a| (vertex.place_m[a] - place_m[a]).abs());
            if away_m.iter().any(|a| *a > SEEN_M) {
                vertex.place_m = *place_m;
                self.near.vertices.push(number);
            }
        }
        if self.near.vertices.is_empty() {
            return Vec::new();
        }
        self.light();
        self.near.runs()
    }

    /// Updates the normals about moved vertices, which reach one triangle farther with each pass.
    fn light(&mut self) {
        self.spread();
        for &v in &self.near.vertices {
            self.normals[0][v as usize] = unit(self.area(v));
        }
        for pass in 0..SMOOTHINGS {
            self.spread();
            for n in 0..self.near.vertices.len() {
                let v = self.near.vertices[n] as usize;
                let normal = unit(self.smoothed(v as u32, pass));
                match self.normals.get_mut(pass + 1) {
                    Some(next) => next[v] = normal,
                    None => self.vertices[v].normal = normal,
                }
            }
        }
    }

    /// Extends the set to the vertices of all adjacent triangles.
    fn spread(&mut self) {
        let VertexSet { vertices, has } = &mut self.near;
        for &v in vertices.iter() {
            has[v as usize] = true;
        }
        for n in 0..vertices.len() {
            let v = vertices[n] as usize;
            for &t in &self.triangles_of[self.first_of[v] as usize..self.first_of[v + 1] as usize] {
                for &u in &self.triangles[t as usize] {
                    if !std::mem::replace(&mut has[u as usize], true) {
                        vertices.push(u);
                    }
                }
            }
        }
        for &v in vertices.iter() {
            has[v as usize] = false;
        }
    }

    fn about(&self, v: u32) -> impl Iterator<Item = [usize; 3]> {
        let [from, to] = [v as usize, v as usize + 1].map(|n| self.first_of[n] as usize);
        let of = self.triangles_of[from..to].iter();
        of.map(|&t| self.triangles[t as usize].map(|u| u as usize))
    }

    /// Returns the sum of the area vectors of the triangles about a vertex.
    fn area(&self, v: u32) -> Vector3<f32> {
        let place = |u: usize| Vector3::from(self.vertices[u].place_m);
        self.about(v)
            .map(|[a, b, c]| (place(b) - place(a)).cross(&(place(c) - place(a))))
            .fold(Vector3::zeros(), |sum, area| sum + area)
    }

    /// Returns the normal of a vertex and those of its neighbours, one for each triangle that they
    /// share.
    fn smoothed(&self, v: u32, pass: usize) -> Vector3<f32> {
        let normals = &self.normals[pass];
        let normal = |u: usize| Vector3::from(normals[u]);
        self.about(v)
            .map(|[a, b, c]| normal(a) + normal(b) + normal(c))
            .fold(normal(v as usize), |sum, of| sum + of)
    }
}

impl VertexSet {
    fn runs(&mut self) -> Vec<Range<usize>> {
        self.vertices.sort_unstable();
        let mut runs: Vec<Range<usize>> = Vec::new();
        for &v in &self.vertices {
            let v = v as usize;
            match runs.last_mut() {
                Some(run) if v <= run.end + GAP => run.end = v + 1,
                _ => runs.push(v..v + 1),
            }
        }
        runs
    }
}

fn unit(v: Vector3<f32>) -> [f32; 3] {
    let length = v.norm();
    match length > 0.0 {
        true => (v / length).into(),
        false => [0.0, 1.0, 0.0],
    }
}

fn whole(triangles: &[[u32; 3]], vertex_count: usize) -> impl Iterator<Item = [u32; 3]> {
    let is_whole = move |t: &&[u32; 3]| t.iter().all(|&i| (i as usize) < vertex_count);
    triangles.iter().filter(is_whole).copied()
}

/// Returns the indices of triangles whose vertices all exist, so that no index leaves the buffer.
pub fn indices(triangles: &[[u32; 3]], vertex_count: usize) -> Vec<u32> {
    whole(triangles, vertex_count).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_of_a_cube_points_outwards_and_bad_indices_are_left_out() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [0, 1, 99]];
        let surface = Surface::new(&positions, &triangles);
        let n = Vector3::from(surface.vertices()[0].normal);
        assert!((n + Vector3::repeat(3.0_f32.sqrt().recip())).norm() < 1e-5, "{n}");
        assert_eq!(indices(&triangles, 4).len(), 9);
    }

    /// Returns a sheet of `side` by `side` vertices, and one vertex that belongs to nothing.
    fn sheet(side: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let place = |n: u32| [(n % side) as f32, (n / side) as f32, (n as f32 * 0.7).sin()];
        let mut positions: Vec<[f32; 3]> = (0..side * side).map(place).collect();
        positions.push([9.0; 3]);
        let mut triangles = Vec::new();
        for y in 0..side - 1 {
            for x in 0..side - 1 {
                let at = y * side + x;
                triangles.push([at, at + 1, at + side]);
                triangles.push([at + 1, at + side + 1, at + side]);
            }
        }
        (positions, triangles)
    }

    /// Compares with a new surface, bit by bit; the runs cover everything that changed.
    #[test]
    fn a_surface_that_moved_is_that_of_a_new_one() {
        let (mut positions, triangles) = sheet(40);
        let mut surface = Surface::new(&positions, &triangles);
        assert_eq!(surface.move_to(&positions), Vec::new());
        for moved in [
            vec![0],
            vec![820, 821, 860],
            (0..1601).collect(),
            vec![1600],
            vec![39, 1599],
        ] {
            let before = surface.vertices().to_vec();
            for &v in &moved {
                positions[v][2] += 0.3;
            }
            let runs = surface.move_to(&positions);
            let rebuilt = Surface::new(&positions, &triangles);
            assert_eq!(surface.vertices(), rebuilt.vertices(), "{} moved", moved.len());
            let is_other = |v: &usize| before[*v] != surface.vertices()[*v];
            let missed = (0..before.len())
                .filter(is_other)
                .find(|v| !runs.iter().any(|run| run.contains(v)));
            assert_eq!(missed, None, "{runs:?}");
            let sent: usize = runs.iter().map(|run| run.len()).sum();
            // Area and two smoothings reach one row farther each, in both directions.
            let rows: std::collections::BTreeSet<usize> = moved.iter().map(|v| v / 40).collect();
            assert!(sent <= rows.len() * 7 * 40, "{sent} are sent for {} rows", rows.len());
        }
    }
}
