//! Counts of seen ticks: ticks are numbered, so gaps in the numbers are losses.

use crate::format;

/// Number of seen ticks, and of ticks between them that ran unseen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Ticks whose record was seen.
    pub seen: u64,
    /// Ticks that ran and whose record was not seen. Deadlines that the core missed are not ticks.
    pub unseen: u64,
}

impl Seen {
    /// Returns whether no tick is missing.
    pub fn is_all(self) -> bool {
        self.unseen == 0
    }

    /// Returns the number of ticks that ran.
    pub fn ran(self) -> u64 {
        self.seen + self.unseen
    }

    /// Formats the counts, for display next to a figure of the seen ticks.
    ///
    /// ```
    /// let seen = stylet_base::seen::Seen { seen: 28_930, unseen: 31_070 };
    /// assert_eq!(seen.words(), "28 930 of 60 000 ticks seen");
    /// ```
    pub fn words(self) -> String {
        format!(
            "{} of {} ticks seen",
            format::count(self.seen),
            format::count(self.ran())
        )
    }
}

/// Sequence of tick numbers over successive runs of the core.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickOrder {
    /// Run and tick that would follow without a gap.
    next: Option<(u64, u64)>,
}

impl TickOrder {
    /// Takes the next tick; returns how many ran unseen before it. Another run of the core begins
    /// without a gap.
    pub fn missing_before(&mut self, session_id: u64, tick: u64) -> u64 {
        let next = self.next.filter(|(session, _)| *session == session_id);
        let missing = next.map_or(0, |(_, next)| tick.saturating_sub(next));
        let after = next.map_or(0, |(_, next)| next).max(tick.saturating_add(1));
        self.next = Some((session_id, after));
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_gaps_within_a_run_are_counted() {
        let mut order = TickOrder::default();
        let missing = [(1, 5), (1, 6), (1, 10), (1, 7), (1, 11), (2, 900), (2, 902)];
        let missing = missing.map(|(session, tick)| order.missing_before(session, tick));
        assert_eq!(missing, [0, 0, 3, 0, 0, 0, 1]);
    }
}
