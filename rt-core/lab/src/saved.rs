//! A saved report, as far as others read it. Reports of schema 1 are read too, and marked.

use crate::provenance::Fact;
use crate::sealed;
use crate::sign;
use crate::verdict::Outcome;
use crate::whose::Whose;
use serde::Deserialize;

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
    /// Signer, and what could not be verified.
    #[serde(skip)]
    pub notes: Vec<String>,
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

impl Saved {
    /// Returns what could not be verified, except for a missing signature.
    pub fn doubts(&self) -> impl Iterator<Item = &String> {
        self.notes
            .iter()
            .filter(|n| n.ends_with(sealed::MISSING) || *n == sealed::OLDER)
    }

    pub fn is_unsigned(&self) -> bool {
        self.notes.iter().any(|n| n == sign::UNSIGNED)
    }
}
