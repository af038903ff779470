//! A box of nodes around the body at one level of coarseness, and which stretch of each line of it is in use.

use super::lanes::LANES;

/// Nodes are numbered x fastest; a cell has the number of its lowest corner.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Nodes along x, y, z: odd, so that every second one is a node of the next coarser grid.
    pub nodes: [usize; 3],
    /// Step from one line of nodes to the next; those past `nodes[0]` touch no element. Room for whole lanes from any
    /// node.
    pub stride: usize,
    /// First and one past the last cell of the stretch in use of each row of cells, by row number `j + nodes[1] * k`.
    pub cell_rows: Vec<[u32; 2]>,
    /// The same for rows of nodes.
    pub node_rows: Vec<[u32; 2]>,
}

impl Grid {
    /// Makes a grid; `used` lists the cells in use.
    pub fn new(cells: [usize; 3], used: impl Iterator<Item = [usize; 3]>) -> Self {
        let nodes = cells.map(|n| n.next_multiple_of(2) + 1);
        let rows = nodes[1] * nodes[2];
        let mut grid = Grid {
            nodes,
            stride: (nodes[0] + LANES).next_multiple_of(LANES),
            cell_rows: vec![[u32::MAX, 0]; rows],
            node_rows: vec![[u32::MAX, 0]; rows],
        };
        for [i, j, k] in used {
            let widen = |row: &mut [u32; 2], first: usize, end: usize| {
                *row = [row[0].min(first as u32), row[1].max(end as u32)];
            };
            widen(&mut grid.cell_rows[j + nodes[1] * k], i, i + 1);
            for corner in 0..4 {
                let row = j + (corner & 1) + nodes[1] * (k + (corner >> 1));
                widen(&mut grid.node_rows[row], i, i + 2);
            }
        }
        for row in grid.cell_rows.iter_mut().chain(&mut grid.node_rows) {
            // From an even node, for the sake of interpolation, and in whole lanes.
            let first = row[0] / 2 * 2;
            *row = if row[0] > row[1] {
                [0, 0]
            } else {
                [first, first + (row[1] - first).next_multiple_of(LANES as u32)]
            };
        }
        grid
    }

    pub fn len(&self) -> usize {
        self.stride * self.nodes[1] * self.nodes[2]
    }

    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.stride * (j + self.nodes[1] * k)
    }

    pub fn place(&self, index: usize) -> [usize; 3] {
        let (nx, ny) = (self.stride, self.nodes[1]);
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// Returns the stretches of nodes in use, in order.
    pub fn node_spans(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let spans = self.node_rows.iter().enumerate();
        spans.map(|(row, &[first, end])| row * self.stride + first as usize..row * self.stride + end as usize)
    }
}

/// Returns the eight nodes of a cell.
pub(super) fn corners(grid: &Grid, cell: usize) -> [usize; 8] {
    let (nx, ny) = (grid.stride, grid.nodes[1]);
    std::array::from_fn(|c| cell + (c & 1) + nx * (c >> 1 & 1) + nx * ny * (c >> 2))
}
