//! Closed triangle meshes over the elements at the surface of a body and of the structures in it.

use std::collections::BTreeMap;
use std::ops::Range;

use super::{Lattice, Role, Structure};

/// Triangle meshes over the body and over the structures inside it that are looked at, each closed and oriented
/// outward: each directed edge is matched by its opposite.
///
/// Parts that are one element thick have no inside between their two faces: those triangles cancel, and
/// their elements stay as vertices without triangles.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Every element on one of the surfaces, in the order of elements.
    pub vertex_elements: Vec<u32>,
    /// Place of each vertex at rest: the centre of its element, m.
    pub rest_m: Vec<[f32; 3]>,
    /// The element of a coarser body that each vertex goes with; empty where bodies are not coarser.
    pub moved_by: Vec<u32>,
    /// Indices into `vertex_elements`: the body's first, then the parts'.
    pub triangles: Vec<[u32; 3]>,
    /// Number of triangles of the body.
    pub body_triangles: usize,
    /// Elements on the surface of the body.
    pub body_elements: usize,
    /// One for the targets together, one for each structure that is spared or fixed; none in a body of one structure.
    pub parts: Vec<SurfacePart>,
}

/// Triangles of one structure's own surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SurfacePart {
    /// Number of the structure in the scene's list; the first one where several are one part.
    pub structure: u8,
    /// Its triangles, as indices into [`Surface::triangles`].
    pub triangles: Range<usize>,
}

/// Returns the elements of a part of the body with at least one of their six neighbours not in it.
fn boundary(lattice: &Lattice, is_in: impl Fn(u32) -> bool) -> Vec<u32> {
    let inner = |neighbour: &Option<u32>| neighbour.is_some_and(&is_in);
    (0..lattice.element_count() as u32)
        .filter(|&element| is_in(element) && !lattice.neighbours(element).iter().all(inner))
        .collect()
}

/// Corners of the six faces of a cube, anticlockwise seen from outside; corner = dx + 2 dy + 4 dz.
const FACES: [[usize; 4]; 6] = [
    [0, 4, 6, 2],
    [1, 3, 7, 5],
    [0, 1, 5, 4],
    [2, 6, 7, 3],
    [0, 2, 3, 1],
    [4, 5, 7, 6],
];

const NONE: u32 = u32::MAX;

impl Surface {
    /// Surfaces of a body and of the structures in it that are shown by themselves.
    pub fn of(lattice: &Lattice, structures: &[Structure]) -> Self {
        let mut meshes = vec![(0, Mesh::of(lattice, |_| true))];
        for (first, members) in parts_of(structures) {
            let mesh = Mesh::of(lattice, |element| members[lattice.structure(element) as usize]);
            meshes.push((first, mesh));
        }
        let mut surface = Surface::joined(&meshes);
        let centre_m = |&e: &u32| lattice.rest_m(e).map(|c| c as f32);
        surface.rest_m = surface.vertex_elements.iter().map(centre_m).collect();
        surface
    }

    /// Vertices go with the elements of `body`, which is `lattice` or coarser.
    pub(super) fn move_with(&mut self, lattice: &Lattice, body: &Lattice) {
        self.moved_by.clear();
        if lattice.spacing_m != body.spacing_m {
            let around = |&e: &u32| body.element_at_rest(lattice.rest_m(e)).unwrap_or(0);
            self.moved_by = self.vertex_elements.iter().map(around).collect();
        }
    }

    /// Joins meshes, so that the same element is the same vertex in all of them.
    fn joined(meshes: &[(u8, Mesh)]) -> Self {
        let mut vertex_elements: Vec<u32> = meshes.iter().flat_map(|(_, m)| &m.vertex_elements).copied().collect();
        vertex_elements.sort_unstable();
        vertex_elements.dedup();
        let mut triangles = Vec::with_capacity(meshes.iter().map(|(_, m)| m.triangles.len()).sum());
        let mut parts = Vec::new();
        for (structure, mesh) in meshes {
            let vertex_of = |element: &u32| vertex_elements.partition_point(|e| e < element) as u32;
            let joined: Vec<u32> = mesh.vertex_elements.iter().map(vertex_of).collect();
            let start = triangles.len();
            triangles.extend(mesh.triangles.iter().map(|t| t.map(|vertex| joined[vertex as usize])));
            parts.push(SurfacePart {
                structure: *structure,
                triangles: start..triangles.len(),
            });
        }
        let body = parts.remove(0);
        Surface {
            vertex_elements,
            rest_m: Vec::new(),
            moved_by: Vec::new(),
            triangles,
            body_triangles: body.triangles.len(),
            body_elements: meshes[0].1.vertex_elements.len(),
            parts,
        }
    }
}

