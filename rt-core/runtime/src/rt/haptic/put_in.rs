//! Applies and removes instructor-injected faults in the force loop.

use super::HapticLoop;
use crate::rt::exchange::{Notice, Ticket};
use crate::rt::put_in::PutIn;

impl HapticLoop {
    pub(super) fn follow_body(&mut self) {
        self.put_in.step(self.period_s);
        self.pose.body_moved_m = self.put_in.body_moved_m;
    }

    pub(super) fn lose_device(&mut self, ticket: Ticket, lost: bool, tick: u64) {
        self.put_in.device_lost = lost;
        self.notify(Notice::Done { ticket, tick });
    }

    pub(super) fn move_body(&mut self, ticket: Ticket, to_m: [f64; 3], tick: u64) {
        self.put_in.body_to_m = to_m.into();
        self.notify(Notice::Done { ticket, tick });
    }

    /// Removes all faults on a reset: no needle is in tissue then, so the body may jump back.
    pub(super) fn take_faults_out(&mut self) {
        self.put_in = PutIn::default();
    }
}
