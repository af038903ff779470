//! Computes every figure of a report again from its raw data, and names each line that differs.

use super::Checked;
use crate::disk;
use crate::files;
use crate::provenance::COMMIT;
use crate::raw::Raw;
use crate::report::{FILES, HISTOGRAMS, JSON, Report, WAKES, contradictions, derive, limits_of};
use crate::sealed;

/// Most lines that are named.
const NAMED: usize = 8;

/// Checks a report whose files are all there.
pub fn check(text: &str, read: impl Fn(&str) -> Option<Vec<u8>>) -> Checked {
    let mut checked = Checked::default();
    if let Err(problem) = compare(text, read, &mut checked) {
        checked.problems.push(problem);
    }
    checked
}

fn compare(text: &str, read: impl Fn(&str) -> Option<Vec<u8>>, checked: &mut Checked) -> Result<(), String> {
    let report: Report =
        serde_json::from_str(text).map_err(|e| format!("{JSON}: not the report of a measurement: {e}"))?;
    let file = |name: &str| {
        let listed = report.files.iter().any(|f| f.name == name);
        listed
            .then(|| read(name))
            .flatten()
            .ok_or_else(|| format!("{JSON}: it does not list {name}"))
    };
    let (log, wakes) = (file(HISTOGRAMS)?, file(WAKES)?);
    let raw = Raw::read(&log, &wakes).map_err(|e| format!("{HISTOGRAMS} and {WAKES}: {e}"))?;
    if raw.log(report.protocol.measured_s).ok() != Some(log) {
        checked.problems.push(format!(
            "{HISTOGRAMS}: not as a measurement of {} s writes it",
            report.protocol.measured_s
        ));
    }
    let names: Vec<&str> = report.files.iter().map(|f| f.name.as_str()).collect();
    // Reports of older commits list fewer.
    if names != FILES.into_iter().filter(|f| names.contains(f)).collect::<Vec<_>>() {
        checked
            .problems
            .push(format!("{JSON}: files: it lists {}", names.join(", ")));
    }
    let limits = limits_of(&report).map_err(|e| format!("{JSON}: command: {e}"))?;
    let found = contradictions(&report, &raw);
    checked.problems.extend(
        found
            .into_iter()
            .map(|what| format!("{JSON}: contradicts itself: {what}")),
    );
    let mut again = report.clone();
    derive(&mut again, &raw, &limits);
    let expected = disk::json(&again).map_err(|e| e.to_string())?;
    checked
        .problems
        .extend(sealed::lines(JSON, text, &expected).into_iter().take(NAMED));
    if again.commit != COMMIT {
        checked.notes.push(format!(
            "{}: made by commit {}, and compared with their digests alone",
            FILES[2..].join(", "),
            again.commit
        ));
        return Ok(());
    }
    for (name, computed) in files::derived(&again, &raw).map_err(|e| e.to_string())? {
        let said = file(name)?;
        let differs = sealed::other_text(name, &String::from_utf8_lossy(&said), &computed);
        checked.problems.extend(differs);
    }
    Ok(())
}
