//! The program's promise to continue its motions, passed on in short ones.

use stylet_shm_schema::{Request, VALID_RANGE_S};
use web_time::{Duration, Instant};

/// Interval at which the program's promise is passed on in short ones, s.
const RENEW_EVERY: Duration = Duration::from_millis(8);
const LONGEST_RENEWAL_S: f64 = 0.03;

/// Passes the program's promise on in short ones, from the thread that owns the ports: a killed or suspended process
/// leaves no long promise behind.
#[derive(Default)]
pub struct Renewals {
    /// End of the program's promise.
    until: Option<Instant>,
    renewed: Option<Instant>,
}

impl Renewals {
    /// Records a promise of the program.
    pub fn promise(&mut self, until: Instant) {
        (self.until, self.renewed) = (Some(until), None);
    }

    /// Returns the renewal that is due.
    pub fn due(&mut self, now: Instant) -> Option<Request> {
        let left = self.until?.checked_duration_since(now)?;
        if self.renewed.is_some_and(|at| now - at < RENEW_EVERY) {
            return None;
        }
        self.renewed = Some(now);
        let valid_s = left.as_secs_f64().clamp(VALID_RANGE_S[0], LONGEST_RENEWAL_S);
        Some(Request::KeepMoving { valid_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window with frames of 150 ms promised 225 ms, and its hand moved on for 8 mm after it was killed.
    #[test]
    fn a_long_promise_is_passed_on_in_short_ones_and_ends() {
        let (mut renewals, now) = (Renewals::default(), Instant::now());
        assert_eq!(renewals.due(now), None, "nothing was promised");
        renewals.promise(now + Duration::from_millis(225));
        let mut sent = Vec::new();
        for ms in 0..400 {
            if let Some(Request::KeepMoving { valid_s }) = renewals.due(now + Duration::from_millis(ms)) {
                assert!((0.02..=0.03).contains(&valid_s), "{valid_s}");
                sent.push(ms);
            }
        }
        assert_eq!((sent.len(), sent[1], sent.last()), (29, 8, Some(&224)));
    }
}
