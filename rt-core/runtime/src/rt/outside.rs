//! What the probe does to the tissue along the lines of needles, of the one that moves and those that stay in: from the tissue loop, which has the probe, to the force loop, which has the needle.

use crate::rt::line_loads::MOST;
use crate::rt::recorder::{FLIGHT_TICKS, Last};
use serde::{Deserialize, Serialize};
use stylet_sim::line::MAX_LEFT;

/// Displacement of the rows of one line, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "TapedOutside", from = "TapedOutside")]
pub struct LineOutside {
    /// Number of the line.
    pub generation: u64,
    count: usize,
    rows_m: [f64; MOST],
}

impl Default for LineOutside {
    /// Of no line.
    fn default() -> Self {
        Self {
            generation: 0,
            count: 0,
            rows_m: [0.0; MOST],
        }
    }
}

impl LineOutside {
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

/// Of all lines.
#[derive(Clone, Copy, Debug)]
pub struct Outside {
    count: usize,
    lines: [LineOutside; 1 + MAX_LEFT],
}

impl Default for Outside {
    /// Of none.
    fn default() -> Self {
        Self {
            count: 0,
            lines: [LineOutside::default(); 1 + MAX_LEFT],
        }
    }
}

impl Outside {
    /// Those that it is known of.
    pub fn lines(&self) -> &[LineOutside] {
        self.lines.get(..self.count).unwrap_or(&[])
    }

    /// Of none.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Room for one more; `None` where there are as many as there may be.
    pub fn add(&mut self) -> Option<&mut LineOutside> {
        let line = self.lines.get_mut(self.count)?;
        self.count += 1;
        Some(line)
    }
}

/// As a flight recording holds it.
#[derive(Serialize, Deserialize)]
struct TapedOutside {
    generation: u64,
    rows_m: Vec<f64>,
}

impl From<LineOutside> for TapedOutside {
    fn from(outside: LineOutside) -> Self {
        Self {
            generation: outside.generation,
            rows_m: outside.rows_m().to_vec(),
        }
    }
}

impl From<TapedOutside> for LineOutside {
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

/// Room for it in the force loop's recording: one for each line in each tick of the tissue, for as long as the tape reaches back.
pub struct OutsideTape(pub Last<(u64, LineOutside)>);

impl OutsideTape {
    /// Blank.
    pub fn new() -> Box<Self> {
        Box::new(Self(Last::new(
            &(0, LineOutside::default()),
            (1 + MAX_LEFT) * FLIGHT_TICKS / 4,
        )))
    }
}
