//! Hosts that order motions, and their keep-alive promises: at most one renewal per motion in a pass.

use super::Control;
use crate::rt::exchange::{HapticOrder, Moved, Ticket};
use crate::rt::motion_lease::Promise;

/// State for each kind of [`Moved`].
#[derive(Default)]
pub(super) struct Movers {
    /// Host that moves each.
    hosts: [Option<u64>; 3],
    /// Promises received in this pass.
    promises: [Option<Promise>; 3],
}

impl Movers {
    /// Takes a promise; ignores one from a host that moves nothing.
    pub fn keep(&mut self, host_id: u64, valid_s: f64) {
        for (promise, mover) in self.promises.iter_mut().zip(self.hosts) {
            if mover == Some(host_id) {
                *promise = Some(Promise { host_id, valid_s });
            }
        }
    }
}

impl Control {
    /// Returns the promise with which a request begins a motion.
    pub(super) fn first_promise(&mut self, ticket: Ticket, what: Moved) -> Option<Promise> {
        let (host_id, _) = self.link.answers.asker(ticket)?;
        self.movers.hosts[what as usize] = Some(host_id);
        Some(Promise::first(host_id))
    }

    /// Passes this pass's promises on to the loops.
    pub(super) fn renew_motions(&mut self) {
        let [needle, second, drawn] = std::mem::take(&mut self.movers.promises);
        // One order renews both motions of the needle's loop.
        for promise in [needle, drawn.filter(|_| drawn != needle)].into_iter().flatten() {
            let _ = self.loops.haptic_orders.push((0, HapticOrder::KeepMoving(promise)));
        }
        if let Some(promise) = second {
            self.order_second(0, HapticOrder::KeepMoving(promise));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_that_moves_nothing_renews_nothing() {
        let mut movers = Movers {
            hosts: [Some(1), Some(2), None],
            ..Movers::default()
        };
        for (host_id, valid_s) in [(3, 0.3), (2, 0.1), (2, 0.2)] {
            movers.keep(host_id, valid_s);
        }
        let promise = Promise {
            host_id: 2,
            valid_s: 0.2,
        };
        assert_eq!(movers.promises, [None, Some(promise), None]);
    }
}
