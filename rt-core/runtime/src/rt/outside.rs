//! The probe's displacement of tissue along needle lines, of the moving needle and of those that stay in: from the
//! tissue loop, which has the probe, to the force loop, which has the needle.

use crate::rt::line_loads::MOST;
use crate::rt::recorder::{FLIGHT_TICKS, Last};
use crate::rt::taped;
use serde::{Deserialize, Serialize};
use stylet_sim::line::MAX_LEFT;

/// Displacement of the rows of one line, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineOutside {
    /// Number of the line.
    pub generation: u64,
    count: usize,
    #[serde(with = "taped")]
    rows_m: [f64; MOST],
}

impl Default for LineOutside {
    /// Displacement of no line.
    fn default() -> Self {
        Self {
            generation: 0,
            count: 0,
            rows_m: [0.0; MOST],
        }
    }
}

impl LineOutside {
    /// Rows in the order of the line's columns.
    pub fn rows_m(&self) -> &[f64] {
        self.rows_m.get(..self.count).unwrap_or(&[])
    }

    /// Sets the displacement of that line by `write`, which returns the number of rows.
    pub fn set(&mut self, generation: u64, write: impl FnOnce(&mut [f64]) -> usize) {
        (self.generation, self.rows_m) = (generation, [0.0; MOST]);
        self.count = write(&mut self.rows_m).min(MOST);
    }
}

/// Displacement of all lines.
#[derive(Clone, Copy, Debug)]
pub struct Outside {
    count: usize,
    lines: [LineOutside; 1 + MAX_LEFT],
}

impl Default for Outside {
    /// Displacement of none.
    fn default() -> Self {
        Self {
            count: 0,
            lines: [LineOutside::default(); 1 + MAX_LEFT],
        }
    }
}

impl Outside {
    /// Lines with a displacement.
    pub fn lines(&self) -> &[LineOutside] {
        self.lines.get(..self.count).unwrap_or(&[])
    }

    /// Removes all lines.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a line; `None` if there are already the most allowed.
    pub fn add(&mut self) -> Option<&mut LineOutside> {
        let line = self.lines.get_mut(self.count)?;
        self.count += 1;
        Some(line)
    }
}

/// Room for it in the force loop's recording: one entry for each line in each tissue tick over the length of the tape.
pub struct OutsideTape(pub Last<(u64, LineOutside)>);

impl OutsideTape {
    /// Returns a blank tape.
    pub fn new() -> Box<Self> {
        Box::new(Self(Last::new(
            &(0, LineOutside::default()),
            (1 + MAX_LEFT) * FLIGHT_TICKS / 4,
        )))
    }
}
