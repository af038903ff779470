//! Converts the server's times to this machine's clock, from the messages with the shortest delay.

use crate::wire::Stamp;

/// Clocks drift apart: the minimum over this time and the period before counts.
const WINDOW_NS: u64 = 10_000_000_000;

#[derive(Clone, Copy, Debug)]
struct Least {
    /// Difference between a message's time of sending there and its arrival by the clock here.
    ahead_ns: i64,
    round_trip_ns: u64,
}

impl Least {
    const NONE: Self = Self {
        ahead_ns: i64::MAX,
        round_trip_ns: u64::MAX,
    };

    fn of(self, other: Self) -> Self {
        Self {
            ahead_ns: self.ahead_ns.min(other.ahead_ns),
            round_trip_ns: self.round_trip_ns.min(other.round_trip_ns),
        }
    }
}

/// The server's clock. A message without queueing takes half of the shortest round trip.
#[derive(Debug)]
pub(super) struct Clock {
    run: u64,
    since_ns: u64,
    now: Least,
    before: Least,
}

impl Clock {
    pub fn new() -> Self {
        Self {
            run: 0,
            since_ns: 0,
            now: Least::NONE,
            before: Least::NONE,
        }
    }

    fn note(&mut self, least: Least, now_ns: u64) {
        if now_ns.saturating_sub(self.since_ns) >= WINDOW_NS {
            (self.before, self.now, self.since_ns) = (self.now, Least::NONE, now_ns);
        }
        self.now = self.now.of(least);
    }

    /// Records the arrival of a message. A server on another machine has another clock.
    pub fn heard(&mut self, stamp: &Stamp, now_ns: u64) {
        if stamp.run != self.run {
            *self = Self {
                run: stamp.run,
                since_ns: now_ns,
                ..Self::new()
            };
        }
        let ahead_ns = now_ns.wrapping_sub(stamp.sent_ns).cast_signed();
        self.note(
            Least {
                ahead_ns,
                ..Least::NONE
            },
            now_ns,
        );
    }

    /// Records a round trip.
    pub fn answered(&mut self, round_trip_ns: u64, now_ns: u64) {
        let least = Least {
            round_trip_ns,
            ..Least::NONE
        };
        self.note(least, now_ns);
    }

    fn least(&self) -> Least {
        self.now.of(self.before)
    }

    /// Shortest travel time of a message; 0 while no round trip is known.
    pub fn way_ns(&self) -> u64 {
        match self.least().round_trip_ns {
            u64::MAX => 0,
            round_trip_ns => round_trip_ns / 2,
        }
    }

    /// Converts `there_ns` at the server to the time here.
    pub fn here_ns(&self, there_ns: u64) -> u64 {
        let ahead_ns = match self.least().ahead_ns {
            i64::MAX => 0,
            ahead_ns => ahead_ns,
        };
        there_ns.wrapping_add_signed(ahead_ns).saturating_sub(self.way_ns())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn stamp(run: u64, sent_ns: u64) -> Stamp {
        Stamp {
            run,
            number: 0,
            sent_ns,
            heard_ns: 0,
        }
    }

    #[test]
    fn the_message_that_waited_least_says_how_far_the_clocks_are_apart() {
        // The other clock is 5000 ms ahead, or 7000 behind; 20 ms each way, plus queueing for some.
        for ahead_ms in [5000, -7000_i64] {
            let mut clock = Clock::new();
            let there = |here_ms: u64| (here_ms.wrapping_add_signed(ahead_ms)) * MS;
            for (n, waited_ms) in [80, 0, 30, 200].into_iter().enumerate() {
                let sent_ms = 10_000 + 50 * n as u64;
                clock.heard(&stamp(1, there(sent_ms)), (sent_ms + 20 + waited_ms) * MS);
            }
            clock.answered(40 * MS, 10_300 * MS);
            assert_eq!(clock.here_ns(there(10_100)), 10_100 * MS, "{ahead_ms}");
            assert_eq!(clock.way_ns(), 20 * MS);
        }
    }

    #[test]
    fn clocks_that_drift_are_followed_and_another_server_begins_anew() {
        let mut clock = Clock::new();
        for s in 0..60 {
            // A drift of 1 ms per second.
            clock.heard(&stamp(1, (1000 + s) * 1000 * MS), ((1000 + s) * 1000 + s) * MS);
        }
        let lag_ms = clock.here_ns(1059 * 1000 * MS) / MS;
        assert!((1_059_000 + 39..=1_059_000 + 59).contains(&lag_ms), "{lag_ms}");
        clock.heard(&stamp(2, 3 * MS), 5 * MS);
        assert_eq!(clock.here_ns(3 * MS), 5 * MS);
    }
}
