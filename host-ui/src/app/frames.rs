//! Frame rate of the window, and mean cost of a frame.

use crate::shown::FrameCost;
use web_time::{Duration, Instant};

const INTERVAL: Duration = Duration::from_secs(1);

/// Frames of one interval.
#[derive(Debug)]
pub(super) struct Frames {
    since: Instant,
    count: u32,
    cpu_us: f64,
    driver_us: f64,
}

impl Frames {
    /// Creates an interval that begins now.
    pub fn new(now: Instant) -> Self {
        Self {
            since: now,
            count: 0,
            cpu_us: 0.0,
            driver_us: 0.0,
        }
    }

    /// Counts a frame; at the end of an interval returns its rate (Hz) and the mean cost of a
    /// frame.
    pub fn count(&mut self, now: Instant, cost: &FrameCost) -> Option<(f64, FrameCost)> {
        self.count += 1;
        self.cpu_us += cost.cpu_us;
        self.driver_us += cost.driver_us;
        let took = now.saturating_duration_since(self.since);
        if took < INTERVAL {
            return None;
        }
        let count = f64::from(self.count);
        let mean = FrameCost {
            cpu_us: self.cpu_us / count,
            driver_us: self.driver_us / count,
            ..*cost
        };
        *self = Self::new(now);
        Some((count / took.as_secs_f64(), mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_gives_its_rate_and_mean_costs() {
        let begun = Instant::now();
        let mut frames = Frames::new(begun);
        let cost = |cpu_us| FrameCost {
            cpu_us,
            driver_us: 2.0 * cpu_us,
            ..FrameCost::default()
        };
        for interval in 0..2 {
            let start_ms = interval * 1250;
            for n in 1..5 {
                let now = begun + Duration::from_millis(start_ms + 200 * n);
                assert_eq!(frames.count(now, &cost(n as f64)), None);
            }
            let now = begun + Duration::from_millis(start_ms + 1250);
            let (rate_hz, mean) = frames.count(now, &cost(5.0)).expect("a second is over");
            assert!((rate_hz - 4.0).abs() < 1e-9, "{rate_hz}");
            assert_eq!((mean.cpu_us, mean.driver_us), (3.0, 6.0));
        }
    }
}
