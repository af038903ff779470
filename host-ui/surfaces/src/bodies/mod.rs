//! Drawn surfaces of a scene: they follow the segmentation below the size of a cell and move with
//! the lattice.

mod bonds;
mod net;
mod relax;

use bonds::Bonds;
use net::Net;
use std::ops::Range;
use stylet_shm_schema::{GridInfo, SceneHeader, role};

/// Data of a scene from which surfaces are made.
#[derive(Clone, Copy)]
pub struct Segmentation<'a> {
    /// Counts, grids, structures.
    pub header: &'a SceneHeader,
    /// Label of each cell of `header.labels`: 0 outside, else one more than its index in the
    /// header's structures.
    pub labels: &'a [u8],
    /// Places at rest of the surface elements of the lattice, m.
    pub rest_m: &'a [[f32; 3]],
    /// Triangles between them.
    pub triangles: &'a [[u32; 3]],
}

/// Closed surfaces of the body and of the structures in it.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    /// Vertices at rest, scene frame, m.
    pub rest_m: Vec<[f32; 3]>,
    /// Vertices of each triangle, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The whole body first, then one part for each of [`shown_alone`].
    pub parts: Vec<Range<usize>>,
    /// Reference of the surfaces.
    pub follows: Follows,
    bonds: Bonds,
}

/// Reference of drawn surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follows {
    /// Cells of the segmentation: the middle of each cell lies on its own side of each surface.
    #[default]
    Segmentation,
    /// Middles of the outermost elements, because the core sends labels for only some of the cells:
    /// thinner parts would vanish.
    Lattice,
}

/// Returns the structures that have a surface of their own: index of the first in the header's
/// list, and which belong to it. The targets together are one; a body of one structure has none.
pub fn shown_alone(header: &SceneHeader) -> Vec<(usize, Vec<bool>)> {
    let structures = header.structures();
    if structures.len() < 2 {
        return Vec::new();
    }
    let has = |n: usize, bits: u32| structures[n].role & bits != 0;
    let first_target = (0..structures.len()).find(|&n| has(n, role::TARGET));
    let is_first = |n: &usize| match has(*n, role::TARGET) {
        true => first_target == Some(*n),
        false => has(*n, role::SPARE | role::FIXED) && structures[*n].element_count > 0,
    };
    let members = |n: usize| match has(n, role::TARGET) {
        true => (0..structures.len()).map(|m| has(m, role::TARGET)).collect(),
        false => (0..structures.len()).map(|m| m == n).collect(),
    };
    (0..structures.len())
        .filter(is_first)
        .map(|n| (n, members(n)))
        .collect()
}

/// Returns whether the core sends the label of every cell, so that surfaces can follow the
/// segmentation.
pub fn has_every_label(header: &SceneHeader) -> bool {
    (header.labels.spacing_m / header.spacing_m - 1.0).abs() < 1e-6
}

impl Bodies {
    /// Creates the surfaces. Takes tens of milliseconds: too long for a frame.
    pub fn of(scene: Segmentation) -> Self {
        Self::smooth(scene).unwrap_or_else(|| Self::of_lattice(scene))
    }

    /// Creates surfaces through the middles of the outermost elements, as the core cuts them.
    pub fn of_lattice(scene: Segmentation) -> Self {
        let header = scene.header;
        let alone = shown_alone(header).into_iter().map(|(n, _)| {
            let s = &header.structures()[n];
            (s.first_triangle as usize, s.triangle_count as usize)
        });
        let body = (0, header.body_triangle_count as usize);
        let count = scene.triangles.len();
        let range = |(first, count_of): (usize, usize)| first.min(count)..first.saturating_add(count_of).min(count);
        Self {
            rest_m: scene.rest_m.to_vec(),
            triangles: scene.triangles.to_vec(),
            parts: std::iter::once(body).chain(alone).map(range).collect(),
            follows: Follows::Lattice,
            bonds: Bonds::default(),
        }
    }

    /// Creates smooth surfaces; `None` if the core did not send the label of every cell.
    fn smooth(scene: Segmentation) -> Option<Self> {
        let (header, grid) = (scene.header, scene.header.labels);
        let is_whole = grid.node_count() == Some(scene.labels.len()) && !scene.labels.is_empty();
        if !is_whole || !has_every_label(header) {
            return None;
        }
        let mut bodies = Self::default();
        let elements = bonds::elements_of_cells(&grid, scene.rest_m);
        bodies.push(&grid, scene.labels, |label| label != 0, &elements)?;
        for (_, members) in shown_alone(header) {
            let is_in = |label: u8| {
                label
                    .checked_sub(1)
                    .is_some_and(|n| members.get(usize::from(n)) == Some(&true))
            };
            bodies.push(&grid, scene.labels, is_in, &elements)?;
        }
        Some(bodies)
    }

    /// Adds a structure; returns `None` if a vertex has no element to move with.
    fn push(&mut self, grid: &GridInfo, labels: &[u8], is_in: impl Fn(u8) -> bool, elements: &[u32]) -> Option<()> {
        let mut net = Net::of(grid.dims.map(|d| d as usize), labels, is_in);
        relax::relax(&mut net);
        for (point, cube) in net.points.iter().zip(&net.cubes) {
            self.bonds.push(grid, elements, *cube, *point)?;
        }
        let (vertices, first) = (self.rest_m.len() as u32, self.triangles.len());
        let place = |p: &[f32; 3]| [0, 1, 2].map(|a| (grid.origin_m[a] + f64::from(p[a]) * grid.spacing_m) as f32);
        self.rest_m.extend(net.points.iter().map(place));
        self.triangles
            .extend(net.triangles.iter().map(|t| t.map(|v| v + vertices)));
        self.parts.push(first..self.triangles.len());
        Some(())
    }

    /// Computes the vertices while the surface elements of the lattice are at `now_m`, replacing
    /// the content of `out`.
    pub fn deformed(&self, rest_m: &[[f32; 3]], now_m: &[[f32; 3]], out: &mut Vec<[f32; 3]>) {
        out.clear();
        match self.follows {
            Follows::Lattice => out.extend_from_slice(now_m),
            Follows::Segmentation => self.bonds.moved(&self.rest_m, rest_m, now_m, out),
        }
    }
}

#[cfg(test)]
mod tests;
