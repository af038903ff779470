//! `CLOCK_MONOTONIC`, and a sleep until an absolute time on it.

/// Period of the force loop: 1 kHz.
pub const HAPTIC_PERIOD_NS: u64 = 1_000_000;
/// Period of the tissue loop: 200 Hz.
pub const TISSUE_PERIOD_NS: u64 = 5_000_000;

/// Nanoseconds of `CLOCK_MONOTONIC`.
pub fn now_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writes; the clock always exists on Linux.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Returns at `time_ns` or later; continues to sleep after a signal.
pub fn sleep_until(time_ns: u64) {
    let time = libc::timespec {
        tv_sec: (time_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (time_ns % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `time` is valid for reads; with TIMER_ABSTIME the remainder is not written.
    while unsafe { libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &time, std::ptr::null_mut()) }
        == libc::EINTR
    {}
}

/// Sleeps until `spin_ns` before `time_ns`, then spins; true when the thread had reason to sleep.
pub fn wait_until(time_ns: u64, spin_ns: u64) -> bool {
    let sleep_ns = time_ns.saturating_sub(spin_ns);
    let ahead = now_ns() < sleep_ns;
    sleep_until(sleep_ns);
    while spin_ns > 0 && now_ns() < time_ns {
        std::hint::spin_loop();
    }
    ahead
}

/// The ideal grid of a periodic loop: late wake-ups skip grid points and count them, none is made up for.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Time between two points, ns.
    pub period_ns: u64,
    /// The point that comes next, `CLOCK_MONOTONIC`, ns.
    pub due_ns: u64,
}

impl Grid {
    /// The first point is one period, at least 1 ns, after `start_ns`.
    pub fn from(start_ns: u64, period_ns: u64) -> Self {
        let period_ns = period_ns.max(1);
        Self {
            period_ns,
            due_ns: start_ns + period_ns,
        }
    }

    /// Moves to the first point that lies after `now_ns`; returns how many were missed on the way.
    pub fn advance(&mut self, now_ns: u64) -> u32 {
        self.due_ns += self.period_ns;
        if self.due_ns > now_ns {
            return 0;
        }
        let missed = (now_ns - self.due_ns) / self.period_ns + 1;
        self.due_ns += missed * self.period_ns;
        u32::try_from(missed).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_skipped_and_counted_and_the_phase_is_kept() {
        let mut grid = Grid::from(1_000, 100);
        assert_eq!(grid.due_ns, 1_100);
        assert_eq!((grid.advance(1_150), grid.due_ns), (0, 1_200));
        assert_eq!((grid.advance(1_300), grid.due_ns), (1, 1_400));
        assert_eq!((grid.advance(1_799), grid.due_ns), (3, 1_800));
    }

    #[test]
    fn waiting_never_ends_early_with_or_without_a_spin() {
        for spin_ns in [0, 1_500_000, 5_000_000] {
            let due = now_ns() + 2_000_000;
            assert_eq!(wait_until(due, spin_ns), spin_ns < 2_000_000);
            assert!(now_ns() >= due);
        }
    }

    #[test]
    fn sleep_never_returns_early() {
        let due = now_ns() + 2_000_000;
        sleep_until(due);
        assert!(now_ns() >= due);
    }
}
