//! Active stretches of runs: those that have moved, or violate their limits.
//!
//! Recovery breaks no limit, so a link between elements that the solver has not moved stays as good as it was: only
//! links at active stretches are swept and checked.

use super::spans::Rows;
use super::stretch::Stretch;

/// A stretch for each run, and which rows and planes have any.
#[derive(Clone, Debug)]
pub(crate) struct Active {
    of_run: Vec<Stretch>,
    /// Rows j of each plane k, and planes k, that may have active runs; the others have none.
    rows: Vec<Stretch>,
    planes: Stretch,
}

impl Active {
    /// Makes room without an active stretch. Writes every page, so that no step is the first to touch one.
    pub fn none(runs: usize, planes: usize) -> Self {
        let touched = |n| (0..n).map(|_| std::hint::black_box(Stretch::EMPTY)).collect();
        Active {
            of_run: touched(runs),
            rows: touched(planes),
            planes: Stretch::EMPTY,
        }
    }

    #[inline(always)]
    pub fn of_run(&self, run: usize) -> Stretch {
        self.of_run[run]
    }

    #[inline(always)]
    pub fn rows(&self, k: usize) -> Stretch {
        self.rows[k]
    }

    #[inline(always)]
    pub fn planes(&self) -> Stretch {
        self.planes
    }

    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// Adds to a run; its row must be made known by `add_row`.
    #[inline(always)]
    pub fn add(&mut self, run: usize, stretch: Stretch) {
        self.of_run[run] = self.of_run[run].with(stretch);
    }

    #[inline(always)]
    pub fn add_row(&mut self, j: usize, k: usize) {
        self.rows[k] = self.rows[k].with(Stretch::one(j));
        self.planes = self.planes.with(Stretch::one(k));
    }

    /// Activates everything in these rows of cells.
    pub fn add_all(&mut self, rows: &Rows, ny: usize) {
        for row in 0..rows.count() {
            for run in rows.numbers(row) {
                self.of_run[run] = Stretch {
                    start: rows.runs[run].first,
                    end: rows.runs[run].end(),
                };
                self.add_row(row % ny, row / ny);
            }
        }
    }

    /// Calls `f` for each row that may have active runs.
    pub fn for_each_row(&self, mut f: impl FnMut(usize, usize)) {
        for k in self.planes.numbers() {
            self.rows[k].numbers().for_each(|j| f(j, k));
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self, rows: &Rows, ny: usize) {
        for k in self.planes.numbers() {
            for j in self.rows[k].numbers() {
                self.of_run[rows.numbers(j + ny * k)].fill(Stretch::EMPTY);
            }
            self.rows[k] = Stretch::EMPTY;
        }
        self.planes = Stretch::EMPTY;
    }

    /// Returns the number of elements in active stretches.
    pub fn element_count(&self, rows: &Rows, ny: usize) -> u32 {
        let mut count = 0;
        self.for_each_row(|j, k| count += rows.numbers(j + ny * k).map(|run| self.of_run[run].len()).sum::<u32>());
        count
    }

    /// Returns its parts, as bytes.
    pub fn memory(&self) -> [&[u8]; 3] {
        [
            bytemuck::cast_slice(&self.of_run),
            bytemuck::cast_slice(&self.rows),
            bytemuck::bytes_of(&self.planes),
        ]
    }

    pub fn memory_mut(&mut self) -> [&mut [u8]; 3] {
        [
            bytemuck::cast_slice_mut(&mut self.of_run),
            bytemuck::cast_slice_mut(&mut self.rows),
            bytemuck::bytes_of_mut(&mut self.planes),
        ]
    }

    /// Returns whether every stretch that is not empty lies within its run, its plane and the lattice.
    pub fn is_of(&self, rows: &Rows, [_, ny, nz]: [usize; 3]) -> bool {
        let within = |s: &Stretch, start: u32, end: u32| s.is_empty() || (s.start >= start && s.end <= end);
        let of_run = self.of_run.iter().zip(&rows.runs);
        of_run.into_iter().all(|(s, run)| within(s, run.first, run.end()))
            && self.rows.iter().all(|s| within(s, 0, ny as u32))
            && within(&self.planes, 0, nz as u32)
    }

    pub fn copy_from(&mut self, other: &Active) {
        self.of_run.copy_from_slice(&other.of_run);
        self.rows.copy_from_slice(&other.rows);
        self.planes = other.planes;
    }
}
