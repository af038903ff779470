//! Watches the device and both loops: decides in which tick the force begins to ramp out, and why.
//!
//! The force is zero [`RAMP_OUT_TICKS`](stylet_sim::force::gate::RAMP_OUT_TICKS) ticks after the one that raises a
//! fault, on a linear ramp. The first fault is kept until the operator re-arms. A haptic loop that stops altogether
//! cannot watch itself: `control/supervisor.rs` detects it.

use serde::{Deserialize, Serialize};
use stylet_hw::DeviceFault;
use stylet_shm_schema::Fault;
use stylet_sim::force::ForceFault;

/// Age of the tissue's answer that turns the force off.
pub const STALE_TISSUE_NS: u64 = 100_000_000;
/// Consecutive ticks with a missed deadline that turn the force off.
pub const OVERRUN_STREAK: u32 = 20;
/// Consecutive repeated samples that turn the force off.
pub const SILENT_SAMPLES: u32 = 20;

/// A tick's view of the other thread and of its deadlines.
#[derive(Clone, Copy, Debug)]
pub struct Watched {
    /// When the tick began, `CLOCK_MONOTONIC`, ns.
    pub woke_ns: u64,
    /// Deadlines skipped just before this tick.
    pub missed: u32,
    /// When the newest tissue response was made.
    pub tissue_ns: u64,
    /// The newest tissue response did not converge, and the force depends on it.
    pub tissue_unsolved: bool,
    /// The force is on: late tissue and late ticks matter only then.
    pub engaged: bool,
}

/// Watchdog of a haptic loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Watchdog {
    fault: Fault,
    silent: u32,
    streak: u32,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self {
            fault: Fault::None,
            silent: 0,
            streak: 0,
        }
    }
}

impl Watchdog {
    /// Returns the first fault since the last re-arming.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// Keeps `fault` if it is the first; true then.
    pub fn raise(&mut self, fault: Fault) -> bool {
        let first = self.fault == Fault::None;
        if first {
            self.fault = fault;
        }
        first
    }

    /// Clears the fault and its causes; true if there was one.
    pub fn rearm(&mut self) -> bool {
        let had_fault = self.fault != Fault::None;
        if had_fault {
            *self = Self::default();
        }
        had_fault
    }

    /// Takes one sample of the device; `repeated` if it equals the last.
    pub fn sample(&mut self, repeated: bool) -> Option<Fault> {
        self.silent = if repeated { self.silent.saturating_add(1) } else { 0 };
        (self.silent >= SILENT_SAMPLES).then_some(Fault::DeviceSilent)
    }

    /// Checks both loops, once a tick.
    pub fn tick(&mut self, seen: &Watched) -> Option<Fault> {
        self.streak = if seen.missed > 0 {
            self.streak.saturating_add(1)
        } else {
            0
        };
        if !seen.engaged {
            None
        } else if seen.woke_ns.saturating_sub(seen.tissue_ns) > STALE_TISSUE_NS {
            Some(Fault::TissueStale)
        } else if seen.tissue_unsolved {
            Some(Fault::TissueUnsolved)
        } else if self.streak >= OVERRUN_STREAK {
            Some(Fault::OverrunStreak)
        } else {
            None
        }
    }
}

/// Converts a fault of the device to a fault of the run.
pub fn device_fault(fault: DeviceFault) -> Fault {
    match fault {
        DeviceFault::NotConnected => Fault::DeviceLost,
        DeviceFault::NotCalibrated => Fault::DeviceNotCalibrated,
        DeviceFault::Overheated => Fault::DeviceWarm,
        DeviceFault::SafetyStop => Fault::DeviceStopped,
        DeviceFault::NonFiniteSample => Fault::NonFiniteInput,
        DeviceFault::TimedOut | DeviceFault::NonFiniteWrench | DeviceFault::InvalidPeriod | DeviceFault::Driver => {
            Fault::DeviceError
        }
    }
}

/// Converts a fault to the gate's.
pub fn at_gate(fault: Fault) -> ForceFault {
    match fault {
        Fault::None => ForceFault::Stopped,
        Fault::DeviceSilent => ForceFault::StaleDevice,
        Fault::DeviceError
        | Fault::NonFiniteInput
        | Fault::DeviceLost
        | Fault::DeviceNotCalibrated
        | Fault::DeviceWarm
        | Fault::DeviceStopped => ForceFault::DeviceFault,
        Fault::NonFiniteForce => ForceFault::NonFiniteForce,
        Fault::TissueStale | Fault::TissueUnsolved => ForceFault::StaleTissue,
        Fault::OverrunStreak | Fault::LoopStopped => ForceFault::Overrun,
    }
}

#[cfg(test)]
mod tests;
