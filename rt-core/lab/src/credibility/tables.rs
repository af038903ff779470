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

/// Hazard in the words of ISO 14971: hazard, situation, harm.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Hazard {
    pub id: String,
    pub hazard: String,
    pub situation: String,
    pub harm: String,
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
    pub what: String,
}
