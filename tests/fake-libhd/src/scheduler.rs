//! The servo thread of the fake: one tick per period on an absolute grid, unless the test makes it late or silent.

use std::cell::Cell;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nalgebra::Vector3;

use crate::control::put;
use crate::driver::{control, driver};

static RUNNING: AtomicBool = AtomicBool::new(false);
thread_local! {
    static SERVO: Cell<bool> = const { Cell::new(false) };
}
static THREAD: Mutex<Option<JoinHandle<()>>> = Mutex::new(None);

pub fn is_running() -> bool {
    // SYNC: acquire pairs with the release of `start` and `stop`.
    RUNNING.load(Ordering::Acquire)
}

pub fn is_this_thread() -> bool {
    SERVO.get()
}

pub fn start() {
    // SYNC: release pairs with the acquire in `is_running`, acquire with the release in `stop`.
    if RUNNING.swap(true, Ordering::AcqRel) {
        return;
    }
    let servo = std::thread::Builder::new().name("fake-servo".to_owned()).spawn(run);
    *THREAD.lock().unwrap_or_else(PoisonError::into_inner) = servo.ok();
}

pub fn stop() {
    // SYNC: release pairs with the acquire in `is_running`, by which the servo thread ends; the join orders the rest.
    RUNNING.store(false, Ordering::Release);
    let thread = THREAD.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(thread) = thread {
        let _ = thread.join();
        let force_n = driver().force_n;
        put(&control().force_at_stop_n, Vector3::from(force_n).norm());
    }
}

fn run() {
    SERVO.set(true);
    let mut due = Instant::now();
    while is_running() {
        due += Duration::from_secs(1) / driver().rate_hz.max(1) as u32;
        // SYNC: relaxed; see `Control`.
        let late = Duration::from_micros(control().late_us.load(Relaxed).into());
        std::thread::sleep((due + late).saturating_duration_since(Instant::now()));
        // Like a driver that waits for an interrupt: missed ticks are not repeated.
        due = due.max(Instant::now() - Duration::from_millis(2));
        if control().stalled.load(Relaxed) == 0 {
            tick();
        }
    }
}

fn tick() {
    let scheduled: Vec<_> = {
        let mut driver = driver();
        driver.advance();
        driver.callbacks.iter().map(|c| (c.id, c.function, c.context)).collect()
    };
    for (id, function, context) in scheduled {
        // SAFETY: the caller of `hdSchedule...` promises that both stay valid.
        let again = unsafe { function(context as *mut core::ffi::c_void) };
        if again == 0 {
            driver().callbacks.retain(|c| c.id != id);
        }
    }
}
