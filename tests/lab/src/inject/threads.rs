//! Injections by threads, signals and timers.

use super::{Target, ended, on_core, schedule, spin, until};
use std::time::{Duration, Instant};

const EVERY: Duration = Duration::from_millis(60);

pub fn higher_priority(target: Target, end: Instant) -> Result<(), String> {
    rival("inj-higher", target, 90, end)
}

pub fn same_priority(target: Target, end: Instant) -> Result<(), String> {
    rival("inj-same", target, 80, end)
}

/// Runs longer than a period, so that a tick is due in between.
fn rival(name: &'static str, target: Target, priority: i32, end: Instant) -> Result<(), String> {
    ended(on_core(name, target.core, priority, move || {
        until(end, EVERY, || spin(Duration::from_micros(1_400)));
    }))
}

pub fn stopped(target: Target, end: Instant) -> Result<(), String> {
    until(end, EVERY, || {
        // SAFETY: the process is a child of the test that has not been waited for.
        unsafe { libc::kill(target.process, libc::SIGSTOP) };
        std::thread::sleep(Duration::from_millis(3));
        // SAFETY: as above.
        unsafe { libc::kill(target.process, libc::SIGCONT) };
    });
    Ok(())
}

/// Turns the loop normal for 20 ms at a time, next to two threads that never sleep.
pub fn demoted(target: Target, end: Instant) -> Result<(), String> {
    let hogs = [(); 2].map(|()| {
        on_core("inj-hog", target.core, 0, move || {
            while Instant::now() < end {
                spin(Duration::from_millis(1));
            }
        })
    });
    let mut done = Ok(());
    until(end - Duration::from_millis(100), Duration::from_millis(100), || {
        done = schedule(target.thread, libc::SCHED_OTHER, 0);
        std::thread::sleep(Duration::from_millis(20));
        done = done.clone().and(schedule(target.thread, libc::SCHED_FIFO, 80));
    });
    for hog in hogs {
        ended(hog)?;
    }
    done
}

/// Timers that expire on the core of the loop, all at one time.
pub fn timers(target: Target, end: Instant) -> Result<(), String> {
    const TIMERS: usize = 6_000;
    ended(on_core("inj-timers", target.core, 0, move || {
        let mut all: Vec<libc::timer_t> = Vec::new();
        for _ in 0..TIMERS {
            // SAFETY: an all-zero event is valid.
            let mut event: libc::sigevent = unsafe { std::mem::zeroed() };
            let mut timer: libc::timer_t = std::ptr::null_mut();
            // A timer without notification expires in no interrupt, so each sends an ignored signal.
            event.sigev_notify = libc::SIGEV_SIGNAL;
            event.sigev_signo = libc::SIGURG;
            // SAFETY: both are valid for the call.
            if unsafe { libc::timer_create(libc::CLOCK_MONOTONIC, &mut event, &mut timer) } != 0 {
                break;
            }
            all.push(timer);
        }
        let made = all.len();
        until(end, EVERY, || {
            let at = now_ns() + 8_000_000;
            let time = libc::itimerspec {
                it_interval: libc::timespec { tv_sec: 0, tv_nsec: 0 },
                it_value: libc::timespec {
                    tv_sec: (at / 1_000_000_000) as libc::time_t,
                    tv_nsec: (at % 1_000_000_000) as libc::c_long,
                },
            };
            for &timer in &all {
                // SAFETY: the timer exists; `time` is valid for reads.
                unsafe { libc::timer_settime(timer, libc::TIMER_ABSTIME, &time, std::ptr::null_mut()) };
            }
            while now_ns() < at + 2_000_000 {
                std::hint::spin_loop();
            }
        });
        for timer in all {
            // SAFETY: the timer exists.
            unsafe { libc::timer_delete(timer) };
        }
        made
    }))
    .and_then(|made| {
        if made > 500 {
            Ok(())
        } else {
            Err(format!("only {made} timers"))
        }
    })
}

fn now_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writes.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Threads on every core that write through 96 MiB each.
pub fn memory(_: Target, end: Instant) -> Result<(), String> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads: Vec<_> = (0..2 * cores)
        .map(|i| {
            on_core("inj-memory", i % cores, 0, move || {
                let mut bytes = vec![0_u8; 96 << 20];
                let mut value = 0_u8;
                while Instant::now() < end {
                    value = value.wrapping_add(1);
                    bytes.fill(std::hint::black_box(value));
                }
                std::hint::black_box(bytes.last().copied())
            })
        })
        .collect();
    for thread in threads {
        ended(thread)?;
    }
    Ok(())
}
