//! What the probe does to the tissue along a needle's line: from the tissue loop, which has the probe, to the force loop, which has the needle.

use crate::rt::line_loads::MOST;
use crate::rt::recorder::{FLIGHT_TICKS, Last};
use serde::{Deserialize, Serialize};

/// Displacement of the rows of one line, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "TapedOutside", from = "TapedOutside")]
pub struct Outside {
    /// Number of the line.
    pub generation: u64,
    count: usize,
    rows_m: [f64; MOST],
}

impl Default for Outside {
    /// Of no line.
    fn default() -> Self {
        Self {
            generation: 0,
            count: 0,
            rows_m: [0.0; MOST],
        }
    }
}

impl Outside {
    /// In the order of the line's columns.
    pub fn rows_m(&self) -> &[f64] {
        self.rows_m.get(..self.count).unwrap_or(&[])
    }

    /// Of that line, as `write` says, which returns how many rows there are.
    pub fn set(&mut self, generation: u64, write: impl FnOnce(&mut [f64]) -> usize) {
        self.generation = generation;
        self.count = write(&mut self.rows_m).min(MOST);
    }
}

/// As a flight recording holds it.
#[derive(Serialize, Deserialize)]
struct TapedOutside {
    generation: u64,
    rows_m: Vec<f64>,
}

impl From<Outside> for TapedOutside {
    fn from(outside: Outside) -> Self {
        Self {
            generation: outside.generation,
            rows_m: outside.rows_m().to_vec(),
        }
    }
}

impl From<TapedOutside> for Outside {
    /// Rows that no line has are left out.
    fn from(taped: TapedOutside) -> Self {
        let mut outside = Self::default();
        outside.set(taped.generation, |rows_m| {
            for (slot, row_m) in rows_m.iter_mut().zip(&taped.rows_m) {
                *slot = *row_m;
            }
            taped.rows_m.len()
        });
        outside
    }
}

/// Room for it in the force loop's recording: one in each tick of the tissue, for as long as the tape reaches back.
pub struct OutsideTape(pub Last<(u64, Outside)>);

impl OutsideTape {
    /// Blank.
    pub fn new() -> Box<Self> {
        Box::new(Self(Last::new(&(0, Outside::default()), FLIGHT_TICKS / 4)))
    }
}
