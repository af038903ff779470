//! Gaps in the ticks or events of a session.

use std::collections::BTreeSet;

/// Consecutive missing ticks or events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The run of the core.
    pub session_id: u64,
    /// First missing number.
    pub tick: u64,
    /// Number missing.
    pub missing: u64,
}

impl std::fmt::Display for Gap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let last = self.tick + self.missing.saturating_sub(1);
        write!(f, "{} to {last} ({})", self.tick, self.missing)
    }
}

/// Counts received and missing ticks, or events.
#[derive(Clone, Debug, Default)]
pub struct Gaps {
    records: u64,
    repeated: u64,
    sessions: BTreeSet<u64>,
    next: Option<(u64, u64)>,
    gaps: Vec<Gap>,
}

impl Gaps {
    /// Counts one record; false if its tick came before.
    pub fn record(&mut self, session_id: u64, tick: u64) -> bool {
        self.sessions.insert(session_id);
        if let Some((session, next)) = self.next
            && session == session_id
        {
            if tick < next {
                self.repeated += 1;
                return false;
            }
            if tick > next {
                self.gaps.push(Gap {
                    session_id,
                    tick: next,
                    missing: tick - next,
                });
            }
        }
        self.next = Some((session_id, tick + 1));
        self.records += 1;
        true
    }

    /// Ticks received.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Ticks received more than once.
    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// Runs of the core.
    pub fn sessions(&self) -> usize {
        self.sessions.len()
    }

    /// Gaps in order.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Missing ticks in all gaps.
    pub fn missing(&self) -> u64 {
        self.gaps.iter().map(|g| g.missing).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_missing_tick_is_counted_and_a_new_session_is_no_gap() {
        let mut gaps = Gaps::default();
        for tick in [5, 6, 9, 10] {
            assert!(gaps.record(1, tick));
        }
        assert!(!gaps.record(1, 10));
        for tick in [1, 2, 4] {
            assert!(gaps.record(2, tick));
        }
        let gap = |session_id, tick, missing| Gap {
            session_id,
            tick,
            missing,
        };
        assert_eq!(gaps.gaps(), [gap(1, 7, 2), gap(2, 3, 1)]);
        assert_eq!(
            (gaps.records(), gaps.missing(), gaps.repeated(), gaps.sessions()),
            (7, 3, 1, 2)
        );
    }
}
