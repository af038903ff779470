//! `rt-core credibility`: a single file for an auditor: purpose of the simulator, hazards, the tests against them, and
//! the runs as evidence.
//!
//! `tables.toml` holds purpose and limits, hazards, requirements, and the evidence by the categories of the FDA's
//! guidance and the factors of ASME V&V 40, present and missing. Runs come from reports of `rt-core latency`. The file
//! names standards as the vocabulary of its reader and claims conformity with none.

mod page;
mod runs;
mod tables;
#[cfg(test)]
mod tests;

use crate::disk::{self, DiskError};
use crate::provenance::{self, Package};
use crate::saved::NotCounted;
use clap::Args;
use runs::Run;
use serde::Serialize;
use std::path::PathBuf;
use tables::{Category, Factor, Hazard, Requirement, TABLES};

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
    Run(#[from] NotCounted),
    /// The file cannot be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// The whole file.
#[derive(Serialize)]
struct Credibility {
    pub schema: &'static str,
    pub made_at: String,
    pub program: String,
    pub commit: &'static str,
    pub claim: &'static str,
    pub context: &'static [(String, String)],
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
    pub outcomes: Vec<(usize, &'static str)>,
}

/// Writes both files.
///
/// # Errors
/// A report is invalid or was altered, or the files cannot be written.
pub fn run(args: &CredibilityArgs) -> Result<u8, CredibilityError> {
    let runs = args.run.iter().map(|folder| runs::read(folder));
    let c = credibility(runs.collect::<Result<Vec<Run>, _>>()?);
    println!(
        "{} hazards, {} requirements, {} runs, {} packages; of {} categories {} lack something, which is named",
        c.hazards.len(),
        c.requirements.len(),
        c.runs.len(),
        c.packages.len(),
        c.categories.len(),
        c.categories
            .iter()
            .filter(|category| !category.missing.is_empty())
            .count()
    );
    disk::write_report(&args.out, "credibility", &c, &page::page(&c))?;
    Ok(0)
}

fn credibility(runs: Vec<Run>) -> Credibility {
    let traced = |requirement: &'static Requirement| Traced {
        requirement,
        outcomes: (1..)
            .zip(&runs)
            .filter_map(|(i, run)| Some((i, *run.outcomes.get(&requirement.id)?)))
            .collect(),
    };
    Credibility {
        schema: "stylet.credibility/1",
        made_at: provenance::now(),
        program: provenance::program(),
        commit: provenance::COMMIT,
        claim: CLAIM,
        context: &TABLES.context,
        hazards: &TABLES.hazards,
        requirements: TABLES.requirements.iter().map(traced).collect(),
        categories: &TABLES.categories,
        factors: &TABLES.factors,
        runs,
        packages: provenance::packages(),
    }
}
