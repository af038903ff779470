//! The closed triangle mesh over the surface elements of a lattice.

use std::collections::BTreeMap;

use super::Lattice;

/// Closed and oriented outward: each directed edge is matched by its opposite.
///
/// Parts that are one element thick have no inside between their two faces: those triangles cancel, and
/// their elements stay as vertices without triangles.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Every surface element, in the order of elements.
    pub vertex_elements: Vec<u32>,
    /// Indices into `vertex_elements`.
    pub triangles: Vec<[u32; 3]>,
}

/// Elements with at least one of their six neighbours missing.
pub fn surface_elements(lattice: &Lattice) -> Vec<u32> {
    (0..lattice.element_count() as u32)
        .filter(|&element| lattice.neighbours(element).contains(&None))
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
    /// Marching cubes on the occupancy, each vertex moved onto the inside end of its cube edge.
    pub fn of(lattice: &Lattice) -> Self {
        let vertex_elements = surface_elements(lattice);
        let mut vertex_of_element = vec![NONE; lattice.element_count()];
        for (vertex, &element) in vertex_elements.iter().enumerate() {
            vertex_of_element[element as usize] = vertex as u32;
        }
        let mut triangles = Vec::new();
        for (vertex, &element) in vertex_elements.iter().enumerate() {
            let cell = lattice.cell(element).map(|c| c as i64);
            for corner in 0..8 {
                let base = [0, 1, 2].map(|axis| cell[axis] - (corner >> axis & 1));
                let corners = cube_corners(lattice, base, &vertex_of_element);
                if lowest_vertex(&corners) == Some(vertex as u32) {
                    push_cube(&corners, &mut triangles);
                }
            }
        }
        Surface {
            vertex_elements,
            triangles: without_opposites(triangles),
        }
    }
}

/// What is at a corner of a cube: nothing, an element inside the body (`Some(NONE)`) or a surface vertex.
type Corners = [Option<u32>; 8];

fn cube_corners(lattice: &Lattice, base: [i64; 3], vertex_of_element: &[u32]) -> Corners {
    std::array::from_fn(|corner| {
        let cell = [0, 1, 2].map(|axis| base[axis] + (corner as i64 >> axis & 1));
        let element = lattice.element_at(cell)?;
        Some(vertex_of_element[element as usize])
    })
}

/// The vertex that handles a cube, so that each cube is handled once.
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

/// The triangle's vertices in ascending order, and whether that order turns the same way.
fn unoriented([a, b, c]: [u32; 3]) -> ([u32; 3], i32) {
    let mut key = [a, b, c];
    key.sort_unstable();
    let same_turn = [[a, b, c], [b, c, a], [c, a, b]].contains(&key);
    (key, if same_turn { 1 } else { -1 })
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
