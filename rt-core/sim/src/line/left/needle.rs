//! One needle that stays in, for readers outside the solver.

use super::LeftNeedle;
use crate::line::ready::HandLine;

impl LeftNeedle {
    /// Returns the number of its line.
    pub fn generation(&self) -> u64 {
        self.line.generation
    }

    /// Its line.
    pub fn line(&self) -> &HandLine {
        &self.line
    }

    /// Returns the position of its tip along the line in the world, m.
    pub fn held_m(&self) -> f64 {
        self.held_m
    }

    /// Returns whether it is being drawn out.
    pub fn is_drawn(&self) -> bool {
        self.drawing_m_per_s > 0.0
    }

    /// Returns the depth of its tip in the material, m.
    pub fn depth_m(&self) -> f64 {
        self.line.state.tip.material_m - self.drawn_m
    }
}
