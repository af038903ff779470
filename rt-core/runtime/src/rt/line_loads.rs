//! What the force loop does to the body on a prepared line: forces for the tissue loop's columns.

use stylet_sim::line::MAX_STATIONS;

/// Forces of the newest tick on a line.
#[derive(Clone, Copy, Debug)]
pub struct LineLoads {
    /// Of the line that they are for; 0: the needle is on none.
    pub generation: u64,
    /// The tip presses on tissue or is in it.
    pub in_tissue: bool,
    /// Place at rest of the material that the tip is in, from the entry along the line, m.
    pub tip_material_m: f64,
    /// How many of `loads_n` there are.
    pub count: usize,
    /// Shaft of each station, then tip at each.
    pub loads_n: [f64; 2 * MAX_STATIONS],
}

impl LineLoads {
    /// The forces that there are.
    pub fn loads_n(&self) -> &[f64] {
        self.loads_n.get(..self.count).unwrap_or(&[])
    }
}

impl Default for LineLoads {
    fn default() -> Self {
        Self {
            generation: 0,
            in_tissue: false,
            tip_material_m: 0.0,
            count: 0,
            loads_n: [0.0; 2 * MAX_STATIONS],
        }
    }
}
