//! The command line of a measurement.

use crate::compare::Against;
use crate::load::Load;
use crate::machine::{Machine, longest_spin_ns};
use crate::measure;
use crate::sample::LATE_SHARE;
use crate::spin::Spin;
use crate::whose::WhoseArgs;
use clap::Args;
use std::path::PathBuf;
use stylet_runtime::args::{OptionsError, RealTimeArgs, SecondArgs};
use stylet_runtime::process::Options;
use stylet_runtime::rt::clock::Wait;
use stylet_runtime::rt::pin::Pin;

/// A measurement.
#[derive(Args, Debug)]
pub struct LatencyArgs {
    /// How long to measure: 60s, 10m, 1h
    #[arg(long, default_value = "60s", value_parser = duration_ns, value_name = "TIME")]
    pub duration: u64,
    /// Measure N times, each into a folder of its own in DIR, and say how far the runs differ: DIR/spread.json
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "N", conflicts_with = "external")]
    pub repeat: u32,
    /// What runs beside the loops
    #[arg(long, value_enum, default_value_t = Load::None)]
    pub load: Load,
    /// Rate of the force loop, Hz
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(500..=10_000), value_name = "HZ")]
    pub rate: u32,
    /// Spin for the last N microseconds before each deadline; auto finds the smallest with which p50 and p99 are a
    /// third of cyclictest's
    #[arg(long, default_value = "0", value_name = "N")]
    pub(crate) spin_us: Spin,
    /// Wake once N microseconds before each deadline and sleep again, so that core and caches are ready; 0 for not
    /// [default: 100 up to 2,000 Hz, 0 beyond]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=500))]
    pub early_us: Option<u64>,
    /// Then measure again, alternating with something else
    #[arg(long, value_enum, num_args = 0..=1, default_missing_value = "cyclictest", value_name = "WITH")]
    pub compare: Option<Against>,
    /// Name the cause of each late tick from a trace of the kernel, and measure what tracing costs; needs root
    ///
    /// The trace runs in an instance of its own in tracefs, in a buffer of 256 KiB for each core. After a late tick it
    /// is frozen and read. Tracing makes the loop a little slower: unless --compare asks for something else, the loops
    /// are then measured again, with and without the trace by turns.
    #[arg(long)]
    pub trace: bool,
    /// With --trace, a tick is late from N microseconds on, wake-up and own work together [default: a fifth of the
    /// period]
    #[arg(long, value_name = "N", requires = "trace", value_parser = clap::value_parser!(u64).range(1..))]
    pub trace_over_us: Option<u64>,
    /// Let a thread that only sleeps keep watch beside the force loop, on its core and one priority above it: whether a
    /// late tick is the loop's own; makes each tick a few microseconds later
    #[arg(long)]
    pub witness: bool,
    /// Rounds of the comparison; each measures both sides once, 0 measures none
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(0..=100), value_name = "N")]
    pub rounds: u32,
    /// Let the force loop toggle a pin for an instrument: serial:0x3F8:rts, serial:0x3F8:dtr, /dev/ttyS0:rts or
    /// parallel:0x378; needs root
    ///
    /// One instruction writes the register, at irregular times of 20 to 83 ticks, and the loop notes when:
    /// DIR/toggles.csv. The addresses of the ports are in /proc/ioports. Record the pin with a logic analyser, and
    /// beside it what answers to it, then give the capture to --external.
    #[arg(long, value_name = "PORT")]
    pub toggle: Option<Pin>,
    /// Measure nothing: compare a capture of the pin (CSV of sigrok) with the record of --toggle in DIR
    #[arg(long, value_name = "FILE", conflicts_with_all = ["toggle", "trace", "compare"])]
    pub external: Option<PathBuf>,
    /// Input of the capture that shows when the handle moves, such as an accelerometer: delays after it are given as
    /// well, from motion to photon and from motion to force
    #[arg(long, value_name = "INPUT", requires = "external")]
    pub motion: Option<String>,
    /// One limit other than its default
    #[arg(long, value_name = "NAME=VALUE")]
    pub limit: Vec<String>,
    /// Challenge of whoever asks for the measurement: it stands in the report, and its signature covers it
    #[arg(long, value_name = "TEXT")]
    pub nonce: Option<String>,
    /// Folder for report.html, report.json, the raw data, and files for other programs; a report that is there is not
    /// overwritten
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub(crate) whose: WhoseArgs,
    #[command(flatten)]
    real_time: RealTimeArgs,
    #[command(flatten)]
    second: SecondArgs,
}

