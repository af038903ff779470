//! Rate limits of a seat: a burst, and a rate after that.

use std::time::Instant;

/// A token bucket: its level and its refill rate.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    most: f64,
    per_s: f64,
    left: f64,
    at: Instant,
}

impl Allowance {
    /// Allows `most` at once, and `per_s` in each second.
    pub fn new(most: f64, per_s: f64, now: Instant) -> Self {
        Self {
            most,
            per_s,
            left: most,
            at: now,
        }
    }

    /// Takes `amount`; false if it is not available.
    pub fn take(&mut self, amount: f64, now: Instant) -> bool {
        let since_s = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + since_s * self.per_s).min(self.most);
        self.at = self.at.max(now);
        let fits = amount <= self.left;
        if fits {
            self.left -= amount;
        }
        fits
    }
}

/// Limits of a seat on the server's log and on greetings, however often it connects.
pub struct Patience {
    pub lines: Allowance,
    pub unsaid: u64,
    pub refusals: Allowance,
    pub greetings: Allowance,
}

impl Patience {
    pub fn new(now: Instant) -> Self {
        Self {
            lines: Allowance::new(20.0, 1.0, now),
            unsaid: 0,
            refusals: Allowance::new(1.0, 0.1, now),
            greetings: Allowance::new(4.0, 0.5, now),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_flood_gets_what_is_allowed_and_a_pause_gives_no_more_than_at_first() {
        let start = Instant::now();
        let mut allowance = Allowance::new(5.0, 10.0, start);
        let taken = |allowance: &mut Allowance, from_ms: u64, to_ms: u64| {
            let times = (from_ms..to_ms).map(|ms| start + Duration::from_millis(ms));
            times.filter(|now| allowance.take(1.0, *now)).count()
        };
        assert_eq!(taken(&mut allowance, 0, 1000), 5 + 9);
        assert_eq!(taken(&mut allowance, 60_000, 60_010), 5);
        assert!(
            !allowance.take(6.0, start + Duration::from_secs(900)),
            "more than there ever is"
        );
    }
}
