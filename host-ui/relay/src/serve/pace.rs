//! Adapts a member's snapshots to the capacity of its line, from its acknowledgements.

use crate::wire::MAX_THIN_BYTES;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Most snapshots on their way.
const AT_MOST: usize = 4;
/// Time on its way after which a snapshot holds further ones back, and shows that less must be sent.
const SLOW: Duration = Duration::from_millis(100);
/// Travel time within which a snapshot shows that more can be sent.
const FAST: Duration = Duration::from_millis(60);
/// Time after which an unacknowledged snapshot counts as lost.
const LOST: Duration = Duration::from_millis(400);
/// Smallest number of bytes for positions in a snapshot.
const LEAST_BYTES: usize = 1500;
const MORE_BYTES: usize = 500;
/// Bytes in the first snapshot on an unknown line.
const FIRST_BYTES: usize = MAX_THIN_BYTES / 4;

/// Pace of one member.
pub struct Pace {
    /// Snapshots on their way.
    away: VecDeque<Away>,
    number: u64,
    bytes: usize,
    had: Had,
    /// Without the scene a snapshot is useless, and takes capacity from the scene.
    has_scene: bool,
}

struct Away {
    number: u64,
    at: Instant,
    places: Places,
}

/// The positions in a message: the fingerprint of all of them, and the part contained; a stride of 0 means none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Places {
    pub fingerprint: u64,
    pub stride: usize,
}

/// The parts that a member has of the last positions. It may have lost earlier ones to these, whether it reports so or
/// not.
#[derive(Default)]
struct Had {
    fingerprint: u64,
    parts: Vec<bool>,
}

impl Had {
    fn is_of(&self, places: Places) -> bool {
        (self.fingerprint, self.parts.len()) == (places.fingerprint, places.stride)
    }

    fn sent(&mut self, places: Places) {
        if places.stride > 0 && !self.is_of(places) {
            (self.fingerprint, self.parts) = (places.fingerprint, vec![false; places.stride]);
        }
    }

    fn note(&mut self, number: u64, places: Places) {
        if places.stride > 0 && self.is_of(places) {
            self.parts[(number % places.stride as u64) as usize] = true;
        }
    }

    fn has_all(&self, fingerprint: u64) -> bool {
        self.fingerprint == fingerprint && !self.parts.is_empty() && self.parts.iter().all(|part| *part)
    }
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            away: VecDeque::new(),
            number: 0,
            bytes: FIRST_BYTES,
            had: Had::default(),
            has_scene: false,
        }
    }
}

impl Pace {
    /// Notes whether the member has the scene of the snapshots.
    pub fn note_scene(&mut self, has_scene: bool) {
        self.has_scene = has_scene;
    }

    /// Returns the bytes available for positions in the next snapshot; `None` while the line is full.
    pub fn room(&mut self, now: Instant) -> Option<usize> {
        while let Some(lost) = self.away.pop_front_if(|away| now - away.at >= LOST) {
            self.less();
            // A member that lost its positions does not report so.
            if lost.places.stride == 0 {
                self.had = Had::default();
            }
        }
        let is_slow = self.away.front().is_some_and(|away| now - away.at >= SLOW);
        (self.has_scene && self.away.len() < AT_MOST && !is_slow).then_some(self.bytes)
    }

    /// Number of the next snapshot.
    pub fn next(&self) -> u64 {
        self.number
    }

    /// True if the member has all positions of the fingerprint.
    pub fn has_all(&self, fingerprint: u64) -> bool {
        self.had.has_all(fingerprint)
    }

    /// Records a sent snapshot with its positions.
    pub fn sent(&mut self, now: Instant, places: Places) {
        self.had.sent(places);
        self.away.push_back(Away {
            number: self.number,
            at: now,
            places,
        });
        self.number += 1;
    }

    /// Resets: the member has nothing.
    pub fn forget(&mut self) {
        self.had = Had::default();
        self.away.clear();
    }

