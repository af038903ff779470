//! Loads that carried the body in the last tick: if they repeat, nothing has to be summed.

use stylet_sim::line::MAX_STATIONS;

/// Loads of the needle's line, and the displacement of the whole body.
pub(super) struct LastCarry {
    /// Line, number of loads, and displacement of the whole; `None` if the next tick must sum everything.
    of: Option<(u64, usize, [f64; 3])>,
    /// Loads of a rigid needle; a bending one never counts as unchanged.
    loads_n: [f64; 2 * MAX_STATIONS],
}

impl LastCarry {
    pub fn new() -> Self {
        Self {
            of: None,
            loads_n: [0.0; 2 * MAX_STATIONS],
        }
    }

    /// Forgets the loads: something else has moved the body, or the field of needles that stay in has changed.
    pub fn forget(&mut self) {
        self.of = None;
    }

    /// Returns whether the last tick had the same loads; keeps this tick's.
    pub fn is_again(&mut self, line: u64, loads_n: &[f64], whole_m: [f64; 3]) -> bool {
        let now = (line, loads_n.len(), whole_m);
        let Some(kept) = self.loads_n.get_mut(..loads_n.len()) else {
            self.of = None;
            return false;
        };
        if self.of == Some(now) && kept == loads_n {
            return true;
        }
        kept.copy_from_slice(loads_n);
        self.of = Some(now);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_loads_of_the_same_line_are_carried_by_again() {
        let mut last = LastCarry::new();
        let (loads, whole_m) = ([1.0, 2.0, 0.5], [0.0, 0.0, 1e-3]);
        assert!(!last.is_again(3, &loads, whole_m));
        assert!(last.is_again(3, &loads, whole_m));
        assert!(!last.is_again(4, &loads, whole_m));
        assert!(!last.is_again(4, &loads[..2], whole_m));
        assert!(!last.is_again(4, &loads, whole_m));
        assert!(!last.is_again(4, &loads, [0.0; 3]));
        assert!(!last.is_again(4, &[1.0, 2.0, 0.6], [0.0; 3]));
        assert!(last.is_again(4, &[1.0, 2.0, 0.6], [0.0; 3]));
        last.forget();
        assert!(!last.is_again(4, &[1.0, 2.0, 0.6], [0.0; 3]));
        // Values that are not numbers never count as unchanged, so they are not kept.
        assert!(!last.is_again(4, &[f64::NAN], [0.0; 3]) && !last.is_again(4, &[f64::NAN], [0.0; 3]));
        assert!(!last.is_again(4, &[0.0; 3 * MAX_STATIONS], [0.0; 3]));
    }
}
