//! The part of a report used by the fleet; reports of all versions of schema 1 are read.

use crate::report::SCHEMA;
use crate::verdict::Outcome;
use crate::verify;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// A percentile in microseconds with its interval, which old reports lack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Percentile {
    pub us: f64,
    pub interval_us: Option<[f64; 2]>,
}

/// One report.
#[derive(Clone, Debug)]
pub struct Entry {
    pub path: String,
    pub digest: String,
    /// Name of the PC; in reports that lack it, the name of the folder above the report's.
    pub pc: String,
    pub made_at: String,
    pub outcome: Outcome,
    pub operator: String,
    pub site: String,
    /// Scene, load, rate and spin: only reports of the same protocol are compared.
    pub protocol: String,
    pub measured_s: f64,
    pub p50: Option<Percentile>,
    pub p99: Option<Percentile>,
    pub p999: Option<Percentile>,
    pub max_us: Option<f64>,
    pub missed: u64,
    pub failed: Vec<String>,
    /// Facts of the report about machine, settings and program.
    pub machine: BTreeMap<String, String>,
}

/// A file that does not count.
#[derive(Debug)]
pub struct Unread {
    pub path: String,
    pub why: String,
}

/// Values that differ from run to run without meaning, or that identify the PC.
const OWN: [&str; 3] = ["memory lock", "PC: name", "PC: serial number"];

pub fn read(file: &Path) -> Result<Entry, Unread> {
    let path = file.display().to_string();
    let unread = |why: String| Unread {
        path: path.clone(),
        why,
    };
    let text = std::fs::read_to_string(file).map_err(|e| unread(e.to_string()))?;
    let report: Value = serde_json::from_str(&text).map_err(|e| unread(format!("not JSON: {e}")))?;
    let schema = report["schema"].as_str().unwrap_or_default();
    if schema != SCHEMA {
        return Err(unread(format!("schema {schema:?}, expected {SCHEMA:?}")));
    }
    let folder = file.parent().unwrap_or(Path::new("."));
    // Only the report itself: a fleet is often collected without pages and raw data.
    let altered = verify::problems(&text, |name| std::fs::read(folder.join(name)).ok());
    if let Some(problem) = altered.into_iter().find(|p| !p.ends_with(": missing")) {
        return Err(unread(problem));
    }
    of(&report, &path, folder).ok_or_else(|| unread("a field of the schema is missing".to_owned()))
}

fn of(report: &Value, path: &str, folder: &Path) -> Option<Entry> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let machine = machine(report);
    let above = folder.parent().and_then(Path::file_name).unwrap_or_default();
    let named = fact(report, "PC", "name").filter(|name| name != "not reported");
    let protocol = &report["protocol"];
    let wake = report["haptic"]["times"]
        .as_array()?
        .iter()
        .find(|t| t["name"] == "wake-up")?;
    let percentile = |name: &str| {
        let quantile = wake["quantiles"].as_array()?.iter().find(|q| q["name"] == name)?;
        let ends: Option<Vec<f64>> = quantile["interval_us"]
            .as_array()
            .map(|a| a.iter().filter_map(Value::as_f64).collect());
        Some(Percentile {
            us: quantile["us"].as_f64()?,
            interval_us: ends.and_then(|e| e.try_into().ok()),
        })
    };
    let limits = report["verdict"]["limits"].as_array()?.iter();
    Some(Entry {
        path: path.to_owned(),
        digest: text(&report["sha256"]),
        pc: named.unwrap_or_else(|| above.to_string_lossy().into_owned()),
        made_at: text(&report["made_at"]),
        outcome: outcome(report["verdict"]["overall"].as_str()?)?,
        operator: text(&report["whose"]["operator"]),
        site: text(&report["whose"]["site"]),
        protocol: format!(
            "{}, load {}, {} Hz, spin {} us",
            text(&protocol["scene"]),
            text(&protocol["load"]),
            protocol["rate_hz"].as_f64()?,
            protocol["spin_us"].as_u64()?
        ),
        measured_s: protocol["measured_s"].as_f64()?,
        p50: percentile("p50"),
        p99: percentile("p99"),
        p999: percentile("p99.9"),
        max_us: wake["max_us"].as_f64(),
        missed: report["haptic"]["counts"]["missed_deadlines"].as_u64()?,
        failed: limits
            .filter(|l| l["outcome"] == "FAIL")
            .map(|l| text(&l["name"]))
            .collect(),
        machine,
    })
}

fn outcome(words: &str) -> Option<Outcome> {
    [Outcome::Pass, Outcome::Fail, Outcome::NotMeasurable]
        .into_iter()
        .find(|o| o.words() == words)
}

fn fact(report: &Value, group: &str, name: &str) -> Option<String> {
    let facts = report["facts"].as_array()?;
    let fact = facts.iter().find(|f| f["group"] == group && f["name"] == name)?;
    fact["value"].as_str().map(str::to_owned)
}

fn machine(report: &Value) -> BTreeMap<String, String> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |key: &str| report[key].as_array().cloned().unwrap_or_default();
    let facts = list("facts").into_iter().map(|f| {
        (
            format!("{}: {}", text(&f["group"]), text(&f["name"])),
            text(&f["value"]),
        )
    });
    let settings = list("settings")
        .into_iter()
        .map(|s| (text(&s["name"]), text(&s["got"])));
    let mut all: BTreeMap<String, String> = facts
        .chain(settings)
        .filter(|(name, _)| !OWN.contains(&name.as_str()))
        .collect();
    all.insert("Program: version".to_owned(), text(&report["program"]));
    all.insert("Program: commit".to_owned(), text(&report["commit"]));
    if let Some(serial) = report["whose"]["device_serial"].as_str() {
        all.insert("device serial number".to_owned(), serial.to_owned());
    }
    all
}
