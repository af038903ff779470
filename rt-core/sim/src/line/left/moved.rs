//! What the probe does to needles that stay in: it moves the tissue past them.

use super::{LeftNeedle, LeftNeedles};

impl LeftNeedle {
    /// How far the probe moves the tissue there along the needle, m.
    fn moved_m(&self, element: usize) -> f64 {
        let outside = &self.line.state.outside;
        self.rows(element).map(|(row, weight)| weight * outside.at_m(row)).sum()
    }
}

impl LeftNeedles {
    /// The probe displaces the tissue past the needle of that line so far at each row, m: after so many ticks. False where there is none of that number.
    /// Does not allocate.
    pub fn displace_from_outside(&mut self, generation: u64, rows_m: &[f64], ticks: u32) -> bool {
        let needle = self.needles.iter_mut().find(|n| n.line.generation == generation);
        needle.map(|n| n.line.displace_from_outside(rows_m, ticks)).is_some()
    }

    /// Tissue that goes past a needle is to its elements as if the needle went the other way. One comparison for each needle where nothing moves.
    pub(super) fn move_from_outside(&mut self) {
        for needle in self.needles.iter_mut().filter(|n| n.line.state.outside.is_going()) {
            needle.line.state.outside.go_on();
            for i in 0..=needle.stations {
                let (k, now_m) = (needle.first + i, needle.moved_m(i));
                self.rest_m[k] -= now_m - self.moved_m[k];
                self.moved_m[k] = now_m;
            }
            let at_tip_m = self.moved_m[needle.first + needle.stations];
            let state = &mut needle.line.state;
            state.beside_whole_m += at_tip_m - state.outside.at_tip_m;
            state.outside.at_tip_m = at_tip_m;
            self.is_still = false;
        }
    }

    /// What the elements of that needle are moved by as it begins to stay in is a part of what they hold.
    pub(super) fn begin_moved(&mut self, at: usize) {
        let needle = &self.needles[at];
        for i in 0..=needle.stations {
            self.moved_m[needle.first + i] = needle.moved_m(i);
        }
    }
}
