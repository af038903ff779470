//! How many of the ticks that ran were seen: ticks are numbered, so what is missing shows in the numbers.

use crate::format;

/// Ticks that were seen, and ticks between them that ran and were not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Ticks whose record was seen.
    pub seen: u64,
    /// Ticks that ran and whose record was not seen. Deadlines that the core missed are no ticks.
    pub unseen: u64,
}

impl Seen {
    /// Whether no tick is missing.
    pub fn is_all(self) -> bool {
        self.unseen == 0
    }

    /// Ticks that ran.
    pub fn ran(self) -> u64 {
        self.seen + self.unseen
    }

    /// For people, beside a figure that is of the ticks seen.
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

/// The numbers of the ticks of one run of the core after another.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickOrder {
    /// Run and tick that would follow without a gap.
    next: Option<(u64, u64)>,
}

impl TickOrder {
    /// Takes the next tick; how many ran before it that were not taken. Another run of the core begins without a gap.
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
    fn gaps_in_the_numbers_are_counted_and_another_run_or_an_old_tick_is_none() {
        let mut order = TickOrder::default();
        let missing = [(1, 5), (1, 6), (1, 10), (1, 7), (1, 11), (2, 900), (2, 902)];
        let missing = missing.map(|(session, tick)| order.missing_before(session, tick));
        assert_eq!(missing, [0, 0, 3, 0, 0, 0, 1]);
    }
}
