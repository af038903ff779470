//! Needles that stayed in and are drawn out without the hand.

use super::LeftNeedles;

impl LeftNeedles {
    /// Begins to draw that needle out; at 0 m/s it is held again. False where there is none of that number.
    pub fn draw_out(&mut self, generation: u64, speed_m_per_s: f64) -> bool {
        self.is_still = false;
        let needle = self.needles.iter_mut().find(|n| n.line.generation == generation);
        needle.map(|n| n.drawing_m_per_s = speed_m_per_s.max(0.0)).is_some()
    }

    /// Holds those that are drawn where they are, or draws them on.
    pub fn hold_drawn(&mut self, is_held: bool) {
        self.is_still = false;
        for needle in &mut self.needles {
            // Held ones keep their speed below zero.
            let speed_m_per_s = needle.drawing_m_per_s.abs();
            needle.drawing_m_per_s = if is_held { -speed_m_per_s } else { speed_m_per_s };
        }
    }

    /// Returns whether a needle is being drawn, or held on its way.
    pub fn is_drawing(&self) -> bool {
        self.needles.iter().any(|needle| needle.drawing_m_per_s != 0.0)
    }

    /// Ends the drawing: needles that are drawn stay where they are.
    pub fn end_drawing(&mut self) {
        self.needles.iter_mut().for_each(|needle| needle.drawing_m_per_s = 0.0);
    }

    pub(super) fn draw(&mut self, dt_s: f64) {
        let mut is_drawn = false;
        for needle in self.needles.iter_mut().filter(|needle| needle.drawing_m_per_s > 0.0) {
            let by_m = needle.drawing_m_per_s * dt_s;
            needle.drawn_m += by_m;
            needle.held_m -= by_m;
            for rest_m in &mut self.rest_m[needle.first..=needle.first + needle.stations] {
                *rest_m -= by_m;
            }
            is_drawn = true;
        }
        if is_drawn {
            self.is_still = false;
            self.limit();
        }
    }
}
