//! The tissue loop's answer to the second device: what the probe that its hand holds presses.

use super::TissueLoop;
use crate::rt::put_in::moved;
use crate::rt::second::ProbeResponse;
use nalgebra::{SMatrix, Vector3};
use stylet_hw::Wrench;
use stylet_sim::probe::ProbePose;

/// A pad that is farther on the wrong side of the probe's surface than that after a tick is not to be felt, m.
const FELT_M: f64 = 1e-4;

impl TissueLoop {
    /// Where the second hand has the probe: in the body as the scene has it, from which an exercise may have moved it.
    pub(super) fn follow_second(&mut self) {
        let Some(second) = &mut self.ports.second else { return };
        let pose = second.pose.read();
        if pose.time_ns > 0 {
            let axis = pose.world_from_tool * Vector3::z();
            let tip_in_body = moved(pose.tip_in_scene, -self.pose.body_moved_m);
            self.probe_pose = ProbePose::new(tip_in_body.into(), axis.into()).or(self.probe_pose);
        }
    }

    /// Stamped in every tick, so that a loop whose tissue is late knows it. Nothing without a second device.
    pub(super) fn answer_second(&mut self, woke_ns: u64) {
        let tick = self.response.tick;
        let Some(second) = &mut self.ports.second else { return };
        // The pose that this tick has used: the buffer is not asked again.
        let pose = second.pose.output_buffer();
        let mut response = ProbeResponse {
            time_ns: woke_ns,
            tick,
            tip_in_scene: pose.tip_in_scene,
            world_from_tool: pose.world_from_tool,
            ..ProbeResponse::default()
        };
        if let Some(pressed) = &self.pressed {
            let contact = pressed.response();
            response.touches = contact.contacts > 0;
            response.unsolved = pressed.report().open_m > FELT_M;
            response.wrench = Wrench {
                force_n: contact.wrench.force_n().into(),
                torque_nm: contact.wrench.torque_nm().into(),
            };
            response.stiffness = SMatrix::from_fn(|row, column| -contact.stiffness[row][column]);
        }
        second.response.write(response);
    }
}
