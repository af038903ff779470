//! The file of a campaign, and its parts.

use crate::args::duration_ns;
use crate::load::Load;
use crate::machine::{Machine, longest_spin_ns};
use crate::measure::period_ns;
use crate::verdict::{self, LimitsError};
use serde::{Deserialize, Deserializer, Serialize};
use stylet_shm_schema::ProblemList;

/// One part: a load at a rate for a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    #[serde(default)]
    pub load: Load,
    #[serde(default = "kilohertz")]
    pub rate: u32,
    #[serde(rename(deserialize = "duration"), deserialize_with = "time")]
    pub duration_ns: u64,
    #[serde(default)]
    pub spin_us: u64,
}

/// All parts in order, with repetitions expanded.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    #[serde(default)]
    pub name: String,
    #[serde(default = "once")]
    repeat: usize,
    #[serde(rename = "window", default = "five_minutes", deserialize_with = "time")]
    pub window_ns: u64,
    #[serde(rename = "checkpoint", default = "a_minute", deserialize_with = "time")]
    pub checkpoint_ns: u64,
    /// Limits other than their defaults, as `NAME=VALUE`.
    #[serde(default)]
    pub limits: Vec<String>,
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
}

fn once() -> usize {
    1
}

fn five_minutes() -> u64 {
    300_000_000_000
}

fn a_minute() -> u64 {
    60_000_000_000
}

fn kilohertz() -> u32 {
    1_000
}

fn time<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
    duration_ns(&String::deserialize(from)?).map_err(serde::de::Error::custom)
}

/// Problem with a file of a campaign.
#[derive(Debug, thiserror::Error)]
pub enum PlanProblem {
    /// Not the TOML of a campaign.
    #[error(transparent)]
    Toml(#[from] toml::de::Error),
    /// No part, or too many repetitions of all.
    #[error("expected at least one [[part]], and repeat between 1 and 1000")]
    Parts,
    /// Limits that do not exist.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// A rate that the loop cannot have.
    #[error("part {part}: rate = {hz}: expected 500 to 10000 Hz")]
    Rate {
        /// Number of the part.
        part: usize,
        /// Its rate.
        hz: u32,
    },
    /// A spin that the kernel would interrupt.
    #[error("part {part}: spin_us = {spin_us}: at most {most_us}")]
    Spin {
        /// Number of the part.
        part: usize,
        /// Its spin.
        spin_us: u64,
        /// Longest spin at that rate.
        most_us: u64,
    },
}

impl Plan {
    /// Returns the plan, or the problems with the file.
    pub fn of(text: &str) -> Result<Self, ProblemList<PlanProblem>> {
        let once: Self = toml::from_str(text).map_err(PlanProblem::from)?;
        let mut problems = Vec::new();
        if once.parts.is_empty() || !(1..=1_000).contains(&once.repeat) {
            problems.push(PlanProblem::Parts);
        }
        for (part, &Part { rate: hz, spin_us, .. }) in (1..).zip(&once.parts) {
            if !(500..=10_000).contains(&hz) {
                problems.push(PlanProblem::Rate { part, hz });
                continue;
            }
            let most_us = longest_spin_ns(period_ns(hz), Machine::this().throttle()) / 1_000;
            if spin_us > most_us {
                problems.push(PlanProblem::Spin { part, spin_us, most_us });
            }
        }
        problems.extend(
            verdict::limits(period_ns(kilohertz()), &once.limits)
                .err()
                .map(PlanProblem::from),
        );
        ProblemList::check(problems)?;
        Ok(Self {
            parts: once.parts.repeat(once.repeat),
            ..once
        })
    }

    /// Returns the time of all parts.
    pub fn planned_s(&self) -> f64 {
        self.parts.iter().map(|p| p.duration_ns as f64 / 1e9).sum()
    }
}

impl Part {
    pub fn name(&self) -> String {
        let spin = if self.spin_us > 0 {
            format!(", spin {} \u{b5}s", self.spin_us)
        } else {
            String::new()
        };
        format!("{}, {} Hz{spin}", self.load.name(), self.rate)
    }
}
