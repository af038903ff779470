//! Tip deflection of a bent needle, and the lag of tissue without a line.

use super::HapticLoop;
use crate::rt::response::TissueResponse;
use stylet_sim::force::chain::ChainOutput;
use stylet_sim::needle::Phase;

impl HapticLoop {
    /// True if the needle bends but its line was prepared for a rigid one.
    pub(super) fn lacks_beam(&self) -> bool {
        let bends = self.memory.parameters.force.bending.is_on();
        bends && self.line.as_ref().is_some_and(|line| !line.can_bend())
    }

    /// Displacement of the tip from a rigid needle's in the same hand, scene frame, m.
    pub(super) fn tip_deflection_m(&self, response: &ChainOutput) -> [f64; 3] {
        let (Some(bent), Some(line)) = (&response.bent, &self.line) else {
            return [0.0; 3];
        };
        let [first, second] = line.across();
        let off_m = [0, 1].map(|side| bent.tip_m[side] - bent.needle.straight_m(side, bent.needle.tip_m));
        (first * off_m[0] + second * off_m[1]).into()
    }

    /// Returns the age in ns of the pose that the tissue has answered, and the travel of the tip since, in contact
    /// without a line. On a line the force belongs to this tick.
    pub(super) fn lag(&self, woke_ns: u64, tissue: &TissueResponse, phase: Phase) -> (u64, f64) {
        if self.memory.on_line || phase == Phase::Outside || tissue.solved_ns == 0 {
            return (0, 0.0);
        }
        let far_m = (self.memory.pose.tip_in_scene - tissue.solved_tip_in_scene).norm();
        (woke_ns.saturating_sub(tissue.solved_ns), far_m)
    }
}
