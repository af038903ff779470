//! A queue of columns: the body's answer to one newton at each station, eight at once, in slices of bounded work.

use super::cross::LineStations;
use super::stations::Stations;
use crate::tissue::fem::Compiled;
use crate::tissue::fem::batch::{BatchModel, BatchState, LOADS, NodeWeight};
use crate::tissue::{ElementField, PackedField};
use std::sync::Arc;

/// Residual over load down to which columns are solved: the compliance then is right to 6e-4 and the field to 7e-3
/// (paper's gland, nu 0.49; `docs/adr/0010-condensed-needle-line.md`).
pub const TOLERANCE: f64 = 4.5e-2;
const MOST_ITERATIONS: u32 = 60;

/// Load of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// Load along the line, on the shaft of a station.
    Shaft(usize),
    /// Load along the line, on the tip's patch at a station.
    Tip(usize),
    /// Across the line (0 or 1), on the shaft of a station across.
    Across(usize, usize),
}

/// The answer to one newton.
#[derive(Clone, Debug)]
pub struct Column {
    /// The load that it answers.
    pub load: Load,
    /// Displacement of the element centres, m/N.
    pub field: PackedField,
    /// Displacement at the stations, m/N: of shaft and tip along the line, or of the shaft across it.
    pub samples_m: Vec<f64>,
    /// Displacement at the stations of the other lines, m/N, along them: see [`ColumnQueue::read_beside`].
    pub beside_m: Vec<f64>,
    /// Force of the foundation on the body.
    pub foundation_n: [f64; 3],
    /// Residual of the solver, over the load.
    pub residual: f64,
}

/// Progress of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueProgress {
    /// Columns that are solved.
    pub ready: usize,
    /// Columns in all.
    pub of: usize,
}

impl QueueProgress {
    /// Returns whether nothing is left to solve.
    pub fn is_done(&self) -> bool {
        self.ready == self.of
    }
}

/// Work of the next slice.
#[derive(Clone, Copy, Debug)]
enum Slice {
    /// Begins the loads of eight columns.
    Begin,
    Solve,
    /// Keeps the answer in this lane.
    Keep(usize),
}

/// Columns of one line, ready ones first. Nothing is allocated after `new`.
#[derive(Clone, Debug)]
pub struct ColumnQueue<T = f32> {
    columns: Vec<Column>,
    /// Loads in order of the columns.
    loads: Vec<Vec<NodeWeight>>,
    /// Loads of other lines, at which every column is read as well.
    beside: Vec<Vec<NodeWeight>>,
    /// Weights that columns are sampled with: `2 m` along the line, then those across it along each direction.
    ready: usize,
    stations: usize,
    across: usize,
    state: BatchState<T>,
    /// An answer on its way into a column.
    unpacked: ElementField,
    next: Slice,
    tolerance: f64,
}

impl<T: Compiled> ColumnQueue<T> {
    /// Makes a queue of the columns along the line, shaft then tip; with `is_flexible` those across it as well.
    pub fn new(model: &BatchModel<T>, stations: &Stations, is_flexible: bool, tolerance: f64) -> Self {
        let m = stations.count();
        let mut wanted: Vec<Load> = (0..m).map(Load::Shaft).chain((0..m).map(Load::Tip)).collect();
        let across = if is_flexible { stations.across_count() } else { 0 };
        wanted.extend((0..2 * across).map(|n| Load::Across(n / across, n % across)));
        let weights = |load: &Load| match *load {
            Load::Shaft(n) => stations.load(&stations.shaft[n], 0),
            Load::Tip(n) => stations.load(&stations.tip[n], 0),
            Load::Across(side, n) => stations.load(&stations.across_weights(n), 1 + side),
        };
        let column = |&load: &Load| Column {
            load,
            field: PackedField::zeros(model.element_count()),
            samples_m: vec![
                0.0;
                if matches!(load, Load::Across(..)) {
                    across
                } else {
                    2 * m
                }
            ],
            beside_m: Vec::new(),
            foundation_n: [0.0; 3],
            residual: f64::INFINITY,
        };
        ColumnQueue {
            loads: wanted.iter().map(weights).collect(),
            columns: wanted.iter().map(column).collect(),
            beside: Vec::new(),
            ready: 0,
            stations: m,
            across,
            state: BatchState::new(model),
            unpacked: ElementField::zeros(model.element_count()),
            next: Slice::Begin,
            tolerance,
        }
    }

