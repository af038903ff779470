//! `rt-core credibility`: a single file for an auditor: purpose of the simulator, hazards, the tests against them, and
//! the runs as evidence.
//!
//! The tables are `context` (purpose and limits), `hazards`, `trace` (requirements) and `evidence` (the categories of
//! the FDA's guidance, the factors of ASME V&V 40, present and missing). Runs come from reports of `rt-core latency`.
//! The file names standards as the vocabulary of its reader and claims conformity with none.

mod context;
mod evidence;
mod hazards;
mod page;
mod runs;
mod soup;
#[cfg(test)]
mod tests;
mod trace;

use crate::provenance;
use clap::Args;
use context::CONTEXT;
use evidence::{CATEGORIES, Category, FACTORS, Factor};
use hazards::{HAZARDS, Hazard};
use runs::{Run, RunError};
use serde::Serialize;
use soup::Package;
use std::path::PathBuf;
use stylet_write::{WriteError, write_whole};
use trace::{REQUIREMENTS, Requirement};

const JSON: &str = "credibility.json";
const PAGE: &str = "credibility.html";
/// Limits of the claim that the file makes.
const CLAIM: &str = "This file is evidence for whoever assesses Stylet. It uses words of IEC 62304 (software life cycle), ISO 14971 (risk \
    management) and IEC 60601-1 (medical electrical equipment), of the FDA's guidance on the credibility of computational modelling \
    (November 2023) and of ASME V&V 40-2018, so that their readers find their way. It claims conformity with none of them: \
    nobody has assessed it, and Stylet is not a medical device.";

/// What the file is made from.
#[derive(Args, Clone, Debug)]
pub struct CredibilityArgs {
    /// Folder for credibility.html and credibility.json
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Folder of a report of `rt-core latency`: its outcome of each limit stands beside the requirement; may be given
    /// again
    #[arg(long, value_name = "DIR")]
    pub run: Vec<PathBuf>,
}

/// The file cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum CredibilityError {
    /// A report that cannot be used.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The folder cannot be made.
    #[error("cannot make {}: {source}", .path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
}

/// The whole file.
#[derive(Serialize)]
struct Credibility {
    pub schema: &'static str,
    pub made_at: String,
    pub program: String,
    pub commit: &'static str,
    pub claim: &'static str,
    pub context: &'static [(&'static str, &'static str)],
    pub hazards: &'static [Hazard],
    pub requirements: Vec<Traced>,
    pub categories: &'static [Category],
    pub factors: &'static [Factor],
    pub runs: Vec<Run>,
    pub packages: Vec<Package>,
}

/// A requirement with its evidence from runs.
#[derive(Serialize)]
struct Traced {
    #[serde(flatten)]
    pub requirement: &'static Requirement,
    /// Outcomes by the number of the run, from 1; empty if no run was given or none has a limit of this name.
    pub outcomes: Vec<(usize, String)>,
}

/// Writes both files.
///
/// # Errors
/// A report is invalid or was altered, or the files cannot be written.
pub fn run(args: &CredibilityArgs) -> Result<u8, CredibilityError> {
    let runs = args
        .run
        .iter()
        .map(|folder| runs::read(folder))
        .collect::<Result<Vec<Run>, _>>()?;
    let credibility = credibility(runs);
    std::fs::create_dir_all(&args.out).map_err(|source| CredibilityError::Folder {
        path: args.out.clone(),
        source,
    })?;
    let json = serde_json::to_string_pretty(&credibility).unwrap_or_default() + "\n";
    write_whole(&args.out.join(JSON), json.as_bytes())?;
    write_whole(&args.out.join(PAGE), page::page(&credibility).as_bytes())?;
    let open = CATEGORIES.iter().filter(|c| !c.missing.is_empty()).count();
    println!(
        "{} hazards, {} requirements, {} runs, {} packages; of {} categories {open} lack something, which is named",
        HAZARDS.len(),
        REQUIREMENTS.len(),
        credibility.runs.len(),
        credibility.packages.len(),
        CATEGORIES.len()
    );
    println!("{}", args.out.join(PAGE).display());
    println!("{}", args.out.join(JSON).display());
    Ok(0)
}

fn credibility(runs: Vec<Run>) -> Credibility {
    let outcomes = |r: &Requirement| {
        let of_run = |(i, run): (usize, &Run)| Some((i + 1, run.outcomes.get(r.id)?.clone()));
        runs.iter().enumerate().filter_map(of_run).collect()
    };
    let requirements = REQUIREMENTS
        .iter()
        .map(|requirement| Traced {
            requirement,
            outcomes: outcomes(requirement),
        })
        .collect();
    Credibility {
        schema: "stylet.credibility/1",
        made_at: jiff::Timestamp::now().strftime("%Y-%m-%d %H:%M:%S UTC").to_string(),
        program: format!("rt-core {}", env!("CARGO_PKG_VERSION")),
        commit: provenance::COMMIT,
        claim: CLAIM,
        context: CONTEXT,
        hazards: HAZARDS,
        requirements,
        categories: CATEGORIES,
        factors: FACTORS,
        runs,
        packages: soup::packages(),
    }
}
