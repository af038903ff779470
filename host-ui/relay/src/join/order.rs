//! Records in the order of their ticks: those lost on the network are requested again, and lasting losses are counted.

use super::last::Next;
use crate::wire::Ticks;
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};
use stylet_shm_schema::TickRecord;

/// Most ticks in one request.
const ASK_AT_MOST: u64 = 1280;
/// Time after which an unanswered request is repeated.
const ASK_EVERY: Duration = Duration::from_millis(150);
/// Time after which missing records are given up while later ones arrive.
const PATIENCE: Duration = Duration::from_secs(6);
/// Most batches that may wait for an earlier one: more than a minute of them.
const HELD_AT_MOST: usize = 4096;

/// Reorders batches. They are identified by the run of the core and their ticks, not by the server, so a restarted
/// server continues them.
#[derive(Default)]
pub struct Order {
    /// The run of the core, and the one before it.
    session: u64,
    session_before: u64,
    /// Next tick; `None` before the first.
    next: Option<u64>,
    /// Batches by their first tick.
    held: BTreeMap<u64, Vec<TickRecord>>,
    /// Batches held when the run ended.
    ended: VecDeque<Vec<TickRecord>>,
    /// Time at which the next tick was first missed; time of the last request, and its last tick.
    missed: Option<Instant>,
    asked: Option<(Instant, u64)>,
    lost: u64,
}

impl Order {
    /// Continues after another member.
    pub(super) fn from(next: Option<Next>) -> Self {
        Self {
            session: next.map_or(0, |next| next.session_id),
            next: next.map(|next| next.tick),
            ..Self::default()
        }
    }

    /// Returns the position after everything taken.
    pub(super) fn next(&self) -> Option<Next> {
        let session_id = self.session;
        self.next.map(|tick| Next { session_id, tick })
    }

    /// Adds an arriving batch.
    pub fn put(&mut self, records: Vec<TickRecord>) {
        let Some(first) = records.first().copied() else { return };
        if !is_one_batch(&records) || (first.session_id == self.session_before && first.session_id != self.session) {
            return;
        }
        if self.session != first.session_id {
            let ended = std::mem::take(self);
            self.lost = ended.lost;
            (self.session, self.session_before) = (first.session_id, ended.session);
            self.ended = ended.ended;
            self.ended.extend(ended.held.into_values());
        }
        let next = *self.next.get_or_insert(first.tick);
        if last_tick(&records) >= next && self.held.len() < HELD_AT_MOST {
            self.held.insert(first.tick, records);
        }
    }

    /// Gives up ticks that the server no longer keeps.
    pub fn give_up(&mut self, ticks: Ticks) {
        let is_missed = self.next.is_some_and(|next| (ticks.from..=ticks.to).contains(&next));
        if ticks.session_id == self.session && is_missed && self.first_held().is_some_and(|first| ticks.to < first) {
            self.skip_to(ticks.to + 1);
        }
    }

    fn first_held(&self) -> Option<u64> {
        self.held.keys().next().copied()
    }

    fn skip_to(&mut self, tick: u64) {
        self.lost += self.next.map_or(0, |next| tick.saturating_sub(next));
        (self.next, self.missed, self.asked) = (Some(tick), None, None);
    }

    /// Returns the next records, once they are there.
    pub fn take(&mut self, now: Instant) -> Option<Vec<TickRecord>> {
        if let Some(records) = self.ended.pop_front() {
            return Some(records);
        }
        loop {
            let (next, first) = (self.next?, self.first_held());
            let Some(first) = first.filter(|first| *first <= next) else {
                match first {
                    None => self.missed = None,
                    Some(first) if now - *self.missed.get_or_insert(now) > PATIENCE => self.skip_to(first),
                    Some(_) => {}
                }
                return None;
            };
            let mut records = self.held.remove(&first)?;
            // The batch may have arrived in two forms.
            records.retain(|record| record.tick >= next);
            if records.is_empty() {
                continue;
            }
            let last = last_tick(&records);
            self.lost += (last - next + 1).saturating_sub(records.len() as u64);
            (self.next, self.missed) = (Some(last + 1), None);
            return Some(records);
        }
    }

    /// Returns the ticks to request now.
    pub fn missing(&mut self, now: Instant) -> Option<Ticks> {
        let (next, first) = (self.next?, self.first_held()?);
        let is_due = self
            .asked
            .is_none_or(|(asked, to)| next > to || now - asked >= ASK_EVERY);
        if next >= first || !is_due {
            return None;
        }
        let to = (first - 1).min(next.saturating_add(ASK_AT_MOST - 1));
        self.asked = Some((now, to));
        Some(Ticks {
            session_id: self.session,
            from: next,
            to,
        })
    }