    /// Reads every column that is not solved yet at the stations of other lines in the same body as well, shaft and
    /// then tip of each.
    #[must_use]
    pub fn read_beside(mut self, others: &[Arc<LineStations>]) -> Self {
        self.beside = others.iter().flat_map(|other| other.loads.iter().cloned()).collect();
        for column in &mut self.columns {
            column.beside_m = vec![0.0; self.beside.len()];
        }
        self
    }

    /// Returns the progress of the queue.
    pub fn progress(&self) -> QueueProgress {
        QueueProgress {
            ready: self.ready,
            of: self.columns.len(),
        }
    }

    /// Returns the columns that are ready.
    pub fn columns(&self) -> &[Column] {
        &self.columns[..self.ready]
    }

    /// Returns the displacement fields of the columns that are ready, in order.
    pub fn into_fields(mut self) -> Vec<PackedField> {
        self.columns.truncate(self.ready);
        self.columns.into_iter().map(|column| column.field).collect()
    }

    /// Returns the size of the columns and of their work space, in bytes.
    pub fn bytes(&self) -> [usize; 2] {
        let column = |c: &Column| c.field.bytes() + 8 * c.samples_m.len();
        [self.columns.iter().map(column).sum(), self.state.bytes()]
    }

    /// Does at most so many slices of work, each one pass over one level of the body.
    pub fn prepare(&mut self, model: &BatchModel<T>, slices: usize) -> QueueProgress {
        for _ in 0..slices {
            if self.progress().is_done() {
                break;
            }
            self.slice(model);
        }
        self.progress()
    }

    fn slice(&mut self, model: &BatchModel<T>) {
        let columns = self.columns.len().min(self.ready + LOADS) - self.ready;
        self.next = match self.next {
            Slice::Begin => {
                let mut loads: [&[NodeWeight]; LOADS] = [&[]; LOADS];
                let next = self.loads[self.ready..].iter();
                loads.iter_mut().zip(next).for_each(|(slot, load)| *slot = load);
                self.state.begin(model, &loads[..columns]);
                Slice::Solve
            }
            Slice::Solve => {
                let progress = self.state.advance(model);
                let is_done = progress.residual <= self.tolerance || progress.iterations >= MOST_ITERATIONS;
                if self.state.is_whole() && is_done {
                    Slice::Keep(0)
                } else {
                    Slice::Solve
                }
            }
            Slice::Keep(lane) => {
                self.keep(model, lane);
                if lane + 1 < columns {
                    Slice::Keep(lane + 1)
                } else {
                    self.ready += columns;
                    Slice::Begin
                }
            }
        };
    }

    fn keep(&mut self, model: &BatchModel<T>, lane: usize) {
        let (m, across) = (self.stations, self.across);
        let Some(column) = self.columns.get_mut(self.ready + lane) else {
            return;
        };
        let sampled = match column.load {
            Load::Across(side, _) => &self.loads[2 * m + side * across..2 * m + (side + 1) * across],
            _ => &self.loads[..2 * m],
        };
        for (value, weights) in column.samples_m.iter_mut().zip(sampled) {
            *value = self.state.sample(lane, weights);
        }
        for (value, weights) in column.beside_m.iter_mut().zip(&self.beside) {
            *value = self.state.sample(lane, weights);
        }
        self.state.write(model, lane, &mut self.unpacked);
        column.field.pack(&self.unpacked);
        column.foundation_n = self.state.foundation_n(model, lane);
        column.residual = self.state.progress().residual;
    }
}

#[cfg(test)]
pub(super) mod tests;
