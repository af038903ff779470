//! How much of the snapshots a member gets: what its line carries in time, by what it says that it has had.

use crate::wire::MAX_THIN_BYTES;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Snapshots on their way at most.
const AT_MOST: usize = 4;
/// A snapshot that is on its way for so long keeps further ones back, and shows that less has to be sent.
const SLOW: Duration = Duration::from_millis(100);
/// A snapshot that came within this time shows that more can be sent.
const FAST: Duration = Duration::from_millis(60);
/// A snapshot that was not seen for so long is taken for lost.
const LOST: Duration = Duration::from_millis(400);
/// Bytes of places in a snapshot at least.
const LEAST_BYTES: usize = 1500;
const MORE_BYTES: usize = 500;

/// Of one member.
pub struct Pace {
    /// Number and time of those on their way.
    away: VecDeque<(u64, Instant)>,
    number: u64,
    bytes: usize,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            away: VecDeque::new(),
            number: 0,
            bytes: MAX_THIN_BYTES,
        }
    }
}

impl Pace {
    /// Bytes of places that the next snapshot may have; nothing while the line is full.
    pub fn room(&mut self, now: Instant) -> Option<usize> {
        while self.away.front().is_some_and(|(_, at)| now - *at >= LOST) {
            self.away.pop_front();
            self.less();
        }
        let is_slow = self.away.front().is_some_and(|(_, at)| now - *at >= SLOW);
        (self.away.len() < AT_MOST && !is_slow).then_some(self.bytes)
    }

    /// The number of the next snapshot.
    pub fn next(&self) -> u64 {
        self.number
    }

    /// It is on its way.
    pub fn sent(&mut self, now: Instant) {
        self.away.push_back((self.number, now));
        self.number += 1;
    }

    /// The member has had it.
    pub fn seen(&mut self, number: u64, now: Instant) {
        let Some(earlier) = self.away.iter().position(|(away, _)| *away == number) else {
            return;
        };
        let at = self.away[earlier].1;
        self.away.drain(..=earlier);
        match now - at {
            late if late >= SLOW => self.less(),
            // Snapshots are datagrams: of one that has lost a datagram nothing arrives, and a smaller one has fewer.
            _ if earlier > 0 => self.bytes = (self.bytes / 4 * 3).max(LEAST_BYTES),
            early if early < FAST => self.bytes = (self.bytes + MORE_BYTES).min(MAX_THIN_BYTES),
            _ => {}
        }
    }

    fn less(&mut self) {
        self.bytes = (self.bytes / 2).max(LEAST_BYTES);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_slow_gets_less_and_one_that_is_fast_gets_more_again() {
        let (mut pace, start) = (Pace::default(), Instant::now());
        let mut now = start;
        for _ in 0..8 {
            assert!(pace.room(now).is_some());
            let number = pace.next();
            pace.sent(now);
            now += SLOW;
            assert_eq!(pace.room(now), None, "one is late");
            pace.seen(number, now);
        }
        assert_eq!(pace.room(now), Some(LEAST_BYTES));
        for _ in 0..100 {
            let number = pace.next();
            pace.sent(now);
            now += FAST / 2;
            pace.seen(number, now);
        }
        assert_eq!(pace.room(now), Some(MAX_THIN_BYTES));
    }

    #[test]
    fn a_line_that_loses_gets_less() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        for lost in [true, false] {
            pace.sent(now);
            if !lost {
                pace.seen(pace.next() - 1, now + FAST / 2);
            }
        }
        assert_eq!(pace.room(now), Some(MAX_THIN_BYTES / 4 * 3));
        for _ in 0..100 {
            pace.sent(now);
            pace.sent(now);
            pace.seen(pace.next() - 1, now);
        }
        assert_eq!(pace.room(now), Some(LEAST_BYTES));
    }

    #[test]
    fn a_member_that_says_nothing_has_few_on_their_way_and_is_tried_again() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        let sent = std::iter::from_fn(|| pace.room(now).map(|_| pace.sent(now))).count();
        assert_eq!(sent, AT_MOST);
        assert_eq!(pace.room(now + SLOW), None);
        assert!(pace.room(now + LOST).is_some_and(|room| room < MAX_THIN_BYTES));
    }
}
