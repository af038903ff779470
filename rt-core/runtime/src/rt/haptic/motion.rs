//! Motions that hosts order from the force loop, each with its lease: of the hand, and of needles drawn out.

use super::HapticLoop;
use crate::rt::exchange::{Happened, Moved};
use crate::rt::motion_lease::{Lapse, MotionLease, Promise};
use nalgebra::Vector3;
use stylet_hw::Sample;

impl HapticLoop {
    /// Stops the motion of the hand.
    pub(super) fn stop_motion(&mut self) {
        let (sample, velocity) = self.motion_of_device();
        self.memory.hand.stop_motion(&mut self.device, sample, &velocity);
    }

    pub(super) fn begin_drawing(&mut self, promise: Option<Promise>) {
        self.memory.drawing = MotionLease::begin(promise, self.device.period_s);
        self.hold_drawn(false);
    }

    pub(super) fn keep_moving(&mut self, promise: &Promise) {
        self.memory.hand.keep_moving(&mut self.device, promise);
        if self.memory.drawing.renew(promise, self.device.period_s) {
            self.hold_drawn(false);
        }
    }

    /// Brakes motions whose lease has lapsed.
    pub(super) fn watch_motions(&mut self) {
        let (sample, velocity) = self.motion_of_device();
        let hand = &mut self.memory.hand;
        if let Some(what) = hand.watch_motion(&mut self.device, sample, &velocity, Moved::Needle) {
            self.happened(what);
        }
        match self.memory.drawing.tick(!self.left.is_drawing(), self.device.period_s) {
            Some(Lapse::Brake) => self.hold_drawn(true),
            Some(Lapse::GiveUp) => {
                self.left.end_drawing();
                self.happened(Happened::MotionGivenUp(Moved::DrawnNeedle));
            }
            None => {}
        }
    }

    /// Returns the sample in device coordinates, however the body has moved, and the velocity of the tip.
    fn motion_of_device(&self) -> (Option<Sample>, Vector3<f64>) {
        let in_scene = |sample: Sample| Sample {
            tip_in_world: self.memory.put_in.in_scene(sample.tip_in_world),
            ..sample
        };
        let velocity = *self.memory.chain.estimator.velocity_m_per_s();
        (self.memory.hand.sample.map(in_scene), velocity)
    }

    fn hold_drawn(&mut self, is_held: bool) {
        if let Some(needles) = self.left.any_mut() {
            needles.hold_drawn(is_held);
        }
    }
}
