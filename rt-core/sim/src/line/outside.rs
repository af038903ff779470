//! Displacement of the tissue past a needle by something else: the ultrasound probe displaces the stations of its line.
//!
//! It is known for every tick of the tissue, and is reached in equal parts within one, so that the force has no steps.
//! Stations stick and slip by where they are with it.

use super::beam::MAX_ACROSS;
use super::model::MAX_STATIONS;
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;

/// Rows of the longest line.
const MOST: usize = rows(MAX_STATIONS);

/// Displacement of each row of a line: shaft of each station, then tip at each, then stations across along each
/// direction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ExternalDisplacement {
    /// Now, and to be reached, m.
    now_m: Vec<f64>,
    to_m: Vec<f64>,
    /// Within so many ticks.
    ticks: u32,
    /// Set while some displacement is not zero, or was not in the last tick.
    is_on: bool,
    /// Displacement at the tip, m.
    pub at_tip_m: f64,
}

/// The same in a flight recording of a needle that stays in, with room for the longest line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ExternalRecord {
    #[serde(with = "BigArray")]
    now_m: [f64; MOST],
    #[serde(with = "BigArray")]
    to_m: [f64; MOST],
    ticks: u32,
    is_on: bool,
    at_tip_m: f64,
}

impl ExternalRecord {
    /// Blank; every page is written to.
    pub const BLANK: Self = ExternalRecord {
        now_m: [1.0; MOST],
        to_m: [1.0; MOST],
        ticks: 1,
        is_on: false,
        at_tip_m: 1.0,
    };

    pub fn of(outside: &ExternalDisplacement) -> Self {
        let mut record = ExternalRecord {
            now_m: [0.0; MOST],
            to_m: [0.0; MOST],
            ticks: outside.ticks,
            is_on: outside.is_on,
            at_tip_m: outside.at_tip_m,
        };
        for (slots, rows_m) in [(&mut record.now_m, &outside.now_m), (&mut record.to_m, &outside.to_m)] {
            for (slot, row_m) in slots.iter_mut().zip(rows_m) {
                *slot = *row_m;
            }
        }
        record
    }
}

impl ExternalDisplacement {
    /// Continues from `record`, as far as the line has rows.
    pub fn take_record(&mut self, record: &ExternalRecord) {
        for (rows_m, kept) in [(&mut self.now_m, &record.now_m), (&mut self.to_m, &record.to_m)] {
            for (row_m, kept_m) in rows_m.iter_mut().zip(kept) {
                *row_m = *kept_m;
            }
        }
        (self.ticks, self.is_on, self.at_tip_m) = (record.ticks, record.is_on, record.at_tip_m);
    }

    /// Makes room for a line of so many stations, with any across.
    pub fn new(stations: usize, value: f64) -> Self {
        let rows = rows(stations);
        ExternalDisplacement {
            now_m: vec![value; rows],
            to_m: vec![value; rows],
            ..ExternalDisplacement::default()
        }
    }

    /// Sets the displacement to reach after so many ticks; rows without a value go to rest, and a value that is not
    /// finite counts as none.
    pub fn set(&mut self, to_m: &[f64], ticks: u32) {
        let finite = |m: f64| if m.is_finite() { m } else { 0.0 };
        let given = to_m.iter().copied().map(finite).chain(std::iter::repeat(0.0));
        for (slot, to_m) in self.to_m.iter_mut().zip(given) {
            *slot = to_m;
            self.is_on |= to_m != 0.0;
        }
        self.ticks = ticks.max(1);
    }

    /// Goes to rest at once; does not allocate.
    pub fn reset(&mut self) {
        self.now_m.fill(0.0);
        self.to_m.fill(0.0);
        (self.ticks, self.is_on, self.at_tip_m) = (0, false, 0.0);
    }

    /// Keeps what `from` holds; does not allocate where there is room. Names every field, so that a new one is not
    /// forgotten.
    pub fn copy_from(&mut self, from: &ExternalDisplacement) {
        let ExternalDisplacement {
            now_m,
            to_m,
            ticks,
            is_on,
            at_tip_m,
        } = from;
        self.now_m.clone_from(now_m);
        self.to_m.clone_from(to_m);
        (self.ticks, self.is_on, self.at_tip_m) = (*ticks, *is_on, *at_tip_m);
    }

    /// Holds nothing, and keeps its room.
    pub fn clear(&mut self) {
        self.now_m.clear();
        self.to_m.clear();
    }

    /// Returns whether it belongs to so many stations.
    pub fn fits(&self, stations: usize) -> bool {
        self.now_m.len() == rows(stations) && self.to_m.len() == rows(stations)
    }

    /// Returns whether something displaces the line.
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Returns whether it is still on its way.
    pub fn is_going(&self) -> bool {
        self.ticks > 0
    }

    /// Returns the displacement of each row, m.
    pub fn now_m(&self) -> &[f64] {
        &self.now_m
    }

    /// Returns the displacement of one row, m.
    pub fn at_m(&self, row: usize) -> f64 {
        self.now_m.get(row).copied().unwrap_or(0.0)
    }

    /// Advances by one tick towards the displacement to reach.
    pub fn go_on(&mut self) {
        if self.ticks == 0 {
            return;
        }
        let part = 1.0 / f64::from(self.ticks);
        for (now_m, to_m) in self.now_m.iter_mut().zip(&self.to_m) {
            *now_m = if self.ticks == 1 {
                *to_m
            } else {
                *now_m + part * (to_m - *now_m)
            };
        }
        self.ticks -= 1;
        self.is_on = self.ticks > 0 || self.now_m.iter().any(|m| *m != 0.0);
    }
}

const fn rows(stations: usize) -> usize {
    2 * (stations + MAX_ACROSS)
}
