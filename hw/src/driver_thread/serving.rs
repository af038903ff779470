//! The servo thread of a device whose driver has none: started, armed, called at its rate, and ended.

use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use crate::driver_thread::arm::ArmError;
use crate::driver_thread::shared::Shared;

const ARMED_LIMIT: Duration = Duration::from_secs(2);
const FIRST_SAMPLE_LIMIT: Duration = Duration::from_millis(100);

/// Loop that a servo thread runs.
pub trait Serve: Send + 'static {
    /// Arms the calling thread; returns the rights that it was granted.
    fn arm(&self) -> Result<String, ArmError>;
    /// Runs ticks until the keeper or a lost connection ends it, and leaves zero force.
    fn run(&mut self, shared: &Shared);
}

/// Servo thread and the rights that it was granted. It serves only if it was armed.
pub struct Started<S> {
    pub thread: JoinHandle<S>,
    /// Result of arming; `None` if the thread never answered.
    pub granted: Option<Result<String, ArmError>>,
}

/// Starts the servo thread and waits for its first sample. Returns `None` if no thread starts.
pub fn start<S: Serve>(name: &str, mut servo: S, shared: &Arc<Shared>) -> Option<Started<S>> {
    shared.serve();
    let in_thread = Arc::clone(shared);
    let (armed, granted) = mpsc::channel();
    let serve = move || {
        let outcome = servo.arm();
        let may_serve = outcome.is_ok();
        let _ = armed.send(outcome);
        drop(armed);
        if may_serve {
            servo.run(&in_thread);
        }
        servo
    };
    let thread = thread::Builder::new().name(name.to_owned()).spawn(serve).ok()?;
    let granted = granted.recv_timeout(ARMED_LIMIT).ok();
    if matches!(granted, Some(Ok(_))) {
        wait_for_sample(shared);
    }
    Some(Started { thread, granted })
}

/// Waits for the first sample, so that the opener finds one, unless there is a fault.
pub fn wait_for_sample(shared: &Shared) {
    let begun = Instant::now();
    while shared.fault.get().is_some() && begun.elapsed() < FIRST_SAMPLE_LIMIT {
        thread::park_timeout(Duration::from_millis(1));
    }
}

/// Calls `tick` with the end of its period until `shared` no longer serves; false when it panicked.
pub fn at_rate(shared: &Shared, servo_hz: u32, mut tick: impl FnMut(Instant)) -> bool {
    let period = Duration::from_secs(1) / servo_hz.max(1);
    let mut due = Instant::now();
    let ticks = catch_unwind(AssertUnwindSafe(|| {
        while shared.serves() {
            due += period;
            tick(due);
            // Skip missed ticks instead of catching up.
            due = due.max(Instant::now());
            thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }));
    // Dropping the payload could unwind once more.
    ticks.map_err(core::mem::forget).is_ok()
}
