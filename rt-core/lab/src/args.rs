//! The command line of a measurement.

use crate::compare::Against;
use crate::load::Load;
use crate::machine::{Machine, Throttle};
use crate::measure;
use crate::whose::WhoseArgs;
use clap::Args;
use std::path::PathBuf;
use stylet_runtime::args::{OptionsError, RealTimeArgs};
use stylet_runtime::process::Options;

/// A measurement.
#[derive(Args, Debug)]
pub struct LatencyArgs {
    /// How long to measure: 60s, 10m, 1h
    #[arg(long, default_value = "60s", value_parser = duration_ns, value_name = "TIME")]
    pub duration: u64,
    /// What runs beside the loops
    #[arg(long, value_enum, default_value_t = Load::None)]
    pub load: Load,
    /// Rate of the force loop, Hz
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(500..=10_000), value_name = "HZ")]
    pub rate: u32,
    /// Spin for the last N microseconds before each deadline
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub spin_us: u64,
    /// Then measure again, alternating with something else
    #[arg(long, value_enum, num_args = 0..=1, default_missing_value = "cyclictest", value_name = "WITH")]
    pub compare: Option<Against>,
    /// Rounds of the comparison; each measures both sides once
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100), value_name = "N")]
    pub rounds: u32,
    /// Limits in a TOML file, one `name = value` a line
    #[arg(long, value_name = "FILE")]
    pub limits: Option<PathBuf>,
    /// One limit; wins over the file
    #[arg(long, value_name = "NAME=VALUE")]
    pub limit: Vec<String>,
    /// Folder for report.json, report.html and histograms.hlog
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub(crate) whose: WhoseArgs,
    #[command(flatten)]
    real_time: RealTimeArgs,
}

/// Settings of the loops that this PC cannot have.
#[derive(Debug, thiserror::Error)]
pub enum ArgsError {
    /// Those of every run.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The loop would take more of its core than the kernel gives to real-time threads.
    #[error(
        "--spin-us {given_us}: at {rate_hz} Hz at most {longest_us}, or the kernel would stop the loop for its share of real-time work"
    )]
    Spin {
        /// As given.
        given_us: u64,
        /// Rate of the loop.
        rate_hz: u32,
        /// Longest spin that leaves the rest of the core to others.
        longest_us: u64,
    },
}

impl LatencyArgs {
    /// Settings of the loops, with an instance of its own, so that a running simulator is not disturbed in its shared memory.
    pub fn options(&self) -> Result<Options, ArgsError> {
        let instance = format!("lab-{}", std::process::id());
        let mut options = self.real_time.options(&instance)?;
        options.haptic_period_ns = measure::period_ns(self.rate);
        options.spin_ns = self.spin_us * 1_000;
        let longest_us = longest_spin_ns(options.haptic_period_ns, Machine::this().throttle()) / 1_000;
        if self.spin_us > longest_us {
            return Err(ArgsError::Spin {
                given_us: self.spin_us,
                rate_hz: self.rate,
                longest_us,
            });
        }
        Ok(options)
    }
}

/// What the loop itself and all else of real-time priority on its core may need besides spinning.
const SHARE_KEPT_FREE: f64 = 0.15;

/// The longest spin that leaves the core below the kernel's share for real-time threads.
fn longest_spin_ns(period_ns: u64, throttle: Option<Throttle>) -> u64 {
    let share = match throttle {
        Some(Throttle::Share(share)) => share,
        Some(Throttle::Off) | None => 0.95,
    };
    ((share - SHARE_KEPT_FREE).max(0.0) * period_ns as f64).round() as u64
}

fn duration_ns(text: &str) -> Result<u64, String> {
    let duration: jiff::SignedDuration = text.parse().map_err(|e: jiff::Error| e.to_string())?;
    let ns = u64::try_from(duration.as_nanos()).unwrap_or(0);
    if (1_000_000_000..=172_800_000_000_000).contains(&ns) {
        Ok(ns)
    } else {
        Err("between 1s and 48h".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spin_leaves_the_kernel_its_share() {
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.95))), 800_000);
        assert_eq!(longest_spin_ns(200_000, Some(Throttle::Share(0.5))), 70_000);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Share(0.1))), 0);
        assert_eq!(longest_spin_ns(1_000_000, Some(Throttle::Off)), 800_000);
    }

    #[test]
    fn durations_are_read_with_their_unit() {
        assert_eq!(duration_ns("90s"), Ok(90_000_000_000));
        assert_eq!(duration_ns("1h"), Ok(3_600_000_000_000));
        assert!(duration_ns("5").is_err() && duration_ns("10ms").is_err() && duration_ns("-5s").is_err());
    }
}
