//! What the file says beside its runs, from `tables.toml`.

use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// All tables; a test reads them.
pub static TABLES: LazyLock<Tables> =
    LazyLock::new(|| toml::from_str(include_str!("tables.toml")).expect("the tables are valid"));

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// Question that the model answers, for whom, and what it is not for: heading and text.
    pub context: Vec<(String, String)>,
    pub hazards: Vec<Hazard>,
    pub requirements: Vec<Requirement>,
    pub categories: Vec<Category>,
    pub factors: Vec<Factor>,
}

/// Hazard in the words of ISO 14971: hazard, situation, harm, and the risk of it before and after its controls.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Hazard {
    pub id: String,
    pub hazard: String,
    pub situation: String,
    pub harm: String,
    pub severity: Severity,
    /// Probability of the harm without the requirements that control the hazard.
    pub before: Probability,
    /// Probability with them.
    pub after: Probability,
    /// What the requirements do not control.
    pub remains: String,
}

/// Severity of a harm, by the five qualitative levels of ISO/TR 24971.
#[derive(Clone, Copy, Debug, Deserialize, Eq, Ord, PartialEq, PartialOrd, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    Negligible,
    Minor,
    Serious,
    Critical,
    Catastrophic,
}

/// Probability of a harm, by the five levels of ISO/TR 24971.
#[derive(Clone, Copy, Debug, Deserialize, Eq, Ord, PartialEq, PartialOrd, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Probability {
    Improbable,
    Remote,
    Occasional,
    Probable,
    Frequent,
}

/// Levels in the order of both scales, lowest first.
pub const SEVERITIES: [Severity; 5] = [
    Severity::Negligible,
    Severity::Minor,
    Severity::Serious,
    Severity::Critical,
    Severity::Catastrophic,
];
pub const PROBABILITIES: [Probability; 5] = [
    Probability::Improbable,
    Probability::Remote,
    Probability::Occasional,
    Probability::Probable,
    Probability::Frequent,
];

/// Returns the risk of a harm: low, medium or high.
pub fn risk(severity: Severity, probability: Probability) -> &'static str {
    match severity as u8 + probability as u8 {
        0..=2 => "low",
        3..=4 => "medium",
        _ => "high",
    }
}

/// Requirement on the software that controls hazards.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Requirement {
    /// Id; those of limits are the ids of `rt-core latency`.
    pub id: String,
    pub what: String,
    pub hazards: Vec<String>,
    /// File of the repository and test function that fails if the requirement does not hold.
    pub tests: Vec<(String, String)>,
}

/// One of the eight categories of the FDA's guidance.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Category {
    pub number: u32,
    pub name: String,
    /// Evidence, each with its place in the repository.
    pub there: Vec<(String, String)>,
    /// Empty if nothing is known to be missing.
    pub missing: String,
}

/// One credibility factor of ASME V&V 40-2018.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    pub activity: String,
    pub name: String,
    /// Empty if nothing was done.
    pub what: String,
    /// Ids of requirements, and places in the repository.
    pub evidence: Vec<String>,
    /// Empty if nothing is known to be missing.
    pub missing: String,
}
