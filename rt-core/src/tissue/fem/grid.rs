//! A box of nodes around the body at one level of coarseness, and which stretch of each line of it is in use.

/// Nodes are numbered x fastest; a cell has the number of its lowest corner.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Nodes along x, y, z: odd, so that every second one is a node of the next coarser grid.
    pub nodes: [usize; 3],
    /// First and one past the last cell in use of each row of cells, by row number `j + nodes[1] * k`.
    pub cell_rows: Vec<[u32; 2]>,
    /// The same for rows of nodes.
    pub node_rows: Vec<[u32; 2]>,
}

impl Grid {
    /// `used` lists the cells in use.
    pub fn new(cells: [usize; 3], used: impl Iterator<Item = [usize; 3]>) -> Self {
        let nodes = cells.map(|n| n.next_multiple_of(2) + 1);
        let rows = nodes[1] * nodes[2];
        let mut grid = Grid {
            nodes,
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
            if row[0] > row[1] {
                *row = [0, 0];
            }
        }
        grid
    }

    pub fn len(&self) -> usize {
        self.nodes.iter().product()
    }

    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.nodes[0] * (j + self.nodes[1] * k)
    }

    pub fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// The stretches of nodes in use, in order.
    pub fn node_spans(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let spans = self.node_rows.iter().enumerate();
        spans.map(|(row, &[first, end])| row * self.nodes[0] + first as usize..row * self.nodes[0] + end as usize)
    }
}
