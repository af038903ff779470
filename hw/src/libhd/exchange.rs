//! State that the servo thread and the connector thread of OpenHaptics share in addition to
//! [`Shared`](crate::driver_thread::shared::Shared), without waiting.

use core::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::Arc;

use crate::driver_thread::shared::Shared;
use crate::libhd::ffi::{Handle, INVALID_HANDLE};

/// Device that a callback serves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Served {
    pub handle: Handle,
    /// True if the device has motors in its gimbal.
    pub torques: bool,
}

/// State shared by both threads. Each field has one writer, named in its comment, unless the comment says otherwise.
#[derive(Debug)]
pub struct Exchange {
    pub shared: Arc<Shared>,
    /// Connector: device that callbacks serve, published by [`Shared::serve`].
    handle: AtomicU32,
    /// Connector: like `handle`.
    torques: AtomicBool,
    /// Order to the first callback to arm its thread; set by the connector before a scheduler
    /// starts, cleared by that callback.
    arm: AtomicBool,
    /// Servo: callbacks that wrote zero because they must not serve.
    released: AtomicU64,
}

impl Exchange {
    pub fn new(shared: Arc<Shared>) -> Self {
        Self {
            shared,
            handle: AtomicU32::new(INVALID_HANDLE),
            torques: AtomicBool::new(false),
            arm: AtomicBool::new(false),
            released: AtomicU64::new(0),
        }
    }

    /// Lets the next callback arm its thread and serve `served`. Called by the connector.
    pub fn serve(&self, served: Served) {
        // SYNC: relaxed; the release store of `Shared::serve` publishes these three.
        self.torques.store(served.torques, Ordering::Relaxed);
        self.handle.store(served.handle, Ordering::Relaxed);
        self.arm.store(true, Ordering::Relaxed);
        self.shared.serve();
    }

    /// Returns the number of callbacks that wrote zero force because they must not serve. Called by the connector.
    pub fn released(&self) -> u64 {
        // SYNC: acquire pairs with the release in `count_released`: the driver has the zero of every counted callback.
        self.released.load(Ordering::Acquire)
    }

    /// Returns the device to serve, or `None` when this callback must write zero. Called by the servo thread, as all
    /// that follow.
    pub fn served(&self) -> Option<Served> {
        // SYNC: the acquire load of `Shared::serves` comes before every other load of this function and before
        // `take_arm`.
        self.shared.serves().then(|| self.last_served())
    }

    /// Returns the device that was served last, released or not.
    pub fn last_served(&self) -> Served {
        // SYNC: relaxed; `served` has acquired them, and a callback that only writes zero may see the device before.
        Served {
            handle: self.handle.load(Ordering::Relaxed),
            torques: self.torques.load(Ordering::Relaxed),
        }
    }

    /// Returns true once after each `serve`.
    pub fn take_arm(&self) -> bool {
        // SYNC: relaxed; a callback that may serve (acquire in `served`) sees this flag set.
        self.arm.swap(false, Ordering::Relaxed)
    }

    /// Counts a callback whose zero force the driver has.
    pub fn count_released(&self) {
        // SYNC: release pairs with the acquire in `released`.
        self.released.fetch_add(1, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_callback_serves_only_between_serve_and_release_or_loss() {
        let shared = Exchange::new(Arc::default());
        let served = Served {
            handle: 7,
            torques: true,
        };
        assert_eq!((shared.served(), shared.take_arm()), (None, false));
        shared.serve(served);
        assert_eq!(shared.served(), Some(served));
        assert_eq!((shared.take_arm(), shared.take_arm()), (true, false), "armed once");
        shared.shared.errors.note(0x0302);
        shared.shared.errors.set_lost();
        assert_eq!((shared.served(), shared.shared.errors.lost()), (None, Some(0x0302)));
        shared.serve(served);
        assert_eq!((shared.served(), shared.shared.errors.lost()), (Some(served), None));
        shared.shared.request_release();
        assert_eq!((shared.served(), shared.last_served()), (None, served));
    }
}
