//! Motions that hosts order from the second device's hand, and their lease.

use super::SecondLoop;
use crate::rt::device_loop::is_at_goal;
use crate::rt::exchange::{Moved, Notice};
use crate::rt::motion_lease::{self, Lapse, MotionLease, Promise};
use nalgebra::Vector3;
use stylet_hw::HandGoal;

impl SecondLoop {
    /// Begins a motion. A real hand follows no goal, and needs no lease.
    pub(super) fn begin_motion(&mut self, goal: HandGoal, promise: Option<Promise>) {
        self.device.set_hand_goal(&goal);
        self.memory.goal = Some(goal);
        let promise = promise.filter(|_| self.info.simulated);
        self.memory.motion = MotionLease::begin(promise, self.period_s);
    }

    /// Stops the motion as hard as when its lease lapses.
    pub(super) fn stop_motion(&mut self) {
        match self.memory.goal {
            Some(_) => self.brake(),
            None => self.device.stop_hand(),
        }
        self.memory.goal = None;
        self.memory.motion = MotionLease::Free;
    }

    pub(super) fn turn_up(&mut self, up: Option<Vector3<f64>>) {
        self.device.set_hand_up(up);
        self.memory.up = up;
    }

    pub(super) fn keep_moving(&mut self, promise: &Promise) {
        let promise = promise.within_5_mm(self.memory.goal.map_or(0.0, |goal| goal.speed_m_per_s));
        if self.memory.motion.renew(&promise, self.period_s)
            && let Some(goal) = &self.memory.goal
        {
            self.device.set_hand_up(self.memory.up);
            self.device.set_hand_goal(goal);
        }
    }

    /// Brakes a motion whose lease has lapsed.
    pub(super) fn watch_motion(&mut self) {
        let has_arrived = self.has_arrived();
        match self.memory.motion.tick(has_arrived, self.period_s) {
            Some(Lapse::Brake) => self.brake(),
            Some(Lapse::GiveUp) => {
                self.memory.goal = None;
                let (tick, time_ns) = (self.memory.state.tick + 1, self.memory.state.time_ns);
                let what = Moved::SecondHand;
                self.notify(Notice::MotionGivenUp { tick, time_ns, what });
            }
            None => {}
        }
    }

    fn brake(&mut self) {
        let memory = &self.memory;
        if let Some(goal) = &memory.goal {
            let velocity = memory.estimator.velocity_m_per_s();
            motion_lease::brake(self.device.as_mut(), goal, memory.sample, velocity);
        }
    }

    fn has_arrived(&self) -> bool {
        let memory = &self.memory;
        let (Some(goal), Some(sample)) = (&memory.goal, &memory.sample) else {
            return memory.goal.is_none();
        };
        let speed_m_per_s = memory.estimator.velocity_m_per_s().norm();
        is_at_goal(Some(*goal), &sample.tip_in_world, speed_m_per_s)
            && motion_lease::is_turned(goal, memory.up, &sample.world_from_tool)
    }
}
