//! The tissue loop's response to the second device: the contact of the probe in that hand.

use super::TissueLoop;
use crate::rt::put_in::moved;
use crate::rt::second::ProbeResponse;
use nalgebra::{SMatrix, Vector3};
use stylet_hw::Wrench;
use stylet_sim::probe::ProbePose;

/// Largest penetration of a pad after a tick that is not felt, m.
const FELT_M: f64 = 1e-4;
/// Most ticks for which the hand keeps the last solved contact while a new one converges. Beyond that its force is off.
const MOST_HELD: u32 = 4;

/// The last solved contact, and the ticks for which the hand has had it since.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Answered {
    solved: ProbeResponse,
    held: u32,
}

impl Answered {
    /// Returns the response for the hand, given this tick's `response`.
    fn next(&mut self, response: ProbeResponse) -> ProbeResponse {
        if !response.unsolved {
            *self = Answered {
                solved: response,
                held: 0,
            };
            return response;
        }
        if self.held == MOST_HELD {
            return response;
        }
        self.held += 1;
        ProbeResponse {
            time_ns: response.time_ns,
            tick: response.tick,
            ..self.solved
        }
    }
}

impl TissueLoop {
    /// Follows the second hand's probe in the scene's body frame, from which an exercise may have moved the body.
    pub(super) fn follow_second(&mut self) {
        let Some(second) = &mut self.ports.second else { return };
        let pose = second.pose.read();
        if pose.time_ns > 0 {
            let axis = pose.world_from_tool * Vector3::z();
            let tip_in_body = moved(pose.tip_in_scene, -self.state.pose.body_moved_m);
            self.state.probe_pose = ProbePose::new(tip_in_body.into(), axis.into()).or(self.state.probe_pose);
        }
    }

    /// Answers the second device. Stamped in every tick, so that its loop detects late tissue. Does nothing without a
    /// second device.
    pub(super) fn answer_second(&mut self, woke_ns: u64) {
        let tick = self.state.response.tick;
        let Some(second) = &mut self.ports.second else { return };
        // The pose that this tick has used: the buffer is not read again.
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
            response.edge_um = (1e6 * pressed.ready().solved.edge_m).round() as u32;
            response.touches = contact.contacts > 0;
            response.unsolved = pressed.report().open_m > FELT_M;
            response.wrench = Wrench {
                force_n: contact.wrench.force_n().into(),
                torque_nm: contact.wrench.torque_nm().into(),
            };
            response.stiffness = SMatrix::from_fn(|row, column| -contact.stiffness[row][column]);
        }
        second.response.write(self.answered.next(response));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_that_is_not_solved_leaves_the_hand_the_last_one_for_a_while() {
        let mut answered = Answered::default();
        let solved = ProbeResponse {
            tick: 1,
            touches: true,
            tip_in_scene: Vector3::x(),
            wrench: Wrench::from_force(Vector3::y()),
            ..ProbeResponse::default()
        };
        let unsolved = |tick| ProbeResponse {
            tick,
            unsolved: true,
            touches: true,
            wrench: Wrench::from_force(Vector3::y() * 9.0),
            ..ProbeResponse::default()
        };
        // Nothing is felt before the first solution.
        assert!(!answered.next(unsolved(0)).touches);
        answered.next(solved);
        for tick in 2..2 + u64::from(MOST_HELD) {
            let held = answered.next(unsolved(tick));
            assert!(held.touches && !held.unsolved);
            assert_eq!(
                (held.tick, held.wrench, held.tip_in_scene),
                (tick, solved.wrench, solved.tip_in_scene)
            );
        }
        assert!(answered.next(unsolved(9)).unsolved);
        assert!(answered.next(unsolved(10)).unsolved, "and it stays so");
        answered.next(solved);
        assert!(!answered.next(unsolved(12)).unsolved);
    }
}
