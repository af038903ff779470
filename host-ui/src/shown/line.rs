//! State of the needle's line, and how long its preparation takes.

use super::Shown;
use stylet_procedure::tolerance::{PLACED_BEFORE_M, PLACED_WITHIN_M};
use stylet_shm_schema::flags;

/// Preparation of the tissue for the needle at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeedleLine {
    Ready,
    /// The needle is placed, and still outside.
    Preparing,
    /// The needle is in tissue without one.
    Missing,
}

/// Speed above which a needle outside is on its way to another line.
const MOVES_M_PER_S: f64 = 2e-3;
/// Time below which a line had been solved before the needle came.
const SOLVED_AHEAD_S: f64 = 0.3;

/// Time that the needle has waited for its line, and that the last one took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineWait {
    since_ns: Option<u64>,
    now_ns: u64,
    last_s: Option<f64>,
}

impl LineWait {
    /// Takes the present state; `now_ns` is the core's time.
    fn take(&mut self, line: Option<NeedleLine>, moves: bool, now_ns: u64) {
        self.now_ns = now_ns;
        match line {
            Some(NeedleLine::Preparing) if !moves => {
                self.since_ns.get_or_insert(now_ns);
            }
            Some(NeedleLine::Ready) => {
                self.last_s = self.waited_s().filter(|s| *s > SOLVED_AHEAD_S).or(self.last_s);
                self.since_ns = None;
            }
            _ => self.since_ns = None,
        }
    }

    fn waited_s(&self) -> Option<f64> {
        Some(self.now_ns.saturating_sub(self.since_ns?) as f64 * 1e-9)
    }

    /// Formats the wait in whole seconds, beside the last one if it is not yet longer; empty while
    /// the needle moves.
    pub fn words(&self) -> String {
        match (self.waited_s(), self.last_s) {
            (None, _) => String::new(),
            (Some(waited_s), Some(last_s)) if waited_s < last_s => format!("{waited_s:.0} of about {last_s:.0} s"),
            (Some(waited_s), _) => format!("{waited_s:.0} s"),
        }
    }
}

impl Shown {
    /// Returns the state of the line; `None` if the tissue needs none, while the hand holds no
    /// needle, and before the needle is placed.
    pub fn needle_line(&self) -> Option<NeedleLine> {
        if !self.has_flag(flags::LINE_NEEDED) || self.has_flag(flags::HAND_EMPTY) {
            None
        } else if self.has_flag(flags::LINE_READY) {
            Some(NeedleLine::Ready)
        } else if self.has_flag(flags::IN_CONTACT) {
            Some(NeedleLine::Missing)
        } else {
            self.is_placed().then_some(NeedleLine::Preparing)
        }
    }

    /// Returns whether the tip is on the planned path, at its entry or deeper.
    fn is_placed(&self) -> bool {
        let off_path_m = self.off_path_m().unwrap_or(f64::INFINITY);
        let depth_m = self.path_depth_m().unwrap_or(f64::NEG_INFINITY);
        off_path_m <= PLACED_WITHIN_M && depth_m >= -PLACED_BEFORE_M
    }

    pub(super) fn take_line_wait(&mut self) {
        let (speed, now_ns) = self.state.map_or((0.0, 0), |s| (s.speed_m_per_s, s.time_ns));
        let line = self.needle_line();
        self.line_wait.take(line, speed.abs() > MOVES_M_PER_S, now_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_compared_with_the_last_one() {
        let mut wait = LineWait::default();
        let mut at = |line, moves, s: f64| {
            wait.take(Some(line), moves, 1_000_000_000 + (s * 1e9) as u64);
            wait.words()
        };
        use NeedleLine::{Preparing, Ready};
        assert_eq!(at(Preparing, true, 0.0), "", "on its way");
        assert_eq!(at(Preparing, false, 1.0), "0 s");
        assert_eq!(at(Preparing, false, 4.0), "3 s");
        assert_eq!(at(Ready, false, 5.0), "");
        assert_eq!(at(Preparing, false, 10.0), "0 of about 4 s");
        // A line that was solved ahead is no wait.
        assert_eq!(at(Ready, false, 10.1), "");
        assert_eq!(at(Preparing, false, 20.0), "0 of about 4 s");
        assert_eq!(at(Preparing, true, 21.0), "", "another line");
        assert_eq!(at(Preparing, false, 22.0), "0 of about 4 s");
        assert_eq!(at(Preparing, false, 26.0), "4 s");
    }
}
