//! What carried the body in the tick before: where that is the same again, nothing has to be added up.

use stylet_sim::line::MAX_STATIONS;

/// Loads of the line that the needle is on, and what moves the whole body besides.
pub(super) struct LastCarry {
    /// Line, how many loads, and where all of it was moved; `None` where the next tick has to look at everything.
    of: Option<(u64, usize, [f64; 3])>,
    /// With a rigid needle's loads; one that bends is never the same.
    loads_n: [f64; 2 * MAX_STATIONS],
}

impl LastCarry {
    pub fn new() -> Self {
        Self {
            of: None,
            loads_n: [0.0; 2 * MAX_STATIONS],
        }
    }

    /// Something else has moved the body, or a field of needles that stay in is another.
    pub fn forget(&mut self) {
        self.of = None;
    }

    /// Whether the tick before had the same; this one's are kept.
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
        // What is no number is never the same, so that it is not kept.
        assert!(!last.is_again(4, &[f64::NAN], [0.0; 3]) && !last.is_again(4, &[f64::NAN], [0.0; 3]));
        assert!(!last.is_again(4, &[0.0; 3 * MAX_STATIONS], [0.0; 3]));
    }
}
