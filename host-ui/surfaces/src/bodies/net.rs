//! Surface nets about the cells of a structure: one vertex in each cube between eight middles of
//! cells that differ.

use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};

/// Closed net, counted in cells from the middle of the first one.
#[derive(Clone, Debug, Default)]
pub struct Net {
    /// One vertex for each cube.
    pub points: Vec<[f32; 3]>,
    /// Lowest corner of the cube in which each vertex stays.
    pub cubes: Vec<[i32; 3]>,
    /// Triangles, anticlockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Number of cells inside.
    pub cells: usize,
}

impl Net {
    /// Creates a net about the cells of a grid (x fastest) whose label is in the structure.
    pub fn of([nx, ny, nz]: [usize; 3], labels: &[u8], is_in: impl Fn(u8) -> bool) -> Self {
        let is_in: [bool; 256] = std::array::from_fn(|label| is_in(label as u8));
        let (mut low, mut high, mut cells) = ([usize::MAX; 3], [0; 3], 0);
        let rows = || labels.chunks_exact(nx.max(1)).take(ny * nz).enumerate();
        for (row, labels) in rows() {
            for x in (0..nx).filter(|&x| is_in[usize::from(labels[x])]) {
                let cell = [x, row % ny, row / ny];
                low = [0, 1, 2].map(|a| low[a].min(cell[a]));
                high = [0, 1, 2].map(|a| high[a].max(cell[a]));
                cells += 1;
            }
        }
        if cells == 0 {
            return Self::default();
        }
        // An empty border, so that the net closes; the crate makes no faces in the last layer.
        let dims = [0, 1, 2].map(|a| (high[a] - low[a]) as u32 + 4);
        let shape = RuntimeShape::<u32, 3>::new(dims);
        let mut field = vec![1.0_f32; shape.usize()];
        for (row, labels) in rows().filter(|(row, _)| {
            let [y, z] = [row % ny, row / ny];
            (low[1]..=high[1]).contains(&y) && (low[2]..=high[2]).contains(&z)
        }) {
            let (y, z) = ((row % ny - low[1]) as u32 + 1, (row / ny - low[2]) as u32 + 1);
            let first = shape.linearize([1, y, z]) as usize;
            for (value, label) in field[first..].iter_mut().zip(&labels[low[0]..=high[0]]) {
                *value = if is_in[usize::from(*label)] { -1.0 } else { 1.0 };
            }
        }
        let mut buffer = SurfaceNetsBuffer::default();
        surface_nets(&field, &shape, [0; 3], dims.map(|d| d - 1), &mut buffer);
        let from = low.map(|l| l as i32 - 1);
        Self {
            points: buffer
                .positions
                .iter()
                .map(|p| [0, 1, 2].map(|a| p[a] + from[a] as f32))
                .collect(),
            cubes: buffer
                .surface_points
                .iter()
                .map(|c| [0, 1, 2].map(|a| c[a] as i32 + from[a]))
                .collect(),
            triangles: buffer.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            cells,
        }
    }

    /// Returns six times the volume inside, in cells.
    pub fn sixfold_volume(&self) -> f64 {
        // From a point near by, so that no digits are lost.
        let from = self.points.first().copied().unwrap_or_default();
        let corner = |v: u32| [0, 1, 2].map(|a| f64::from(self.points[v as usize][a] - from[a]));
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(corner);
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        };
        self.triangles.iter().map(of).sum()
    }
}