    /// Records an acknowledgement and whether the snapshot was usable; it is not if the member lacks its scene or the
    /// positions that it refers to.
    pub fn seen(&mut self, number: u64, is_of_use: bool, now: Instant) {
        let Some(earlier) = self.away.iter().position(|away| away.number == number) else {
            return;
        };
        let Away { at, places, .. } = self.away[earlier];
        self.away.drain(..=earlier);
        match is_of_use {
            true => self.had.note(number, places),
            false => self.had = Had::default(),
        }
        // A nearly empty snapshot says nothing about the line's capacity.
        if places.stride == 0 {
            return;
        }
        match now - at {
            late if late >= SLOW => self.less(),
            // Snapshots are datagrams: one that lost a datagram is lost whole, and a smaller one has fewer.
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

    const WHOLE: Places = Places {
        fingerprint: 7,
        stride: 1,
    };

    /// Pace of a member with the scene.
    fn pace() -> Pace {
        let mut pace = Pace::default();
        assert_eq!(pace.room(Instant::now()), None, "no scene yet");
        pace.note_scene(true);
        pace
    }

    /// Sends and acknowledges at once.
    fn pass(pace: &mut Pace, fingerprint: u64, stride: usize, is_seen: bool) {
        let (number, now) = (pace.next(), Instant::now());
        pace.sent(now, Places { fingerprint, stride });
        if is_seen {
            pace.seen(number, true, now);
        }
    }

    #[test]
    fn a_member_has_all_places_once_it_has_had_each_part_of_them() {
        let mut pace = pace();
        for is_seen in [true, true, false, true, true] {
            assert!(!pace.has_all(7));
            pass(&mut pace, 7, 3, is_seen);
        }
        assert!(!pace.has_all(7), "the third part was lost");
        pass(&mut pace, 7, 3, true);
        assert!(pace.has_all(7) && !pace.has_all(8));
        pass(&mut pace, 7, 0, true);
        assert!(pace.has_all(7));
        // A lost one without positions: the member may have lost its own.
        let long_ago = Instant::now();
        pass(&mut pace, 7, 0, false);
        pace.room(long_ago + 2 * LOST);
        assert!(!pace.has_all(7));
        pass(&mut pace, 8, 1, true);
        assert!(pace.has_all(8));
        let number = pace.next();
        pass(&mut pace, 8, 0, false);
        pace.seen(number, false, Instant::now());
        assert!(!pace.has_all(8), "it does not know them");
        pass(&mut pace, 8, 1, true);
        // Others were sent without acknowledgement: the member may have replaced these by them.
        pass(&mut pace, 9, 1, false);
        assert!(!pace.has_all(8) && !pace.has_all(9));
        pass(&mut pace, 8, 1, true);
        let (late, now) = (pace.next(), Instant::now());
        pass(&mut pace, 8, 1, false);
        pass(&mut pace, 9, 1, false);
        pace.seen(late, true, now);
        assert!(!pace.has_all(8), "it was had before the others were sent");
        pass(&mut pace, 8, 1, true);
        assert!(pace.has_all(8));
        pace.forget();
        assert!(!pace.has_all(8));
    }

    #[test]
    fn a_line_that_is_slow_gets_less_and_one_that_is_fast_gets_more_again() {
        let (mut pace, start) = (pace(), Instant::now());
        let mut now = start;
        for _ in 0..8 {
            assert!(pace.room(now).is_some());
            let number = pace.next();
            pace.sent(now, WHOLE);
            now += SLOW;
            assert_eq!(pace.room(now), None, "one is late");
            pace.seen(number, true, now);
        }
        assert_eq!(pace.room(now), Some(LEAST_BYTES));
        for _ in 0..100 {
            let number = pace.next();
            pace.sent(now, WHOLE);
            now += FAST / 2;
            pace.seen(number, true, now);
        }
        assert_eq!(pace.room(now), Some(MAX_THIN_BYTES));
    }

    #[test]
    fn a_line_that_loses_gets_less() {
        let (mut pace, now) = (pace(), Instant::now());
        for lost in [true, false] {
            pace.sent(now, WHOLE);
            if !lost {
                pace.seen(pace.next() - 1, true, now + FAST / 2);
            }
        }
        assert_eq!(pace.room(now), Some(FIRST_BYTES / 4 * 3));
        for _ in 0..100 {
            pace.sent(now, WHOLE);
            pace.sent(now, WHOLE);
            pace.seen(pace.next() - 1, true, now);
        }
        assert_eq!(pace.room(now), Some(LEAST_BYTES));
    }

    #[test]
    fn a_member_that_says_nothing_has_few_on_their_way_and_is_tried_again() {
        let (mut pace, now) = (pace(), Instant::now());
        let sent = std::iter::from_fn(|| pace.room(now).map(|_| pace.sent(now, WHOLE))).count();
        assert_eq!(sent, AT_MOST);
        assert_eq!(pace.room(now + SLOW), None);
        assert!(pace.room(now + LOST).is_some_and(|room| room < MAX_THIN_BYTES));
    }
}