    /// Number of records of the core's runs that never arrived.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

fn last_tick(records: &[TickRecord]) -> u64 {
    records.last().map_or(0, |record| record.tick)
}

/// True for records of one run with rising ticks.
fn is_one_batch(records: &[TickRecord]) -> bool {
    let pairs = |pair: &[TickRecord]| pair[0].session_id == pair[1].session_id && pair[0].tick < pair[1].tick;
    records.windows(2).all(pairs) && last_tick(records) < u64::MAX
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn of_session(session_id: u64, number: u64) -> Vec<TickRecord> {
        let record = |i: u64| TickRecord {
            session_id,
            tick: 10 * number + i,
            ..TickRecord::zeroed()
        };
        (0..10).map(record).collect()
    }

    fn batch(number: u64) -> Vec<TickRecord> {
        of_session(7, number)
    }

    fn taken(order: &mut Order, now: Instant) -> Vec<u64> {
        std::iter::from_fn(|| order.take(now))
            .map(|batch| batch[0].tick / 10)
            .collect()
    }

    fn ticks(from: u64, to: u64) -> Ticks {
        let session_id = 7;
        Ticks { session_id, from, to }
    }

    #[test]
    fn what_was_lost_is_asked_for_and_comes_in_its_place() {
        let (mut order, now) = (Order::default(), Instant::now());
        for number in [5, 6, 9, 8] {
            order.put(batch(number));
        }
        assert_eq!(taken(&mut order, now), [5, 6]);
        assert_eq!(order.missing(now), Some(ticks(70, 79)));
        assert_eq!(order.missing(now), None, "asked for once in a while");
        assert_eq!(order.missing(now + ASK_EVERY), Some(ticks(70, 79)));
        order.put(batch(7));
        order.put(batch(6));
        assert_eq!(taken(&mut order, now), [7, 8, 9]);
        assert_eq!((order.lost(), order.missing(now + ASK_EVERY)), (0, None));
    }

    #[test]
    fn what_is_lost_for_good_is_counted_and_holds_nothing_up() {
        let (mut order, now) = (Order::default(), Instant::now());
        for number in [1, 4] {
            order.put(batch(number));
        }
        assert_eq!(taken(&mut order, now), [1]);
        order.give_up(ticks(20, u64::MAX));
        order.give_up(ticks(20, 39));
        assert_eq!(taken(&mut order, now), [4]);
        assert_eq!(order.lost(), 20);
        order.put(batch(6));
        assert!(taken(&mut order, now).is_empty());
        assert_eq!(taken(&mut order, now + PATIENCE), Vec::<u64>::new());
        let late = now + PATIENCE + Duration::from_millis(1);
        assert!(order.take(late).is_none());
        assert_eq!(taken(&mut order, late), [6]);
        assert_eq!(order.lost(), 30);
    }

    /// A restarted server restarts its numbers: the records made meanwhile are requested.
    #[test]
    fn what_was_made_without_a_server_is_asked_for_part_by_part() {
        let (mut order, now) = (Order::default(), Instant::now());
        order.put(batch(0));
        assert_eq!(taken(&mut order, now), [0]);
        order.put(batch(200));
        assert_eq!(order.missing(now), Some(ticks(10, 10 + ASK_AT_MOST - 1)));
        for number in 1..129 {
            order.put(batch(number));
            assert_eq!(taken(&mut order, now), [number]);
            assert!(number == 128 || order.missing(now).is_none(), "while they come");
        }
        assert_eq!(order.missing(now), Some(ticks(1290, 1999)));
        assert_eq!(order.lost(), 0);
    }

    #[test]
    fn a_successor_requests_the_gap_in_the_same_run_only() {
        let (mut before, now) = (Order::default(), Instant::now());
        before.put(batch(1));
        assert_eq!(taken(&mut before, now), [1]);
        let next = before.next();
        let mut order = Order::from(next);
        order.put(batch(4));
        assert_eq!(order.missing(now), Some(ticks(20, 39)));
        let mut of_another = Order::from(next);
        of_another.put(of_session(8, 4));
        assert_eq!((of_another.missing(now), taken(&mut of_another, now)), (None, vec![4]));
        assert_eq!(of_another.lost(), 0);
    }

    #[test]
    fn a_run_of_the_core_ends_with_what_was_held_and_the_next_begins_anew() {
        let (mut order, now) = (Order::default(), Instant::now());
        order.put(batch(1));
        order.put(batch(3));
        assert_eq!(taken(&mut order, now), [1]);
        order.put(of_session(8, 100));
        // Late, from the run before.
        order.put(batch(2));
        assert_eq!(taken(&mut order, now), [3, 100]);
        assert_eq!(order.lost(), 0);
    }

    #[test]
    fn what_comes_in_two_forms_is_handed_on_once_and_what_is_no_batch_never() {
        let (mut order, now) = (Order::default(), Instant::now());
        order.put(batch(1));
        assert_eq!(taken(&mut order, now), [1]);
        order.put([batch(1), batch(2)].concat());
        order.put([batch(4), batch(3)].concat());
        order.put([batch(5), of_session(8, 6)].concat());
        assert_eq!(order.take(now).map(|records| records.len()), Some(10));
        assert_eq!(taken(&mut order, now), Vec::<u64>::new());
        assert_eq!(order.lost(), 0);
    }
}
