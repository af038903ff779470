//! Tolerances for a tip at its target, tissue at rest, and a failed move.

use stylet_shm_schema::{HapticState, flags};

/// The tip is at its target within this distance along the needle, m.
pub const AT_TARGET_M: f64 = 0.3e-3;
/// A hand that the force holds back from its target counts as arrived within this distance, m.
pub const STALLED_M: f64 = 2e-3;
/// Time that a hand held back must rest to count as arrived, s.
pub const STALLED_AFTER_S: f64 = 1.5;
/// Speed below which a tip rests, m/s. It is above the noise of the speed estimate: a lower one would let chance decide
/// when a creeping tip has arrived.
pub const REST_SPEED_M_PER_S: f64 = 3e-3;
/// Time that a tip at its target must rest to count as arrived, s.
pub const REST_FOR_S: f64 = 0.06;
/// Tissue is at rest when no element is farther from its place than this, m.
pub const TISSUE_REST_M: f64 = 0.05e-3;
/// Time for which the tissue must stay at rest, s.
pub const TISSUE_REST_FOR_S: f64 = 0.2;
/// Longest wait for tissue to come to rest, s.
pub const TISSUE_REST_LIMIT_S: f64 = 10.0;
/// A person may drop a seed while the tip is this near to its place, m, even before it rests.
pub const BY_HAND_M: f64 = 1e-3;
/// Largest distance from its path at which a needle counts as placed, m.
pub const PLACED_WITHIN_M: f64 = 1.5e-3;
/// Largest distance before the entry at which a tip counts as placed, m.
pub const PLACED_BEFORE_M: f64 = 5e-3;
/// Depth from the entry below which a tip counts as outside the body, m.
pub const OUTSIDE_M: f64 = 3e-3;

/// Returns the time for which the tip must stay unchanged to count as arrived, s; `None` while it is on its way.
pub fn arrived_after_s(state: &HapticState, off_along_m: f64) -> Option<f64> {
    let near = off_along_m.abs() <= STALLED_M;
    let there = off_along_m.abs() <= AT_TARGET_M && (state.flags & flags::AT_GOAL != 0 || state.depth_m > 0.0);
    (is_at_rest(state.speed_m_per_s) && near).then_some(if there { REST_FOR_S } else { STALLED_AFTER_S })
}

/// True if a tip of this speed, m/s, rests.
pub fn is_at_rest(speed_m_per_s: f64) -> bool {
    speed_m_per_s.abs() < REST_SPEED_M_PER_S
}

/// Time limit of a move at this speed, m/s, s.
pub fn move_limit_s(speed_m_per_s: f64) -> f64 {
    6.0 + (0.5 / speed_m_per_s.max(1e-4)).min(600.0)
}
