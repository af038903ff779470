//! Batches of records kept for members that missed them.

use crate::wire::Ticks;
use std::collections::VecDeque;
use std::sync::Arc;
use stylet_shm_schema::TickRecord;

/// A minute of batches: 2 MB at rest, 18 MB if no record resembles the one before.
const AT_MOST: usize = 3000;
/// Most batches sent for one request.
const AGAIN_AT_MOST: usize = 96;

/// Batches of the latest run of the core, in the order of their ticks.
#[derive(Default)]
pub struct Kept {
    session_id: u64,
    batches: VecDeque<Batch>,
    /// Batches from before this server's start have arrived, as far as known.
    is_whole: bool,
}

struct Batch {
    first: u64,
    last: u64,
    bytes: Arc<Vec<u8>>,
}

/// Answer to a member that missed ticks.
#[derive(Default)]
pub struct Again {
    /// Ticks that are not kept.
    pub lost: Option<Ticks>,
    /// Messages with the kept ticks.
    pub batches: Vec<Arc<Vec<u8>>>,
}

impl Kept {
    /// True if there is a batch.
    pub fn has_any(&self) -> bool {
        !self.batches.is_empty()
    }

    /// Adds the newest batch, with the message that carries it.
    pub fn keep(&mut self, records: &[TickRecord], bytes: Vec<u8>) {
        let Some((first, last)) = records.first().zip(records.last()) else {
            return;
        };
        if first.session_id != self.session_id {
            self.batches.clear();
            self.session_id = first.session_id;
        }
        self.batches.push_back(Batch {
            first: first.tick,
            last: last.tick,
            bytes: Arc::new(bytes),
        });
        while self.batches.len() > AT_MOST {
            self.batches.pop_front();
        }
    }

    /// Adds another's batches, in the order of their ticks: those of this run that are older than all here.
    pub fn complete(&mut self, older: impl DoubleEndedIterator<Item = (Vec<TickRecord>, Vec<u8>)>) {
        for (records, bytes) in older.rev() {
            let Some((first, last)) = records.first().zip(records.last()) else {
                continue;
            };
            let precedes = self.batches.front().is_some_and(|batch| last.tick < batch.first);
            if precedes && first.session_id == self.session_id && self.batches.len() < AT_MOST {
                self.batches.push_front(Batch {
                    first: first.tick,
                    last: last.tick,
                    bytes: Arc::new(bytes),
                });
            }
        }
        self.is_whole = true;
    }

    /// Returns the answer for a member that missed `ticks`. It omits ticks that may still arrive: the member asks
    /// again.
    pub fn again(&self, ticks: Ticks) -> Again {
        let missed = || {
            self.batches
                .iter()
                .filter(|b| b.last >= ticks.from && b.first <= ticks.to)
        };
        let first = missed().next().map_or(ticks.to.saturating_add(1), |batch| batch.first);
        let begins = self.batches.front().map_or(u64::MAX, |batch| batch.first);
        let may_come = !self.is_whole && ticks.from < begins;
        let is_known = ticks.session_id == self.session_id && ticks.from <= ticks.to;
        if !is_known || may_come {
            return Again::default();
        }
        let lost = (first > ticks.from).then(|| Ticks { to: first - 1, ..ticks });
        let batches = missed().take(AGAIN_AT_MOST).map(|batch| Arc::clone(&batch.bytes));
        Again {
            lost,
            batches: batches.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn batch(session_id: u64, number: u64) -> (Vec<TickRecord>, Vec<u8>) {
        let record = |i: u64| TickRecord {
            session_id,
            tick: 10 * number + i,
            ..TickRecord::zeroed()
        };
        ((0..10).map(record).collect(), vec![number as u8])
    }

    fn kept(numbers: std::ops::Range<u64>) -> Kept {
        let mut kept = Kept::default();
        for number in numbers {
            let (records, bytes) = batch(7, number);
            kept.keep(&records, bytes);
        }
        kept
    }

    fn answer(kept: &Kept, from: u64, to: u64) -> (Option<(u64, u64)>, Vec<u8>) {
        let again = kept.again(Ticks {
            session_id: 7,
            from,
            to,
        });
        let numbers = again.batches.iter().map(|bytes| bytes[0]).collect();
        (again.lost.map(|ticks| (ticks.from, ticks.to)), numbers)
    }

    #[test]
    fn a_restarted_server_has_earlier_records_and_answers_once_they_arrive() {
        let mut kept = kept(5..8);
        assert_eq!(answer(&kept, 55, 65), (None, vec![5, 6]));
        assert_eq!(answer(&kept, 20, 49), (None, vec![]), "it may come");
        let older = [(7, 2), (6, 9), (7, 3), (7, 4), (7, 5)].map(|(session_id, number)| batch(session_id, number));
        kept.complete(older.into_iter());
        assert_eq!(answer(&kept, 20, 49), (None, vec![2, 3, 4]));
        assert_eq!(answer(&kept, 0, 29), (Some((0, 19)), vec![2]));
        assert_eq!(answer(&kept, 0, 9), (Some((0, 9)), vec![]));
    }

    #[test]
    fn another_run_of_the_core_begins_anew_and_a_minute_is_kept() {
        let mut kept = kept(0..3001);
        kept.complete(std::iter::empty());
        assert_eq!(answer(&kept, 0, 10), (Some((0, 9)), vec![1]));
        let (records, bytes) = batch(8, 1);
        kept.keep(&records, bytes);
        assert_eq!(
            answer(&kept, 100, 110),
            (None, vec![]),
            "nothing is known of another run"
        );
    }
}
