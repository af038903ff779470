//! A saved report, as far as others read it. Reports of all versions of schema 1 are read.

use crate::provenance::Fact;
use crate::report::{JSON, SCHEMA};
use crate::verdict::Outcome;
use crate::verify;
use crate::whose::Whose;
use serde::Deserialize;
use std::path::Path;

/// A report; an older one lacks the fields with a default.
#[derive(Clone, Debug, Deserialize)]
pub struct Saved {
    pub sha256: String,
    pub made_at: String,
    pub program: String,
    pub commit: String,
    #[serde(default)]
    pub whose: Whose,
    pub protocol: Protocol,
    pub verdict: Verdict,
    #[serde(default)]
    pub environment: Environment,
    pub haptic: Loop,
    #[serde(default)]
    pub facts: Vec<Fact>,
    #[serde(default)]
    pub settings: Vec<Setting>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Protocol {
    pub scene: String,
    pub load: String,
    pub rate_hz: f64,
    pub spin_us: u64,
    pub measured_s: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Verdict {
    pub overall: Outcome,
    pub limits: Vec<Limit>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Limit {
    #[serde(default)]
    pub id: String,
    pub name: String,
    pub outcome: Outcome,
}

#[derive(Clone, Debug, Default, Deserialize)]
pub struct Environment {
    pub qualified: bool,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Loop {
    pub times: Vec<Times>,
    pub counts: Counts,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Times {
    pub name: String,
    pub max_us: Option<f64>,
    pub quantiles: Vec<Quantile>,
}

/// A percentile with its interval, which old reports lack.
#[derive(Clone, Debug, Deserialize)]
pub struct Quantile {
    pub name: String,
    pub us: Option<f64>,
    pub interval_us: Option<[f64; 2]>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Counts {
    pub missed_deadlines: u64,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Setting {
    pub name: String,
    pub got: String,
}

/// A report that does not count.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {why}")]
pub struct NotCounted {
    pub path: String,
    pub why: String,
}

/// Reads the report `file`; an altered one is refused, and one with an altered page or raw data in its folder. Both may
/// be missing: reports are often collected without them.
pub fn read(file: &Path) -> Result<Saved, NotCounted> {
    let refused = |why: String| NotCounted {
        path: file.display().to_string(),
        why,
    };
    let text = std::fs::read_to_string(file).map_err(|e| refused(e.to_string()))?;
    let report: serde_json::Value = serde_json::from_str(&text).map_err(|e| refused(format!("not JSON: {e}")))?;
    if report["schema"] != SCHEMA {
        return Err(refused(format!("schema {}, expected {SCHEMA:?}", report["schema"])));
    }
    let altered = verify::problems(&text, |name| std::fs::read(file.with_file_name(name)).ok());
    if let Some(problem) = altered.into_iter().find(|p| !p.ends_with(": missing")) {
        return Err(refused(problem));
    }
    serde_json::from_value(report).map_err(|e| refused(format!("not the {JSON} of a measurement: {e}")))
}
