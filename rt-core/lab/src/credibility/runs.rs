//! Reports of `rt-core latency` as evidence: digest and outcome of each limit.

use crate::report::JSON;
use crate::saved::NotCounted;
use crate::verify;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A run that serves as evidence.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    pub file: String,
    pub sha256: String,
    pub made_at: String,
    pub commit: String,
    pub protocol: String,
    pub overall: &'static str,
    pub qualified: bool,
    /// Outcomes by the id of the requirement.
    pub outcomes: BTreeMap<String, &'static str>,
}

/// Reads `report.json` in `folder`. An altered one is refused.
pub fn read(folder: &Path) -> Result<Run, NotCounted> {
    let file = folder.join(JSON);
    let report = verify::read(&file, None)?;
    let p = &report.protocol;
    let limits = report.verdict.limits.into_iter();
    Ok(Run {
        file: file.display().to_string(),
        sha256: report.sha256,
        made_at: report.made_at,
        commit: report.commit,
        protocol: format!(
            "scene {}, {} Hz, load {}, {:.0} s",
            p.scene, p.rate_hz, p.load, p.measured_s
        ),
        overall: report.verdict.overall.words(),
        qualified: report.environment.qualified,
        outcomes: limits.map(|l| (l.id, l.outcome.words())).collect(),
    })
}
