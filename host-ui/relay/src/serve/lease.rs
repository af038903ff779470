//! The lease of the needle, with one holder at a time. A hand next to the core takes precedence over remote ones, and a
//! silent hand loses it.

use std::time::{Duration, Instant};

/// Silence after which an operator loses the lease and the hand is stopped.
pub const SILENCE: Duration = Duration::from_millis(300);
/// Time after its last request during which a hand next to the core takes precedence.
pub const LOCAL_STAYS: Duration = Duration::from_secs(10);

/// Holder of the lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holder {
    /// Free for the first operator that asks.
    Nobody,
    /// A host next to the core.
    Local,
    /// The member of a seat.
    Seat(u16),
}

/// Reason why a seat does not operate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// A host next to the core operates.
    ByLocal,
    /// The member of that seat operates.
    BySeat(u16),
}

/// The lease, and its applicant.
pub struct Lease {
    holder: Holder,
    /// Time at which the holder was last heard.
    heard: Instant,
    asked: Option<u16>,
}

impl Lease {
    /// Returns a free lease.
    pub fn new(now: Instant) -> Self {
        Self {
            holder: Holder::Nobody,
            heard: now,
            asked: None,
        }
    }

    /// Holder of the lease.
    pub fn holder(&self) -> Holder {
        self.holder
    }

    /// Seat that asked to operate and does not yet.
    pub fn asked(&self) -> Option<u16> {
        self.asked
    }

    /// Records that a member is alive.
    pub fn heard(&mut self, seat: u16, now: Instant) {
        if self.holder == Holder::Seat(seat) {
            self.heard = now;
        }
    }

    /// Records that a host next to the core moved the needle. Returns the seat that operated until then.
    pub fn local_operates(&mut self, now: Instant) -> Option<u16> {
        let before = self.give(Holder::Local, now);
        match before {
            Holder::Seat(seat) => Some(seat),
            _ => None,
        }
    }

    /// Requests the lease for a seat, by an order or by its first request.
    pub fn take(&mut self, seat: u16, now: Instant) -> Result<(), Held> {
        let refused = match self.holder {
            Holder::Seat(other) if other != seat => Held::BySeat(other),
            Holder::Local if now - self.heard < LOCAL_STAYS => Held::ByLocal,
            _ => {
                self.give(Holder::Seat(seat), now);
                return Ok(());
            }
        };
        self.asked = Some(seat);
        Err(refused)
    }

    /// Hands it over; returns the former holder.
    pub fn give(&mut self, to: Holder, now: Instant) -> Holder {
        if to == self.asked.map_or(Holder::Nobody, Holder::Seat) {
            self.asked = None;
        }
        self.heard = now;
        std::mem::replace(&mut self.holder, to)
    }

    /// Returns the seat that operated and has fallen silent: the hand must be stopped.
    pub fn silent(&mut self, now: Instant) -> Option<u16> {
        let Holder::Seat(seat) = self.holder else { return None };
        if now - self.heard < SILENCE {
            return None;
        }
        self.give(Holder::Nobody, now);
        Some(seat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_millis(1);

    #[test]
    fn a_silent_operator_loses_the_lease_once_and_a_heard_one_does_not() {
        let start = Instant::now();
        let mut lease = Lease::new(start);
        assert_eq!(lease.silent(start + LOCAL_STAYS), None, "nobody operates");
        assert_eq!(lease.take(3, start), Ok(()));
        lease.heard(3, start + SILENCE - STEP);
        lease.heard(4, start + 2 * SILENCE);
        assert_eq!(lease.silent(start + 2 * SILENCE - 2 * STEP), None);
        assert_eq!(lease.silent(start + 2 * SILENCE), Some(3));
        assert_eq!(
            (lease.silent(start + 3 * SILENCE), lease.holder()),
            (None, Holder::Nobody)
        );
    }

    #[test]
    fn one_operates_at_a_time_and_hands_over() {
        let now = Instant::now();
        let mut lease = Lease::new(now);
        assert_eq!(lease.take(3, now), Ok(()));
        assert_eq!(lease.take(4, now), Err(Held::BySeat(3)));
        assert_eq!((lease.asked(), lease.holder()), (Some(4), Holder::Seat(3)));
        assert_eq!(lease.give(Holder::Seat(4), now), Holder::Seat(3));
        assert_eq!((lease.asked(), lease.take(3, now)), (None, Err(Held::BySeat(4))));
    }

    #[test]
    fn a_hand_beside_the_core_goes_first_and_is_waited_for() {
        let start = Instant::now();
        let mut lease = Lease::new(start);
        assert_eq!(lease.take(3, start), Ok(()));
        assert_eq!(lease.local_operates(start), Some(3));
        assert_eq!(lease.take(3, start + LOCAL_STAYS - STEP), Err(Held::ByLocal));
        assert_eq!(
            lease.silent(start + LOCAL_STAYS),
            None,
            "a hand that rests is not silent"
        );
        assert_eq!(lease.take(3, start + LOCAL_STAYS), Ok(()));
    }
}
