//! Effect of the probe on needles that stay in: it moves the tissue past them.

use super::{LeftNeedle, LeftNeedles};

impl LeftNeedle {
    /// Returns the displacement of the tissue there along the needle by the probe, m.
    fn moved_m(&self, element: usize) -> f64 {
        let outside = &self.line.state.outside;
        self.rows(element).map(|(row, weight)| weight * outside.at_m(row)).sum()
    }
}

impl LeftNeedles {
    /// Displaces the tissue past the needle of that line by the probe, row by row, m, within so many ticks. Returns
    /// false without a needle of that number. Does not allocate.
    pub fn displace_from_outside(&mut self, generation: u64, rows_m: &[f64], ticks: u32) -> bool {
        let needle = self.needles.iter_mut().find(|n| n.line.generation == generation);
        needle.map(|n| n.line.displace_from_outside(rows_m, ticks)).is_some()
    }

    /// Moves the elements the other way where tissue goes past a needle. One comparison for each needle where nothing
    /// moves.
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

    /// Includes the displacement at which a needle begins to stay in among what its elements hold.
    pub(super) fn begin_moved(&mut self, at: usize) {
        let needle = &self.needles[at];
        for i in 0..=needle.stations {
            self.moved_m[needle.first + i] = needle.moved_m(i);
        }
    }
}
