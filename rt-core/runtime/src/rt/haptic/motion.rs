//! Motions that hosts order from the force loop, each with its lease: of the hand, and of needles drawn out.

use super::HapticLoop;
use crate::rt::device_loop::is_at_goal;
use crate::rt::exchange::{Moved, Notice};
use crate::rt::motion_lease::{self, Lapse, MotionLease, Promise};
use stylet_hw::{HandGoal, Sample};

impl HapticLoop {
    /// Begins a motion. A real hand follows no goal, and needs no lease.
    pub(super) fn begin_motion(&mut self, goal: HandGoal, promise: Option<Promise>) {
        self.device.set_hand_goal(&goal);
        self.goal = Some(goal);
        let promise = promise.filter(|_| self.info.simulated);
        self.motions.hand = MotionLease::begin(promise, self.period_s);
    }

    /// Stops the motion as hard as when its lease lapses.
    pub(super) fn stop_motion(&mut self) {
        match self.goal {
            Some(_) => self.brake(),
            None => self.device.stop_hand(),
        }
        self.goal = None;
        self.motions.hand = MotionLease::Free;
    }

    pub(super) fn begin_drawing(&mut self, promise: Option<Promise>) {
        self.motions.drawing = MotionLease::begin(promise, self.period_s);
        self.hold_drawn(false);
    }

    pub(super) fn keep_moving(&mut self, promise: &Promise) {
        let speed_m_per_s = self.chain.estimator.velocity_m_per_s().norm();
        let speed_m_per_s = self.goal.map_or(0.0, |goal| goal.speed_m_per_s).max(speed_m_per_s);
        let of_hand = promise.within_5_mm(speed_m_per_s);
        if self.motions.hand.renew(&of_hand, self.period_s)
            && let Some(goal) = &self.goal
        {
            self.device.set_hand_goal(goal);
        }
        if self.motions.drawing.renew(promise, self.period_s) {
            self.hold_drawn(false);
        }
    }

    /// Brakes motions whose lease has lapsed.
    pub(super) fn watch_motions(&mut self) {
        let (has_arrived, is_drawing) = (self.has_arrived(), self.left.is_drawing());
        match self.motions.hand.tick(has_arrived, self.period_s) {
            Some(Lapse::Brake) => self.brake(),
            Some(Lapse::GiveUp) => {
                self.goal = None;
                self.say_given_up(Moved::Needle);
            }
            None => {}
        }
        match self.motions.drawing.tick(!is_drawing, self.period_s) {
            Some(Lapse::Brake) => self.hold_drawn(true),
            Some(Lapse::GiveUp) => {
                self.left.end_drawing();
                self.say_given_up(Moved::DrawnNeedle);
            }
            None => {}
        }
    }

    /// Returns the sample in device coordinates, however the body has moved.
    fn sample_of_device(&self) -> Option<Sample> {
        let in_scene = |sample: Sample| Sample {
            tip_in_world: self.put_in.in_scene(sample.tip_in_world),
            ..sample
        };
        self.sample.map(in_scene)
    }

    fn has_arrived(&self) -> bool {
        let (Some(goal), Some(sample)) = (&self.goal, self.sample_of_device()) else {
            return self.goal.is_none();
        };
        let speed_m_per_s = self.chain.estimator.velocity_m_per_s().norm();
        is_at_goal(Some(*goal), &sample.tip_in_world, speed_m_per_s)
            && motion_lease::is_turned(goal, None, &sample.world_from_tool)
    }

    fn brake(&mut self) {
        let (sample, velocity) = (self.sample_of_device(), *self.chain.estimator.velocity_m_per_s());
        if let Some(goal) = &self.goal {
            motion_lease::brake(self.device.as_mut(), goal, sample, &velocity);
        }
    }

    fn hold_drawn(&mut self, is_held: bool) {
        if let Some(needles) = self.left.any_mut() {
            needles.hold_drawn(is_held);
        }
    }

    fn say_given_up(&mut self, what: Moved) {
        let (tick, time_ns) = (self.state.tick + 1, self.state.time_ns);
        self.notify(Notice::MotionGivenUp { tick, time_ns, what });
    }
}
