//! `CLOCK_MONOTONIC`, and a sleep until an absolute time on it.

#[cfg(not(target_family = "wasm"))]
pub use stylet_shm_schema::affinity::now_ns;

/// Stands still: a browser steps the loops at times that it chooses, and has no such clock.
#[cfg(target_family = "wasm")]
pub fn now_ns() -> u64 {
    0
}

/// Period of the force loop: 1 kHz.
pub const HAPTIC_PERIOD_NS: u64 = 1_000_000;
/// Period of the tissue loop: 200 Hz.
pub const TISSUE_PERIOD_NS: u64 = 5_000_000;

/// Phase of the force loop within its period: clear of the kernel's own tick, which comes at whole periods and would
/// run first.
pub const HAPTIC_PHASE: f64 = 0.25;
/// Phase of the tissue loop: the force is out by then, the pose available, and the two loops do not wake together.
pub const TISSUE_PHASE: f64 = 0.5;
/// Phase of the second device's loop: clear of both at the same rate.
pub const SECOND_PHASE: f64 = 0.75;

/// Converts a phase to nanoseconds.
pub fn phase_ns(phase: f64, period_ns: u64) -> u64 {
    (phase * period_ns as f64) as u64
}

/// Returns at `time_ns` or later; continues to sleep after a signal.
#[cfg(not(target_family = "wasm"))]
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

/// Method of waiting for a deadline.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wait {
    /// Time before the deadline of one early wake-up: it wakes the core and warms the kernel's return path. 0 for none.
    pub early_ns: u64,
    /// Time before the deadline spent spinning; 0 for none.
    pub spin_ns: u64,
}

/// Lead of the early wake-up.
pub const EARLY_NS: u64 = 100_000;

impl Wait {
    /// Returns the wait for a period: no spin, and the early wake-up if it takes at most a fifth of the period.
    pub fn at_period(period_ns: u64) -> Self {
        Self {
            early_ns: if period_ns >= 5 * EARLY_NS { EARLY_NS } else { 0 },
            spin_ns: 0,
        }
    }

    /// Waits until `time_ns`; returns the number of justified sleeps.
    #[cfg(not(target_family = "wasm"))]
    pub fn until(self, time_ns: u64) -> u64 {
        let awake_ns = time_ns.saturating_sub(self.spin_ns);
        let mut sleeps = 0;
        for end_ns in [awake_ns.saturating_sub(self.early_ns), awake_ns] {
            if now_ns() < end_ns {
                sleep_until(end_ns);
                sleeps += 1;
            }
        }
        while self.spin_ns > 0 && now_ns() < time_ns {
            std::hint::spin_loop();
        }
        sleeps
    }
}

/// The ideal grid of a periodic loop: late wake-ups skip grid points and count them; none is made up for.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Time between two points, ns.
    pub period_ns: u64,
    /// The next point, `CLOCK_MONOTONIC`, ns.
    pub due_ns: u64,
}

impl Grid {
    /// Returns a grid at `phase_ns` after whole periods of the clock, which keeps the loops apart by design; the first
    /// point is more than half a period after `start_ns`.
    pub fn at_phase(start_ns: u64, period_ns: u64, phase_ns: u64) -> Self {
        let period_ns = period_ns.max(1);
        let phase_ns = phase_ns % period_ns;
        let earliest = start_ns + period_ns / 2 + 1;
        let whole = earliest.saturating_sub(phase_ns).div_ceil(period_ns);
        Self {
            period_ns,
            due_ns: whole * period_ns + phase_ns,
        }
    }

    /// Moves to the first point after `now_ns`; returns how many were missed.
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
        let mut grid = Grid::at_phase(1_010, 100, 0);
        assert_eq!(grid.due_ns, 1_100);
        assert_eq!((grid.advance(1_150), grid.due_ns), (0, 1_200));
        assert_eq!((grid.advance(1_300), grid.due_ns), (1, 1_400));
        assert_eq!((grid.advance(1_799), grid.due_ns), (3, 1_800));
    }

    #[test]
    fn points_have_their_phase_and_the_first_is_not_too_soon() {
        for (start, phase, first) in [
            (1_000, 25, 1_125),
            (1_000, 75, 1_075),
            (1_060, 25, 1_125),
            (1_080, 25, 1_225),
            (3, 0, 100),
        ] {
            assert_eq!(Grid::at_phase(start, 100, phase).due_ns, first, "{start}, {phase}");
        }
        assert_eq!(Grid::at_phase(1_000, 100, 125).due_ns, 1_125);
    }

    #[test]
    fn waiting_never_ends_early_with_or_without_a_spin() {
        for (early_ns, spin_ns, most) in [
            (0, 0, 1),
            (0, 1_500_000, 1),
            (0, 5_000_000, 0),
            (500_000, 0, 2),
            (5_000_000, 500_000, 1),
        ] {
            let due = now_ns() + 2_000_000;
            // A machine that was suspended meanwhile leaves less to sleep for.
            assert!(Wait { early_ns, spin_ns }.until(due) <= most);
            assert!(now_ns() >= due);
        }
        assert_eq!(Wait::at_period(1_000_000).early_ns, EARLY_NS);
        assert_eq!(Wait::at_period(100_000).early_ns, 0);
    }

    #[test]
    fn sleep_never_returns_early() {
        let due = now_ns() + 2_000_000;
        sleep_until(due);
        assert!(now_ns() >= due);
    }
}
