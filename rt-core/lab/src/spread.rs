//! The spread between runs: `latency --repeat` measures some times, each into a folder of its own, and says how far the
//! runs differ. The interval of a percentile covers its own run alone.

use crate::compare::median;
use crate::disk::{self, DiskError};
use crate::report::JSON;
use crate::saved::{Saved, Times};
use serde::Serialize;
use std::path::{Path, PathBuf};
use stylet_write::write_whole;

/// File of the spread, in the folder of the runs.
pub const SPREAD: &str = "spread.json";
const SCHEMA: &str = "stylet.spread/1";

/// One figure of the force loop's wake-up in all runs, microseconds.
#[derive(Debug, PartialEq, Serialize)]
struct Between {
    name: String,
    /// In the order of the runs; `None` where a run was too short.
    us: Vec<Option<f64>>,
    least_us: Option<f64>,
    median_us: Option<f64>,
    largest_us: Option<f64>,
}

impl Between {
    fn of(name: &str, us: Vec<Option<f64>>) -> Self {
        let known = || us.iter().flatten().copied();
        Self {
            name: name.to_owned(),
            least_us: known().min_by(f64::total_cmp),
            median_us: median(known()),
            largest_us: known().max_by(f64::total_cmp),
            us,
        }
    }
}

/// The runs by their digests, and how far they differ.
#[derive(Debug, Serialize)]
struct Spread {
    schema: &'static str,
    runs: Vec<String>,
    wake: Vec<Between>,
}

/// Returns the folder of a run, numbered from 1.
pub fn folder(of: &Path, run: u32) -> PathBuf {
    of.join(format!("run-{run}"))
}

/// Returns the folders of all runs.
pub fn folders(of: &Path) -> impl Iterator<Item = PathBuf> {
    (1..)
        .map(move |run| folder(of, run))
        .take_while(|run| run.join(JSON).exists())
}

fn read(of: &Path) -> Result<Spread, DiskError> {
    let report =
        |run: PathBuf| -> Result<Saved, DiskError> { Ok(serde_json::from_str(&disk::read_text(&run.join(JSON))?)?) };
    let runs: Vec<Saved> = folders(of).map(report).collect::<Result<_, _>>()?;
    let wakes: Vec<&Times> = runs
        .iter()
        .filter_map(|run| run.haptic.times.iter().find(|t| t.name == "wake-up"))
        .collect();
    let names = wakes.first().map_or(&[][..], |t| &t.quantiles);
    let at = |t: &&Times, name: &str| t.quantiles.iter().find(|q| q.name == name)?.us;
    let quantiles = names
        .iter()
        .map(|q| Between::of(&q.name, wakes.iter().map(|t| at(t, &q.name)).collect()));
    let max = Between::of("max", wakes.iter().map(|t| t.max_us).collect());
    Ok(Spread {
        schema: SCHEMA,
        wake: quantiles.chain([max]).collect(),
        runs: runs.iter().map(|run| run.sha256.clone()).collect(),
    })
}

/// Writes the spread of the runs below a folder, and prints it.
pub fn write(of: &Path) -> Result<(), DiskError> {
    let spread = read(of)?;
    println!("wake-up in {} runs, us: median (least to largest)", spread.runs.len());
    for b in &spread.wake {
        if let (Some(least), Some(median), Some(largest)) = (b.least_us, b.median_us, b.largest_us) {
            println!("{:<7} {median:>9.1} ({least:.1} to {largest:.1})", b.name);
        }
    }
    println!("{}", of.join(SPREAD).display());
    Ok(write_whole(&of.join(SPREAD), disk::json(&spread)?.as_bytes())?)
}

/// Returns what is wrong with the spread, whose reports are checked by themselves.
pub fn problem(of: &Path) -> Result<Option<String>, DiskError> {
    let is_so = disk::read_text(&of.join(SPREAD))? == disk::json(&read(of)?)?;
    Ok((!is_so).then(|| format!("{SPREAD}: not the spread of the runs in this folder")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(p99_us: f64) -> String {
        format!(
            r#"{{"sha256": "{p99_us}", "made_at": "", "program": "", "commit": "", "protocol": {{"scene": "", "load": "",
            "rate_hz": 1000, "spin_us": 0, "measured_s": 1}}, "verdict": {{"overall": "PASS", "limits": []}}, "haptic":
            {{"counts": {{"missed_deadlines": 0}}, "times": [{{"name": "wake-up", "max_us": 900, "quantiles":
            [{{"name": "p99", "us": {p99_us}}}, {{"name": "p99.99", "us": null}}]}}]}}}}"#
        )
    }

    #[test]
    fn spread_is_of_all_runs_and_a_changed_or_missing_one_is_found() {
        let of = tempfile::tempdir().expect("a folder");
        for (run, p99_us) in (1..).zip([77.0, 61.0, 68.0]) {
            disk::make(&folder(of.path(), run)).expect("made");
            std::fs::write(folder(of.path(), run).join(JSON), report(p99_us)).expect("written");
        }
        write(of.path()).expect("written");
        let spread = read(of.path()).expect("three reports");
        let p99 = &spread.wake[0];
        assert_eq!(
            (p99.least_us, p99.median_us, p99.largest_us),
            (Some(61.0), Some(68.0), Some(77.0))
        );
        assert_eq!(spread.wake[1].median_us, None);
        assert_eq!(problem(of.path()).expect("readable"), None);
        let last = folder(of.path(), 3).join(JSON);
        std::fs::write(&last, report(78.0)).expect("written");
        assert!(problem(of.path()).expect("readable").is_some());
        std::fs::remove_file(last).expect("removed");
        assert!(problem(of.path()).expect("readable").is_some());
    }

    #[test]
    fn median_of_two_runs_is_their_middle() {
        assert_eq!(
            Between::of("p50", vec![Some(3.0), None, Some(1.0)]).median_us,
            Some(2.0)
        );
    }
}
