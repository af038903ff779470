//! Reports of `rt-core latency` as evidence: digest and outcome of each limit.

use crate::provenance::sha256;
use crate::report::{JSON, NO_DIGEST, SCHEMA};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A run that serves as evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    pub file: String,
    pub sha256: String,
    pub made_at: String,
    pub commit: String,
    pub protocol: String,
    pub overall: String,
    pub qualified: bool,
    /// Outcomes by the id of the requirement.
    pub outcomes: BTreeMap<String, String>,
}

/// A report that is not evidence.
#[derive(Debug, thiserror::Error)]
#[error("{}: {why}", .path.display())]
pub struct RunError {
    path: PathBuf,
    why: String,
}

/// Reads `report.json` in `folder`. An altered one is refused.
pub fn read(folder: &Path) -> Result<Run, RunError> {
    let path = folder.join(JSON);
    let failed = |why: String| RunError {
        path: path.clone(),
        why,
    };
    let text = std::fs::read_to_string(&path).map_err(|e| failed(e.to_string()))?;
    let report: Value = serde_json::from_str(&text).map_err(|e| failed(format!("not JSON: {e}")))?;
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    if report["schema"] != SCHEMA {
        return Err(failed(format!("expected schema {SCHEMA}, found {}", report["schema"])));
    }
    let digest = word(&report["sha256"]);
    if sha256(text.replacen(&digest, NO_DIGEST, 1).as_bytes()) != digest {
        return Err(failed(
            "altered since it was written: its SHA-256 is another".to_owned(),
        ));
    }
    let p = &report["protocol"];
    let limits = report["verdict"]["limits"].as_array().cloned().unwrap_or_default();
    Ok(Run {
        file: path.display().to_string(),
        sha256: digest,
        made_at: word(&report["made_at"]),
        commit: word(&report["commit"]),
        protocol: format!(
            "scene {}, {} Hz, load {}, {:.0} s",
            word(&p["scene"]),
            p["rate_hz"],
            word(&p["load"]),
            p["measured_s"].as_f64().unwrap_or(0.0)
        ),
        overall: word(&report["verdict"]["overall"]),
        qualified: report["environment"]["qualified"] == true,
        outcomes: limits.iter().map(|l| (word(&l["id"]), word(&l["outcome"]))).collect(),
    })
}
