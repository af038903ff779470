//! Evidence in JSON: its digests, and each line that differs from what its own data give.

use crate::provenance::sha256;
use serde_json::Value;

/// Placeholder for the digest while it is computed.
pub const NO_DIGEST: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// What a problem with a file that is not there ends with.
pub const MISSING: &str = ": missing";
/// Note of a report whose figures nothing supports.
pub const OLDER: &str = "of an older version: its figures cannot be computed again";

/// Fills in the digest of a text that has [`NO_DIGEST`] in its place.
pub fn seal(text: &str) -> String {
    text.replacen(NO_DIGEST, &sha256(text.as_bytes()), 1)
}

/// Returns everything that was altered; `read` returns the contents of a file in the report's folder.
pub fn problems(json: &str, text: &str, read: impl Fn(&str) -> Option<Vec<u8>>) -> Vec<String> {
    let Ok(report) = serde_json::from_str::<Value>(text) else {
        return vec![format!("{json}: tampered with or damaged, it is not JSON")];
    };
    let digest = report["sha256"].as_str().unwrap_or_default();
    if digest.len() != NO_DIGEST.len() || digest == NO_DIGEST {
        return vec![format!("{json}: it carries no SHA-256")];
    }
    let mut problems = Vec::new();
    let found = sha256(text.replacen(digest, NO_DIGEST, 1).as_bytes());
    if found != digest {
        problems.push(format!(
            "{json}: tampered with: its SHA-256 is {found}, it says {digest}"
        ));
    }
    for file in report["files"].as_array().into_iter().flatten() {
        let (name, said) = (
            file["name"].as_str().unwrap_or_default(),
            file["sha256"].as_str().unwrap_or_default(),
        );
        if name.contains('/') {
            problems.push(format!("{json}: files: {name} lies outside of its folder"));
            continue;
        }
        let Some(bytes) = read(name) else {
            problems.push(format!("{name}: missing"));
            continue;
        };
        if sha256(&bytes) != said {
            problems.push(format!(
                "{name}: tampered with: its SHA-256 is not the one that the report names"
            ));
        }
    }
    problems
}

/// Returns each line of the report that says something else than its raw data give.
pub fn lines(json: &str, said: &str, computed: &str) -> Vec<String> {
    let mut name = String::new();
    let mut found = Vec::new();
    for (number, (says, gives)) in (1..).zip(said.lines().zip(computed.lines())) {
        if let Some(of) = gives.trim().strip_prefix("\"name\": ") {
            name = format!(" ({})", of.trim_matches([',', '"']));
        }
        if says != gives {
            let [says, gives] = [says, gives].map(|line| line.trim().trim_end_matches(','));
            found.push(format!(
                "{json}, line {number}{name}: says {says}, the raw data give {gives}"
            ));
        }
    }
    let [said, computed] = [said, computed].map(|text| text.lines().count());
    if said != computed {
        found.push(format!("{json}: {said} lines, the raw data give {computed}"));
    }
    found
}

/// Characters that are shown around the first difference of a file.
const SHOWN: usize = 60;

/// Returns the first difference of a file that is computed again.
pub fn other_text(name: &str, said: &str, computed: &str) -> Option<String> {
    let at = said.bytes().zip(computed.bytes()).position(|(a, b)| a != b);
    let at = at.or((said.len() != computed.len()).then(|| said.len().min(computed.len())))?;
    let line = 1 + said.bytes().take(at).filter(|b| *b == b'\n').count();
    let around = |text: &str| {
        let from = text.floor_char_boundary(at.saturating_sub(SHOWN / 2));
        let to = text.floor_char_boundary(at + SHOWN / 2);
        text[from..to].replace('\n', " ")
    };
    Some(format!(
        "{name}, line {line}: shows {:?}, the report gives {:?}",
        around(said),
        around(computed)
    ))
}
