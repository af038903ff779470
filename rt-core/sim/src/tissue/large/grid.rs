//! Layout of a window's nodes in memory.

/// Number of values of a row that are processed at once.
pub(super) const ROW: usize = 8;

/// Grid with as many nodes along each edge; rows along x are padded to whole [`ROW`]s.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub side: usize,
    pub stride: usize,
}

impl Grid {
    pub fn new(side: usize) -> Self {
        Grid {
            side,
            stride: side.next_multiple_of(ROW),
        }
    }

    /// Returns how many numbers a component has, with those that the last cells read past the end.
    pub fn len(&self) -> usize {
        self.stride * self.side * self.side + ROW
    }

    pub fn at(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.stride * (j + self.side * k)
    }

    /// Returns the step from a cell's lowest node to another.
    pub fn step(&self, corner: usize) -> usize {
        self.at([corner & 1, corner >> 1 & 1, corner >> 2])
    }

    /// Returns the lowest nodes of the first cells of rows.
    pub fn rows_of_cells(&self) -> impl Iterator<Item = usize> {
        let (n, stride) = (self.side, self.stride);
        let rows = (0..(n - 1) * (n - 1)).map(move |r| stride * (r % (n - 1) + n * (r / (n - 1))));
        rows.flat_map(move |at| (0..stride).step_by(ROW).map(move |x| at + x))
    }

    pub fn places(&self) -> impl Iterator<Item = [usize; 3]> {
        let n = self.side;
        (0..n * n * n).map(move |p| [p % n, p / n % n, p / (n * n)])
    }
}
