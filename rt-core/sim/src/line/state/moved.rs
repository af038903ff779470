//! Effect of displacements from outside on a line.

use super::LineState;
use crate::line::model::LineModel;

impl LineState {
    /// Displaces the tissue past the needle by what the probe does in this tick, on top of what the past leaves. One
    /// comparison where nothing moves.
    pub(in crate::line) fn move_from_outside(&mut self) {
        if !self.outside.is_on() {
            return;
        }
        if !self.memory.is_on() {
            self.memory.offset_m.fill(0.0);
        }
        self.outside.go_on();
        for (offset_m, moved_m) in self.memory.offset_m.iter_mut().zip(self.outside.now_m()) {
            *offset_m += moved_m;
        }
        if !self.outside.is_on() {
            (self.outside.at_tip_m, self.beside_whole_m) = (0.0, 0.0);
        }
    }

    /// Displaces the membrane at the tip likewise, once its place is known: this stretches it no more than tissue that
    /// is moved as a whole.
    pub(in crate::line) fn move_membrane_from_outside(&mut self, model: &LineModel) {
        if !self.outside.is_on() {
            return;
        }
        let first = model.compliance.stations;
        let tip = self.tip_range.clone().zip(self.tip_weights);
        let at_tip_m: f64 = tip.map(|(n, weight)| weight * self.outside.at_m(first + n)).sum();
        self.beside_whole_m += at_tip_m - self.outside.at_tip_m;
        self.outside.at_tip_m = at_tip_m;
    }

    /// Displaces the tissue across the line likewise, at so many stations along each direction.
    pub(in crate::line) fn bend_from_outside(&mut self, across: usize) {
        let first = 2 * self.shaft_n.len();
        let outside = &self.outside;
        if outside.is_on() || self.beam.is_moved() {
            self.beam
                .move_from_outside(|side, n| outside.at_m(first + side * across + n), across);
        }
    }

    /// Returns the work of the needle's forces over what moves the tissue from outside, J: no energy that they have
    /// stored.
    pub(in crate::line) fn outside_j(&self) -> f64 {
        if !self.outside.is_on() {
            return 0.0;
        }
        let shaft = self.shaft_n.iter().enumerate().take(self.in_contact);
        shaft.map(|(n, f)| f * self.outside.at_m(n)).sum::<f64>() + self.tip.force_n * self.outside.at_tip_m
    }
}
