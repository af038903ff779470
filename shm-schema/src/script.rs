//! How a scripted hand takes a needle through its plan: what the host's run and the core's rehearsal both go by.

use crate::{HapticState, flags};
use std::time::Duration;

/// The tip is at its target within this distance along the needle.
pub const AT_TARGET_M: f64 = 0.3e-3;
/// A hand that the force holds back from its goal is taken as arrived within this distance.
pub const STALLED_M: f64 = 2e-3;
/// How long a hand that is held back must rest to count as arrived.
pub const STALLED_AFTER: Duration = Duration::from_millis(1500);
/// Above the noise of the speed estimate; below it, chance would decide when a slow tip counts as arrived.
pub const REST_SPEED_M_PER_S: f64 = 3e-3;
/// How long a tip at its target must rest to count as arrived.
pub const REST_FOR: Duration = Duration::from_millis(60);
/// No element is farther from its place at rest.
pub const TISSUE_REST_M: f64 = 0.05e-3;
/// How long the tissue must stay at rest.
pub const TISSUE_REST_FOR: Duration = Duration::from_millis(200);
/// Tissue that takes longer to come back is left to do so.
pub const TISSUE_REST_LIMIT: Duration = Duration::from_secs(10);
const MOVE_MARGIN: Duration = Duration::from_secs(6);

/// How long the tip must have been as it is to count as arrived; `None` while it is on its way.
pub fn arrived_after(state: &HapticState, off_along_m: f64) -> Option<Duration> {
    let at_rest = state.speed_m_per_s.abs() < REST_SPEED_M_PER_S;
    let near = off_along_m.abs() <= STALLED_M;
    let there = off_along_m.abs() <= AT_TARGET_M && (state.flags & flags::AT_GOAL != 0 || state.depth_m > 0.0);
    (at_rest && near).then_some(if there { REST_FOR } else { STALLED_AFTER })
}

/// A move that takes longer has failed.
pub fn move_limit(speed_m_per_s: f64) -> Duration {
    MOVE_MARGIN + Duration::from_secs_f64((0.5 / speed_m_per_s.max(1e-4)).min(600.0))
}
