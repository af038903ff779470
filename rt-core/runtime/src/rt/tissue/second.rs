//! The tissue loop's answer to the second device: what the hand that holds it touches.

use super::TissueLoop;
use crate::rt::second::ProbeResponse;

impl TissueLoop {
    /// Stamped in every tick, so that a loop whose tissue is late knows it. Nothing without a second device.
    pub(super) fn answer_second(&mut self, woke_ns: u64) {
        let Some(second) = &mut self.ports.second else { return };
        let pose = second.pose.read();
        second.response.write(ProbeResponse {
            time_ns: woke_ns,
            tick: self.response.tick,
            tip_in_scene: pose.tip_in_scene,
            world_from_tool: pose.world_from_tool,
            ..ProbeResponse::default()
        });
    }
}