/// Returns the structures that have a surface of their own: number of the first, and which are in it.
fn parts_of(structures: &[Structure]) -> Vec<(u8, Vec<bool>)> {
    if structures.len() < 2 {
        return Vec::new();
    }
    let is_target = |s: &Structure| s.role == Role::Target;
    let targets: Vec<bool> = structures.iter().map(is_target).collect();
    let target = structures
        .iter()
        .position(is_target)
        .map(|first| (first as u8, targets));
    let is_looked_at = |s: &Structure| s.role == Role::Spare || (s.material.fixed && s.role != Role::Target);
    let others = structures.iter().enumerate().filter(|(_, s)| is_looked_at(s));
    let alone = |number: usize| (0..structures.len()).map(|n| n == number).collect();
    target
        .into_iter()
        .chain(others.map(|(number, _)| (number as u8, alone(number))))
        .collect()
}

/// The surface of one part of the body.
struct Mesh {
    vertex_elements: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Runs marching cubes on the occupancy, each vertex moved onto the inside end of its cube edge.
    fn of(lattice: &Lattice, is_in: impl Fn(u32) -> bool) -> Self {
        let vertex_elements = boundary(lattice, &is_in);
        let mut vertex_of_element = vec![NONE; lattice.element_count()];
        for (vertex, &element) in vertex_elements.iter().enumerate() {
            vertex_of_element[element as usize] = vertex as u32;
        }
        let mut triangles = Vec::new();
        for (vertex, &element) in vertex_elements.iter().enumerate() {
            let cell = lattice.cell(element).map(|c| c as i64);
            for corner in 0..8 {
                let base = [0, 1, 2].map(|axis| cell[axis] - (corner >> axis & 1));
                let corners: Corners = std::array::from_fn(|corner| {
                    let cell = [0, 1, 2].map(|axis| base[axis] + (corner as i64 >> axis & 1));
                    let element = lattice.element_at(cell).filter(|&e| is_in(e))?;
                    Some(vertex_of_element[element as usize])
                });
                if lowest_vertex(&corners) == Some(vertex as u32) {
                    push_cube(&corners, &mut triangles);
                }
            }
        }
        Mesh {
            vertex_elements,
            triangles: without_opposites(triangles),
        }
    }
}

/// Corners of a cube: nothing, an element inside the part (`Some(NONE)`) or a surface vertex.
type Corners = [Option<u32>; 8];

/// Returns the vertex that handles a cube, so that each cube is handled once.
fn lowest_vertex(corners: &Corners) -> Option<u32> {
    let vertices = corners.iter().flatten().copied();
    vertices.filter(|&vertex| vertex != NONE).min()
}

/// Cuts of the cube's edges, joined across each face into loops, each loop filled by a fan.
///
/// On a face with two inside corners opposite each other the corners are kept apart; the rule looks at
/// the face alone, so the two cubes that share it agree.
fn push_cube(corners: &Corners, triangles: &mut Vec<[u32; 3]>) {
    let mut next = [[None; 8]; 8]; // [inside corner][outside corner] of a cut edge -> next cut edge
    for face in FACES {
        for start in 0..4 {
            let (before, first) = (face[(start + 3) % 4], face[start]);
            if corners[before].is_some() || corners[first].is_none() {
                continue;
            }
            let mut end = start;
            while corners[face[(end + 1) % 4]].is_some() {
                end += 1;
            }
            next[face[end % 4]][face[(end + 1) % 4]] = Some((first, before));
        }
    }
    for inside in 0..8 {
        for outside in 0..8 {
            push_loop(corners, &mut next, (inside, outside), triangles);
        }
    }
}

fn push_loop(
    corners: &Corners,
    next: &mut [[Option<(usize, usize)>; 8]; 8],
    start: (usize, usize),
    triangles: &mut Vec<[u32; 3]>,
) {
    let mut polygon: Vec<u32> = Vec::with_capacity(12);
    let mut cut = start;
    while let Some(following) = next[cut.0][cut.1].take() {
        if let Some(vertex) = corners[cut.0]
            && polygon.last() != Some(&vertex)
        {
            polygon.push(vertex);
        }
        cut = following;
    }
    for pair in polygon.windows(2).skip(1) {
        let [a, b, c] = [polygon[0], pair[1], pair[0]];
        if a != b && b != c && c != a {
            triangles.push([a, b, c]);
        }
    }
}

/// Drops each pair of triangles that cover each other with opposite orientation.
fn without_opposites(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut balance: BTreeMap<[u32; 3], i32> = BTreeMap::new();
    for &triangle in &triangles {
        let (key, sign) = unoriented(triangle);
        *balance.entry(key).or_default() += sign;
    }
    let mut kept = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let (key, sign) = unoriented(triangle);
        if let Some(left) = balance.get_mut(&key)
            && *left * sign > 0
        {
            *left -= sign;
            kept.push(triangle);
        }
    }
    kept
}

/// Returns the triangle's vertices in ascending order, and whether that order turns the same way.
fn unoriented([a, b, c]: [u32; 3]) -> ([u32; 3], i32) {
    let mut key = [a, b, c];
    key.sort_unstable();
    let same_turn = [[a, b, c], [b, c, a], [c, a, b]].contains(&key);
    (key, if same_turn { 1 } else { -1 })
}

#[cfg(test)]
mod tests;
