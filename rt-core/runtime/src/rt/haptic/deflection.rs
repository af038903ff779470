//! Where a bent needle's tip is, and how far a tissue that is not on a line lags.

use super::HapticLoop;
use crate::rt::response::TissueResponse;
use stylet_sim::force::chain::ChainOutput;
use stylet_sim::needle::Phase;

impl HapticLoop {
    /// The needle bends, and its line was prepared for one that does not.
    pub(super) fn lacks_beam(&self) -> bool {
        let bends = self.parameters.force.bending.is_on();
        bends && self.line.as_ref().is_some_and(|line| !line.can_bend())
    }

    /// Tip of the needle less where a rigid one in the same hand has it, scene frame, m.
    pub(super) fn tip_deflection_m(&self, response: &ChainOutput) -> [f64; 3] {
        let (Some(bent), Some(line)) = (&response.bent, &self.line) else {
            return [0.0; 3];
        };
        let [first, second] = line.across();
        let off_m = [0, 1].map(|side| bent.tip_m[side] - bent.needle.straight_m(side, bent.needle.tip_m));
        (first * off_m[0] + second * off_m[1]).into()
    }

    /// How old the pose is that the tissue has answered, in ns, and how far the tip has come since: in contact without a line. On one
    /// the force is that of this tick.
    pub(super) fn lag(&self, woke_ns: u64, tissue: &TissueResponse, phase: Phase) -> (u64, f64) {
        if self.on_line || phase == Phase::Outside || tissue.solved_ns == 0 {
            return (0, 0.0);
        }
        let far_m = (self.pose.tip_in_scene - tissue.solved_tip_in_scene).norm();
        (woke_ns.saturating_sub(tissue.solved_ns), far_m)
    }
}
