//! The file of a campaign, and its parts.

use crate::args::{duration_ns, longest_spin_ns};
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::period_ns;
use serde::{Deserialize, Deserializer, Serialize};

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

/// Every problem with a file of a campaign, one per line.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct PlanError(pub Vec<String>);

impl Plan {
    /// Returns the plan, or the problems with the file.
    pub fn of(text: &str) -> Result<Self, PlanError> {
        let once: Self = toml::from_str(text).map_err(|e| PlanError(vec![e.to_string()]))?;
        let mut problems = Vec::new();
        if once.parts.is_empty() || !(1..=1_000).contains(&once.repeat) {
            problems.push("expected at least one [[part]], and repeat between 1 and 1000".to_owned());
        }
        for (i, part) in (1..).zip(&once.parts) {
            let (rate, spin_us) = (part.rate, part.spin_us);
            if !(500..=10_000).contains(&rate) {
                problems.push(format!("part {i}: rate = {rate}: expected 500 to 10000 Hz"));
                continue;
            }
            let longest_us = longest_spin_ns(period_ns(rate), Machine::this().throttle()) / 1_000;
            if spin_us > longest_us {
                problems.push(format!("part {i}: spin_us = {spin_us}: at most {longest_us}"));
            }
        }
        if !problems.is_empty() {
            return Err(PlanError(problems));
        }
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
