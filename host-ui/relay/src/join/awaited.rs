//! What a greeting brings, until it has come.

use std::time::{Duration, Instant};

/// A greeting that did not come whole is asked for again after so long, each time after twice as long as the time before.
const AFTER: Duration = Duration::from_millis(400);
const AFTER_AT_MOST: Duration = Duration::from_millis(3_200);

/// What a greeting brings.
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

    /// A greeting may be sent before the server knows that this member listens.
    pub fn is_due(&self, has_scene: bool) -> bool {
        let complete = has_scene && !self.session && !self.parameters && !self.plan;
        !complete && self.since.elapsed() >= self.patience
    }

    /// How long the next one is waited for.
    pub fn longer(&self) -> Duration {
        (2 * self.patience).min(AFTER_AT_MOST)
    }
}