/// Settings of the loops that this PC cannot have.
#[derive(Debug, thiserror::Error)]
pub enum ArgsError {
    /// Problems with the options of every run.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A witness without a core or a priority.
    #[error("--witness needs real-time priority and a core for the force loop")]
    Witness,
    /// The loop would take more of its core than the kernel gives to real-time threads.
    #[error(
        "--spin-us {given_us}: at {rate_hz} Hz at most {longest_us}, or the kernel would stop the loop for its share of real-time work"
    )]
    Spin {
        /// Value as given.
        given_us: u64,
        /// Rate of the loop.
        rate_hz: u32,
        /// Longest spin that leaves the rest of the core to others.
        longest_us: u64,
    },
}

impl LatencyArgs {
    /// Returns the settings of the loops, with a separate instance, so that a running simulator is not disturbed in its
    /// shared memory.
    pub fn options(&self) -> Result<Options, ArgsError> {
        let instance = format!("lab-{}", std::process::id());
        let mut options = self.real_time.options(&instance)?;
        options.haptic_period_ns = measure::period_ns(self.rate);
        self.second.add_to(&mut options)?;
        options.wait = Wait::at_period(options.haptic_period_ns);
        if let Some(early_us) = self.early_us {
            options.wait.early_ns = early_us * 1_000;
        }
        if self.witness && (options.no_rt || options.haptic_core.is_none()) {
            return Err(ArgsError::Witness);
        }
        let Spin::Fixed(spin_us) = self.spin_us else {
            return Ok(options);
        };
        options.wait.spin_ns = spin_us * 1_000;
        let longest_us = self.longest_spin_us();
        if spin_us > longest_us {
            return Err(ArgsError::Spin {
                given_us: spin_us,
                rate_hz: self.rate,
                longest_us,
            });
        }
        Ok(options)
    }

    /// Returns the lateness from which the trace names the cause of a tick; `None` without a trace.
    pub fn trace_over_ns(&self) -> Option<u64> {
        let default_ns = measure::period_ns(self.rate) / LATE_SHARE;
        self.trace
            .then(|| self.trace_over_us.map_or(default_ns, |us| us * 1_000))
    }

    /// Returns the longest spin that the kernel's share for real-time threads permits.
    pub fn longest_spin_us(&self) -> u64 {
        longest_spin_ns(measure::period_ns(self.rate), Machine::this().throttle()) / 1_000
    }

    /// Returns the reference that the loops are compared with: with a trace, the loops without it.
    pub fn against(&self) -> Option<Against> {
        self.compare
            .or(self.trace.then_some(Against::Untraced))
            .filter(|_| self.rounds > 0)
    }
}

/// An invalid duration.
#[derive(Debug, thiserror::Error)]
pub enum DurationError {
    /// Not a duration.
    #[error(transparent)]
    Text(#[from] jiff::Error),
    /// A duration that no measurement has.
    #[error("between 1s and 48h")]
    Range,
}

pub(crate) fn duration_ns(text: &str) -> Result<u64, DurationError> {
    let duration: jiff::SignedDuration = text.parse()?;
    let ns = u64::try_from(duration.as_nanos()).unwrap_or(0);
    if (1_000_000_000..=172_800_000_000_000).contains(&ns) {
        Ok(ns)
    } else {
        Err(DurationError::Range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Throttle;

    #[test]
    fn a_spin_leaves_the_kernel_its_share() {
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.95))), 800_000);
        assert_eq!(longest_spin_ns(200_000, Some(Throttle::Share(0.5))), 70_000);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.1))), 0);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Off)), 800_000);
    }

    #[test]
    fn durations_are_read_with_their_unit() {
        assert_eq!(duration_ns("90s").ok(), Some(90_000_000_000));
        assert_eq!(duration_ns("1h").ok(), Some(3_600_000_000_000));
        assert!(duration_ns("5").is_err() && duration_ns("10ms").is_err() && duration_ns("-5s").is_err());
    }
}
