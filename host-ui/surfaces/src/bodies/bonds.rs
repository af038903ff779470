//! Bonds of each vertex: the lattice elements it moves with, and their weights.

use stylet_shm_schema::GridInfo;

const NONE: u32 = u32::MAX;
/// Weight added to each share, so that a vertex near the middle of an element without a place still
/// moves with the others.
const LEAST: f32 = 1e-3;

/// Surface elements of each vertex, with shares that sum to one.
#[derive(Clone, Debug, Default)]
pub struct Bonds {
    /// Ends of the bonds of each vertex.
    ends: Vec<u32>,
    bonds: Vec<(u32, f32)>,
}

/// Returns the surface element in each cell of the grid.
pub fn elements_of_cells(grid: &GridInfo, rest_m: &[[f32; 3]]) -> Vec<u32> {
    let dims = grid.dims.map(i64::from);
    let mut elements = vec![NONE; grid.node_count().unwrap_or(0)];
    for (number, place_m) in rest_m.iter().enumerate() {
        let cell = [0, 1, 2].map(|a| ((f64::from(place_m[a]) - grid.origin_m[a]) / grid.spacing_m).round() as i64);
        if let Some(n) = number_of(dims, cell) {
            elements[n] = number as u32;
        }
    }
    elements
}

fn number_of(dims: [i64; 3], cell: [i64; 3]) -> Option<usize> {
    let is_there = (0..3).all(|a| (0..dims[a]).contains(&cell[a]));
    is_there.then(|| (cell[0] + dims[0] * (cell[1] + dims[1] * cell[2])) as usize)
}

impl Bonds {
    /// Bonds a vertex in a cube to the elements at its corners, by its place between them. Returns
    /// `None` if there are none.
    pub fn push(&mut self, grid: &GridInfo, elements: &[u32], cube: [i32; 3], point: [f32; 3]) -> Option<()> {
        let dims = grid.dims.map(i64::from);
        let start = self.bonds.len();
        for corner in 0..8_i32 {
            let by = [0, 1, 2].map(|a| corner >> a & 1);
            let cell = [0, 1, 2].map(|a| i64::from(cube[a] + by[a]));
            let Some(element) = number_of(dims, cell).map(|n| elements[n]).filter(|&e| e != NONE) else {
                continue;
            };
            let share = |a: usize| {
                let along = (point[a] - cube[a] as f32).clamp(0.0, 1.0);
                if by[a] == 1 { along } else { 1.0 - along }
            };
            self.bonds.push((element, share(0) * share(1) * share(2) + LEAST));
        }
        let whole: f32 = self.bonds[start..].iter().map(|(_, share)| share).sum();
        self.bonds[start..].iter_mut().for_each(|(_, share)| *share /= whole);
        self.ends.push(self.bonds.len() as u32);
        (self.bonds.len() > start).then_some(())
    }

    /// Writes the places of the vertices while the elements are at `now_m`.
    pub fn moved(&self, vertices_m: &[[f32; 3]], rest_m: &[[f32; 3]], now_m: &[[f32; 3]], out: &mut Vec<[f32; 3]>) {
        let off = |(now, rest): (&[f32; 3], &[f32; 3])| [now[0] - rest[0], now[1] - rest[1], now[2] - rest[2]];
        let moved_m: Vec<[f32; 3]> = now_m.iter().zip(rest_m).map(off).collect();
        let mut start = 0;
        out.extend(vertices_m.iter().zip(&self.ends).map(|(vertex, &end)| {
            let own = &self.bonds[start..end as usize];
            start = end as usize;
            let mut place = *vertex;
            for &(element, share) in own {
                if let Some([x, y, z]) = moved_m.get(element as usize) {
                    place = [place[0] + share * x, place[1] + share * y, place[2] + share * z];
                }
            }
            place
        }));
    }
}
