//! The file of a campaign, and its parts.

use crate::args::{duration_ns, longest_spin_ns};
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::period_ns;
use serde::{Deserialize, Serialize};

/// Shortest useful window.
const SHORTEST_WINDOW_NS: u64 = 1_000_000_000;

/// One part: a load at a rate for a time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    pub load: Load,
    pub rate: u32,
    pub duration_ns: u64,
    pub spin_us: u64,
}

/// All parts in order, with repetitions expanded.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub name: String,
    pub window_ns: u64,
    pub checkpoint_ns: u64,
    pub parts: Vec<Part>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlan {
    #[serde(default)]
    name: String,
    #[serde(default = "once")]
    repeat: u32,
    #[serde(default = "five_minutes")]
    window: String,
    #[serde(default = "a_minute")]
    checkpoint: String,
    part: Vec<RawPart>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPart {
    #[serde(default = "no_load")]
    load: Load,
    #[serde(default = "kilohertz")]
    rate: u32,
    duration: String,
    #[serde(default)]
    spin_us: u64,
}

fn once() -> u32 {
    1
}

fn five_minutes() -> String {
    "5m".to_owned()
}

fn a_minute() -> String {
    "1m".to_owned()
}

fn no_load() -> Load {
    Load::None
}

fn kilohertz() -> u32 {
    1_000
}

/// Every problem with a file of a campaign, one per line.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.join("\n"))]
pub struct PlanError(pub Vec<String>);

impl Plan {
    /// Returns the plan, or every problem with the file.
    pub fn of(text: &str) -> Result<Self, PlanError> {
        let raw: RawPlan = toml::from_str(text).map_err(|e| PlanError(vec![e.to_string()]))?;
        let mut problems = Vec::new();
        let mut time = |key: &str, text: &str| {
            duration_ns(text)
                .map_err(|why| problems.push(format!("{key} = {text:?}: {why}")))
                .unwrap_or(SHORTEST_WINDOW_NS)
        };
        let window_ns = time("window", &raw.window).max(SHORTEST_WINDOW_NS);
        let checkpoint_ns = time("checkpoint", &raw.checkpoint);
        let once: Vec<Part> = raw
            .part
            .iter()
            .enumerate()
            .map(|(i, p)| Part {
                load: p.load,
                rate: p.rate,
                duration_ns: time(&format!("part {}: duration", i + 1), &p.duration),
                spin_us: p.spin_us,
            })
            .collect();
        if once.is_empty() || !(1..=1_000).contains(&raw.repeat) {
            problems.push("expected at least one [[part]], and repeat between 1 and 1000".to_owned());
        }
        for (i, part) in once.iter().enumerate() {
            if !(500..=10_000).contains(&part.rate) {
                problems.push(format!(
                    "part {}: rate = {}: expected 500 to 10000 Hz",
                    i + 1,
                    part.rate
                ));
                continue;
            }
            let longest_us = longest_spin_ns(period_ns(part.rate), Machine::this().throttle()) / 1_000;
            if part.spin_us > longest_us {
                problems.push(format!(
                    "part {}: spin_us = {}: at most {longest_us}",
                    i + 1,
                    part.spin_us
                ));
            }
        }
        if !problems.is_empty() {
            return Err(PlanError(problems));
        }
        Ok(Self {
            name: raw.name,
            window_ns,
            checkpoint_ns,
            parts: (0..raw.repeat).flat_map(|_| once.iter().cloned()).collect(),
        })
    }
}
