//! Every reference in the credibility file resolves: ids, tests and paths exist.

use super::runs;
use super::tables::{TABLES, risk};
use super::{credibility, page};
use crate::provenance::sha256;
use crate::report::OLD_SCHEMA;
use crate::sealed::NO_DIGEST;
use crate::verdict::LIMITS;
use serde_json::json;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

#[test]
fn every_test_that_is_named_exists() {
    for r in &TABLES.requirements {
        assert!(!r.tests.is_empty(), "{} has no test", r.id);
        for (file, test) in &r.tests {
            let text = std::fs::read_to_string(repository(file)).unwrap_or_else(|e| panic!("{}: {file}: {e}", r.id));
            assert!(
                text.contains(&format!("fn {test}(")),
                "{}: no test {test} in {file}",
                r.id
            );
        }
    }
}

#[test]
fn every_hazard_is_held_off_and_every_limit_is_a_requirement() {
    let ids: BTreeSet<&str> = TABLES.requirements.iter().map(|r| r.id.as_str()).collect();
    assert_eq!(ids.len(), TABLES.requirements.len(), "an id stands twice");
    for h in &TABLES.hazards {
        assert!(
            TABLES.requirements.iter().any(|r| r.hazards.contains(&h.id)),
            "nothing holds off {}",
            h.id
        );
    }
    for r in &TABLES.requirements {
        assert!(!r.hazards.is_empty(), "{}", r.id);
        assert!(
            r.hazards.iter().all(|id| TABLES.hazards.iter().any(|h| h.id == *id)),
            "{}",
            r.id
        );
    }
    for limit in LIMITS {
        assert!(ids.contains(limit.id), "{} is no requirement of the file", limit.id);
    }
}

#[test]
fn places_of_evidence_exist_and_both_lists_are_whole() {
    let numbers: Vec<u32> = TABLES.categories.iter().map(|c| c.number).collect();
    assert_eq!(numbers, (1..=8).collect::<Vec<u32>>());
    assert_eq!(TABLES.factors.len(), 13);
    for (what, place) in TABLES.categories.iter().flat_map(|c| &c.there) {
        // Anything that is not a path is a command.
        assert!(
            repository(place).exists() || place.starts_with("rt-core "),
            "{what}: {place}"
        );
    }
    for factor in &TABLES.factors {
        assert_eq!(factor.what.is_empty(), factor.evidence.is_empty(), "{}", factor.name);
        assert!(!factor.what.is_empty() || !factor.missing.is_empty(), "{}", factor.name);
        for of in &factor.evidence {
            let is_requirement = TABLES.requirements.iter().any(|r| r.id == *of);
            assert!(is_requirement || repository(of).exists(), "{}: {of}", factor.name);
        }
    }
}

#[test]
fn controls_lower_every_risk_and_leave_none_high() {
    for h in &TABLES.hazards {
        assert!(h.after < h.before, "{}", h.id);
        assert_ne!(risk(h.severity, h.after), "high", "{}", h.id);
        assert!(!h.remains.is_empty(), "{}", h.id);
    }
}

#[test]
fn the_page_says_what_it_is_not() {
    let page = page::page(&credibility(Vec::new()));
    for words in [
        "claims conformity with none",
        "not a medical device",
        "IEC 62304",
        "ISO 14971",
        "IEC 60601-1",
        "there are no figures from use",
        "no run given",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // Every link has its target.
    for link in page.split("href=\"#").skip(1) {
        let id = link.split('"').next().expect("closed");
        assert!(page.contains(&format!("id=\"{id}\"")), "{id}");
    }
}

#[test]
fn outcomes_stand_next_to_requirements_and_altered_runs_are_refused() {
    let folder = std::env::temp_dir().join(format!("stylet-credibility-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("made");
    let report = json!({
        "schema": OLD_SCHEMA, "sha256": NO_DIGEST, "made_at": "", "program": "", "commit": "",
        "protocol": {"scene": "paper", "load": "none", "rate_hz": 1000.0, "spin_us": 0, "measured_s": 60.0},
        "verdict": {"overall": "FAIL", "limits": [{"id": "REQ-LAT-002", "name": "wake_p99_us", "outcome": "FAIL"}]},
        "haptic": {"times": [], "counts": {"missed_deadlines": 0}}
    });
    let text = report.to_string();
    let digest = sha256(text.as_bytes());
    let text = text.replacen(NO_DIGEST, &digest, 1);
    std::fs::write(folder.join("report.json"), &text).expect("written");
    let file = credibility(vec![runs::read(&folder).expect("unaltered")]);
    let of = |id: &str| {
        &file
            .requirements
            .iter()
            .find(|t| t.requirement.id == id)
            .expect("there")
            .outcomes
    };
    assert_eq!(*of("REQ-LAT-002"), [(1, "FAIL")]);
    assert!(of("REQ-LAT-001").is_empty());
    assert!(page::page(&file).contains("id=\"RUN-1\""));
    std::fs::write(folder.join("report.json"), text.replacen("FAIL", "PASS", 1)).expect("written");
    assert!(
        runs::read(&folder)
            .expect_err("altered")
            .to_string()
            .contains("tampered")
    );
    std::fs::remove_dir_all(folder).expect("ours");
}
