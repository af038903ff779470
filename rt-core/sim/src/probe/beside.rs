//! Needle lines beside the probe: how the rows of each and the pads of the wall displace each other.
//!
//! What a row does to a pad is what a pad does to the row, since both are read from one table: the body gives both the
//! same work.

use crate::line::MAX_LEFT;
use crate::line::MAX_STATIONS;
use crate::line::beam::MAX_ACROSS;
use crate::tissue::PackedField;

/// Number of lines: the moving needle's, and those of the needles that stay in.
const LINES: usize = 1 + MAX_LEFT;
/// Rows of a line at most, in the order of the columns of its body.
const ROWS: usize = 2 * (MAX_STATIONS + MAX_ACROSS);

/// One of them.
#[derive(Clone, Debug)]
struct LineOnWall {
    /// Number of the line; 0 is none.
    generation: u64,
    rows: usize,
    /// Displacement of each of the pads' rows by a newton at each row of the line, m/N: one row of the line after
    /// another.
    table: Vec<f32>,
}

/// All of them; nothing is allocated after `with_room`.
#[derive(Clone, Debug)]
pub(super) struct LinesBeside {
    pads: usize,
    lines: Vec<LineOnWall>,
}

impl LinesBeside {
    /// Makes room for a wall with so many rows.
    pub fn with_room(pads: usize) -> Self {
        let line = || {
            let mut table = vec![1.0; ROWS * pads];
            table.fill(0.0);
            LineOnWall {
                generation: 0,
                rows: 0,
                table,
            }
        };
        LinesBeside {
            pads,
            lines: (0..LINES).map(|_| line()).collect(),
        }
    }

    /// Forgets lines that are not kept.
    pub fn keep(&mut self, is_kept: impl Fn(u64) -> bool) {
        for line in self.lines.iter_mut().filter(|line| line.generation != 0) {
            if !is_kept(line.generation) {
                line.generation = 0;
            }
        }
    }

    /// Reads the table of a line that is new, at the elements behind the pads; columns of another body do not count.
    pub fn join(&mut self, generation: u64, columns: &[PackedField], elements: &[u32], of_body: Option<usize>) {
        if generation == 0 || self.find(generation).is_some() {
            return;
        }
        let Some(line) = self.lines.iter_mut().find(|line| line.generation == 0) else {
            return;
        };
        let is_of_body = |column: &PackedField| Some(column.elements()) == of_body;
        line.generation = generation;
        line.rows = if columns.iter().all(is_of_body) {
            columns.len().min(ROWS)
        } else {
            0
        };
        let rows = line.table.chunks_exact_mut(self.pads.max(1));
        for (row, column) in rows.zip(columns).take(line.rows) {
            for (slots, &element) in row.chunks_exact_mut(3).zip(elements) {
                slots.copy_from_slice(&column.at(element));
            }
        }
    }

    /// Adds how far loads on a line displace the pads, m.
    pub fn displace_pads(&self, generation: u64, loads_n: &[f64], pads_m: &mut [f64]) {
        let Some(line) = self.find(generation) else { return };
        let loaded = line.rows_with(self.pads).zip(loads_n).filter(|(_, n)| **n != 0.0);
        for (row, load_n) in loaded {
            for (moved_m, m_per_n) in pads_m.iter_mut().zip(row) {
                *moved_m += load_n * f64::from(*m_per_n);
            }
        }
    }

    /// Computes the displacement of the rows of a line by loads on the pads, along it, m; returns the number of rows.
    pub fn displace_line(&self, generation: u64, loads_n: &[f64], rows_m: &mut [f64]) -> usize {
        let Some(line) = self.find(generation) else { return 0 };
        for (moved_m, row) in rows_m.iter_mut().zip(line.rows_with(self.pads)) {
            let places = row.chunks_exact(3).zip(loads_n.chunks_exact(3));
            let loaded = places.filter(|(_, loads_n)| loads_n.iter().any(|n| *n != 0.0));
            let along = loaded.flat_map(|(row, loads_n)| row.iter().zip(loads_n));
            *moved_m = along.map(|(m_per_n, load_n)| f64::from(*m_per_n) * load_n).sum();
        }
        line.rows.min(rows_m.len())
    }

    fn find(&self, generation: u64) -> Option<&LineOnWall> {
        self.lines
            .iter()
            .find(|line| line.generation == generation && generation != 0)
    }
}

impl LineOnWall {
    fn rows_with(&self, pads: usize) -> impl Iterator<Item = &[f32]> {
        self.table.chunks_exact(pads.max(1)).take(self.rows)
    }
}
