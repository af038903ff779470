//! One report of the fleet.

use crate::saved::{NotCounted, Saved, Times};
use crate::verdict::Outcome;
use crate::verify;
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
    /// Name of the PC; in reports that lack it, the name of the folder above the report's.
    pub pc: String,
    /// Scene, load, rate and spin: only reports of the same protocol are compared.
    pub protocol: String,
    /// Facts of the report about machine, settings and program.
    pub machine: BTreeMap<String, String>,
    pub report: Saved,
}

/// Values that differ from run to run without meaning, or that identify the PC.
const OWN: [&str; 3] = ["memory lock", "PC: name", "PC: serial number"];

/// Reads a report; `allowed` are the people who may sign.
pub fn read(file: &Path, allowed: Option<&Path>) -> Result<Entry, NotCounted> {
    let report = verify::read(file, allowed)?;
    let named = report.facts.iter().find(|f| f.group == "PC" && f.name == "name");
    let named = named.map(|f| f.value.clone()).filter(|name| name != "not reported");
    let above = file
        .parent()
        .and_then(Path::parent)
        .and_then(Path::file_name)
        .unwrap_or_default();
    let p = &report.protocol;
    Ok(Entry {
        path: file.display().to_string(),
        pc: named.unwrap_or_else(|| above.to_string_lossy().into_owned()),
        protocol: format!("{}, load {}, {} Hz, spin {} us", p.scene, p.load, p.rate_hz, p.spin_us),
        machine: machine(&report),
        report,
    })
}

fn machine(report: &Saved) -> BTreeMap<String, String> {
    let facts = report
        .facts
        .iter()
        .map(|f| (format!("{}: {}", f.group, f.name), f.value.clone()));
    let settings = report.settings.iter().map(|s| (s.name.clone(), s.got.clone()));
    let program = [("version", &report.program), ("commit", &report.commit)];
    let program = program.map(|(what, value)| (format!("Program: {what}"), value.clone()));
    let serial = report
        .whose
        .device_serial
        .iter()
        .map(|serial| ("device serial number".to_owned(), serial.clone()));
    let own = |name: &String| OWN.contains(&name.as_str());
    facts
        .chain(settings)
        .filter(|(name, _)| !own(name))
        .chain(program)
        .chain(serial)
        .collect()
}

impl Entry {
    pub fn outcome(&self) -> Outcome {
        self.report.verdict.overall
    }

    fn wake(&self) -> Option<&Times> {
        self.report.haptic.times.iter().find(|t| t.name == "wake-up")
    }

    /// Returns a percentile of the wake-ups of the force loop.
    pub fn percentile(&self, name: &str) -> Option<Percentile> {
        let quantile = self.wake()?.quantiles.iter().find(|q| q.name == name)?;
        let interval_us = quantile.interval_us;
        quantile.us.map(|us| Percentile { us, interval_us })
    }

    pub fn max_us(&self) -> Option<f64> {
        self.wake()?.max_us
    }

    /// Returns the names of the limits that are not met.
    pub fn failed(&self) -> Vec<&str> {
        let limits = self.report.verdict.limits.iter();
        limits
            .filter(|l| l.outcome == Outcome::Fail)
            .map(|l| l.name.as_str())
            .collect()
    }
}
