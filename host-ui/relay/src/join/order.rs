//! Batches of records in the order of their numbers: what the network lost is asked for again, and what is lost for good is counted.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use stylet_shm_schema::TickRecord;

/// Batches asked for at once.
const ASK_AT_MOST: u64 = 64;
/// A request that was not answered for so long is made again.
const ASK_EVERY: Duration = Duration::from_millis(150);
/// Batches that did not come for so long, while others came, are given up.
const PATIENCE: Duration = Duration::from_secs(3);
/// Batches that may wait for an earlier one: more than a minute of them.
const HELD_AT_MOST: usize = 4096;

/// One for each connection of a `join` to a server.
#[derive(Default)]
pub struct Order {
    run: u64,
    /// The batch that comes next; nothing before the first.
    next: Option<u64>,
    held: BTreeMap<u64, Vec<TickRecord>>,
    /// When the batch that comes next was missed first, and when it was asked for last.
    missed: Option<Instant>,
    asked: Option<Instant>,
    /// Session and number of the last record that was handed on.
    last: Option<(u64, u64)>,
    lost: u64,
}

impl Order {
    /// A batch that arrived. A server that was started again numbers anew.
    pub fn put(&mut self, run: u64, number: u64, records: Vec<TickRecord>) {
        if self.run != run {
            *self = Self {
                run,
                last: self.last,
                lost: self.lost,
                ..Self::default()
            };
        }
        let next = *self.next.get_or_insert(number);
        if number >= next && self.held.len() < HELD_AT_MOST {
            self.held.insert(number, records);
        }
    }

    /// The server does not keep these any more.
    pub fn give_up(&mut self, run: u64, to: u64) {
        if run == self.run
            && self.next.is_some_and(|next| next <= to)
            && self.held.keys().next().is_some_and(|first| *first > to)
        {
            self.skip();
        }
    }

    fn skip(&mut self) {
        if let Some(first) = self.held.keys().next() {
            (self.next, self.missed, self.asked) = (Some(*first), None, None);
        }
    }

    /// The batch that comes next, once it is there.
    pub fn take(&mut self, now: Instant) -> Option<Vec<TickRecord>> {
        let next = self.next?;
        let Some(records) = self.held.remove(&next) else {
            if self.held.is_empty() {
                self.missed = None;
            } else if now - *self.missed.get_or_insert(now) > PATIENCE {
                self.skip();
            }
            return None;
        };
        (self.next, self.missed, self.asked) = (Some(next + 1), None, None);
        for record in &records {
            if let Some((_, tick)) = self.last.filter(|(session, _)| *session == record.session_id) {
                self.lost += record.tick.saturating_sub(tick + 1);
            }
            self.last = Some((record.session_id, record.tick));
        }
        Some(records)
    }

    /// The first and the last of the batches to ask for now.
    pub fn missing(&mut self, now: Instant) -> Option<(u64, u64)> {
        let (next, first) = (self.next?, *self.held.keys().next()?);
        let is_due = self.asked.is_none_or(|asked| now - asked >= ASK_EVERY);
        if next >= first || !is_due {
            return None;
        }
        self.asked = Some(now);
        Some((next, (first - 1).min(next + ASK_AT_MOST - 1)))
    }

    /// Which run of the server the numbers belong to.
    pub fn run(&self) -> u64 {
        self.run
    }

    /// Records of this run of the core that never came.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn batch(number: u64) -> Vec<TickRecord> {
        let record = |i: u64| TickRecord {
            session_id: 7,
            tick: 10 * number + i,
            ..TickRecord::zeroed()
        };
        (0..10).map(record).collect()
    }

    fn taken(order: &mut Order, now: Instant) -> Vec<u64> {
        std::iter::from_fn(|| order.take(now))
            .map(|batch| batch[0].tick / 10)
            .collect()
    }

    #[test]
    fn what_was_lost_is_asked_for_and_comes_in_its_place() {
        let (mut order, now) = (Order::default(), Instant::now());
        for number in [5, 6, 9, 8] {
            order.put(1, number, batch(number));
        }
        assert_eq!(taken(&mut order, now), [5, 6]);
        assert_eq!(order.missing(now), Some((7, 7)));
        assert_eq!(order.missing(now), None, "asked for once in a while");
        assert_eq!(order.missing(now + ASK_EVERY), Some((7, 7)));
        order.put(1, 7, batch(7));
        order.put(1, 6, batch(6));
        assert_eq!(taken(&mut order, now), [7, 8, 9]);
        assert_eq!((order.lost(), order.missing(now + ASK_EVERY)), (0, None));
    }

    #[test]
    fn what_is_lost_for_good_is_counted_and_holds_nothing_up() {
        let (mut order, now) = (Order::default(), Instant::now());
        for number in [1, 4] {
            order.put(1, number, batch(number));
        }
        assert_eq!(taken(&mut order, now), [1]);
        order.give_up(1, 3);
        assert_eq!(taken(&mut order, now), [4]);
        assert_eq!(order.lost(), 20);
        order.put(1, 6, batch(6));
        assert!(taken(&mut order, now).is_empty());
        assert_eq!(taken(&mut order, now + PATIENCE), Vec::<u64>::new());
        let late = now + PATIENCE + Duration::from_millis(1);
        assert!(order.take(late).is_none());
        assert_eq!(taken(&mut order, late), [6]);
        assert_eq!(order.lost(), 30);
    }

    #[test]
    fn a_server_that_was_started_again_goes_on_where_it_is_and_the_gap_is_counted() {
        let (mut order, now) = (Order::default(), Instant::now());
        order.put(1, 900, batch(900));
        assert_eq!(taken(&mut order, now), [900]);
        order.put(2, 1, batch(905));
        assert_eq!(taken(&mut order, now), [905]);
        assert_eq!(order.lost(), 40);
    }
}
