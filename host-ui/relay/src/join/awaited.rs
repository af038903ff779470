//! Data expected after a greeting, until it has arrived.

use std::time::{Duration, Instant};

/// Time after which a greeting with an incomplete answer is repeated; doubles each time.
const AFTER: Duration = Duration::from_millis(400);
const AFTER_AT_MOST: Duration = Duration::from_millis(3_200);

/// Data expected after a greeting.
pub(super) struct Awaited {
    pub session: bool,
    pub parameters: bool,
    pub plan: bool,
    since: Instant,
    pub patience: Duration,
}

impl Awaited {
    pub fn now() -> Self {
        Self {
            session: true,
            parameters: true,
            plan: true,
            since: Instant::now(),
            patience: AFTER,
        }
    }

    /// True if a greeting is due: it may have been sent before the server knew that this member listens.
    pub fn is_due(&self, has_scene: bool) -> bool {
        let complete = has_scene && !self.session && !self.parameters && !self.plan;
        !complete && self.since.elapsed() >= self.patience
    }

    /// Returns the next, longer, wait.
    pub fn longer(&self) -> Duration {
        (2 * self.patience).min(AFTER_AT_MOST)
    }
}
