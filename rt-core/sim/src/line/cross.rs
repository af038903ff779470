//! Displacement of two lines in one body by each other: `W12 = B1 K^-1 B2'`.
//!
//! The columns of the line that is solved for later are read at the stations of the lines before it. By reciprocity
//! this is also how the later line's stations move with the loads of the earlier ones, so each pair is solved for once.

use super::columns::Column;
use super::stations::Stations;
use crate::tissue::fem::Compiled;
use crate::tissue::fem::batch::{BatchModel, NodeWeight, Part};
use serde::{Deserialize, Serialize};

/// Places where a line loads its body: shaft of each station along the line, then tip at each. Kept while other lines
/// may come beside it.
#[derive(Clone, Debug)]
pub struct LineStations {
    /// Number of its [`HandLine`](super::HandLine).
    pub generation: u64,
    /// Unit vector inwards.
    pub direction: [f64; 3],
    pub(super) loads: Vec<Vec<NodeWeight>>,
}

impl LineStations {
    /// Makes the stations of a line that loads nothing, for tests and examples.
    pub fn none(generation: u64) -> Self {
        Self {
            generation,
            direction: [0.0, 0.0, 1.0],
            loads: Vec::new(),
        }
    }

    /// Returns the part of the body that the line enters.
    fn part<'a, T: Compiled>(&self, body: &'a BatchModel<T>) -> Option<&'a Part> {
        body.part_of(self.loads.first()?.first()?.node)
    }

    pub(super) fn of(generation: u64, stations: &Stations) -> Self {
        let all = stations.shaft.iter().chain(&stations.tip);
        Self {
            generation,
            direction: stations.line.axes[0],
            loads: all.map(|weights| stations.load(weights, 0)).collect(),
        }
    }
}

/// Displacement of the rows of one line by a newton at each row of another, m/N; shaft of each station, then tip at
/// each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cross {
    /// Number of the other line.
    pub with: u64,
    /// Compliance of the body as a whole on its foundation, along both lines.
    pub whole_m_per_n: f64,
    own_rows: usize,
    other_rows: usize,
    values: Vec<f64>,
}

impl Cross {
    /// Makes it from a function of own row and other row.
    pub fn from_rows(
        with: u64,
        whole_m_per_n: f64,
        [own_rows, other_rows]: [usize; 2],
        entry: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let at = |n: usize| entry(n / other_rows, n % other_rows);
        Self {
            with,
            whole_m_per_n,
            own_rows,
            other_rows,
            values: (0..own_rows * other_rows).map(at).collect(),
        }
    }

    /// Makes one for each of `others`, from columns of `stations` that were read there. Lines in different parts of the
    /// body do not move each other.
    pub(super) fn of_columns<T: Compiled>(
        columns: &[Column],
        direction: [f64; 3],
        (body, stations): (&BatchModel<T>, &Stations),
        others: &[std::sync::Arc<LineStations>],
    ) -> Vec<Self> {
        let (mut first, part) = (0, stations.part(body));
        let mut all = Vec::with_capacity(others.len());
        for other in others {
            let rows = other.loads.len();
            let cosine: f64 = (0..3).map(|a| direction[a] * other.direction[a]).sum();
            let entry =
                |own: usize, of_other: usize| columns[own].beside_m.get(first + of_other).copied().unwrap_or(0.0);
            all.push(Self::from_rows(
                other.generation,
                if other.part(body) == Some(&part) {
                    cosine * part.m_per_n
                } else {
                    0.0
                },
                [columns.len(), rows],
                entry,
            ));
            first += rows;
        }
        all
    }

    /// Returns the displacement of own row `own` by a newton at row `other` of the other line, which is also that the
    /// other way round.
    #[inline]
    pub fn at(&self, own: usize, other: usize) -> f64 {
        self.values.get(own * self.other_rows + other).copied().unwrap_or(0.0)
    }

    /// Returns the number of rows of both lines.
    pub fn rows(&self) -> [usize; 2] {
        [self.own_rows, self.other_rows]
    }

    /// Returns whether it joins lines of so many rows: one read from a file may not.
    pub(super) fn is_whole(&self, own_rows: usize) -> bool {
        self.own_rows == own_rows
            && self.own_rows.checked_mul(self.other_rows) == Some(self.values.len())
            && self.values.iter().all(|value| value.is_finite())
    }
}
