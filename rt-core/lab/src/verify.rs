//! Verifies a saved report: its digests, every figure from the raw data, its signature, and its programs.

mod again;
mod stamp;

use crate::campaign;
use crate::disk::{self, DiskError};
use crate::provenance::sha256;
use crate::report::{JSON, OLD_SCHEMA, SCHEMA};
use crate::saved::{NotCounted, Saved};
use crate::sealed::{self, MISSING, OLDER};
use crate::sign;
use crate::spread::{self, SPREAD};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};
use stylet_text::printable;

/// What to verify.
#[derive(Args, Clone, Debug)]
pub struct VerifyArgs {
    /// The folder of a report or of a campaign, or its report.json
    pub report: PathBuf,
    /// Who may sign: OpenSSH's file of allowed signers, a line `NAME ssh-ed25519 KEY` for each. The report must then be
    /// signed
    #[arg(long, value_name = "FILE")]
    pub allowed_signers: Option<PathBuf>,
    /// Program that the report must be of, rt-core or host-ui; may be given for both
    #[arg(long, value_name = "FILE")]
    pub binary: Vec<PathBuf>,
    /// Challenge that the report must answer
    #[arg(long, value_name = "TEXT")]
    pub nonce: Option<String>,
    /// Certificates of the authority that stamped report.json with the time (RFC 3161); the stamp is report.json.tsr, as
    /// `openssl ts` and the authority made it
    #[arg(long, value_name = "FILE")]
    pub timestamp_ca: Option<PathBuf>,
}

/// Checks the report, and prints every problem; without one, the signer and what could not be checked.
///
/// Returns 0 if the report is unaltered and meets the request, else 1.
///
/// # Errors
/// `report.json` or a named program cannot be read.
pub fn run(args: &VerifyArgs) -> Result<u8, DiskError> {
    if args.report.join(campaign::REPORT).exists() {
        let checked = campaign::check(&args.report, args.allowed_signers.as_deref())?;
        return Ok(said(&args.report.join(campaign::REPORT), checked.0, &checked.1));
    }
    if args.report.join(SPREAD).exists() {
        return runs(args);
    }
    let file = if args.report.is_dir() {
        args.report.join(JSON)
    } else {
        args.report.clone()
    };
    let bytes = disk::read(&file)?;
    // Damaged bytes may not be text; the file then differs from its digest.
    let text = String::from_utf8_lossy(&bytes);
    let Checked {
        mut problems,
        mut notes,
    } = check(&file, &text, args.allowed_signers.as_deref());
    // A report by itself can be read, not verified.
    let missing = |note: &String| note.ends_with(MISSING);
    problems.extend(notes.extract_if(.., |note| missing(note)));
    let report: Value = serde_json::from_str(&text).unwrap_or_default();
    for binary in &args.binary {
        problems.extend(other_program(&report, binary, &sha256(&disk::read(binary)?)));
    }
    let answered = report["nonce"].as_str();
    if let Some(asked) = args.nonce.as_deref().filter(|asked| answered != Some(*asked)) {
        let answered = answered.map_or("none".to_owned(), |nonce| format!("{nonce:?}"));
        problems.push(format!(
            "{JSON}: not of this challenge: asked {asked:?}, the report answers {answered}"
        ));
    }
    if let Some(ca) = &args.timestamp_ca {
        match stamp::check(&file, ca) {
            Ok(note) => notes.push(note),
            Err(why) => problems.push(why.to_string()),
        }
    }
    Ok(said(&file, problems, &notes))
}

/// Checks each run below a folder, and the spread between them.
fn runs(args: &VerifyArgs) -> Result<u8, DiskError> {
    let mut worst = 0;
    for report in spread::folders(&args.report) {
        let args = VerifyArgs { report, ..args.clone() };
        worst = worst.max(run(&args)?);
    }
    let problems = spread::problem(&args.report)?.into_iter().collect();
    Ok(worst.max(said(&args.report.join(SPREAD), problems, &[])))
}

/// Prints the problems, without one the notes; returns the exit code.
fn said(file: &Path, problems: Vec<String>, notes: &[String]) -> u8 {
    for problem in &problems {
        println!("{}", printable(problem));
    }
    if problems.is_empty() {
        println!("{}: unaltered", file.display());
        notes.iter().for_each(|note| println!("{}", printable(note)));
    }
    u8::from(!problems.is_empty())
}

/// Outcome of all checks that need nothing but the folder of the report.
#[derive(Debug, Default)]
pub(crate) struct Checked {
    pub problems: Vec<String>,
    /// Signer, and what could not be checked.
    pub notes: Vec<String>,
}

/// Reads the report `file`; an altered one is refused, as is one that contradicts itself or has a wrong signature. Page
/// and raw data may be missing: reports are often collected without them; the notes say so.
pub(crate) fn read(file: &Path, allowed: Option<&Path>) -> Result<Saved, NotCounted> {
    let refused = |why: String| NotCounted {
        path: file.display().to_string(),
        why,
    };
    let text = disk::read_text(file).map_err(|e| refused(e.to_string()))?;
    let checked = check(file, &text, allowed);
    if let Some(problem) = checked.problems.into_iter().next() {
        return Err(refused(problem));
    }
    let report = serde_json::from_str(&text).map_err(|e| refused(format!("not the {JSON} of a measurement: {e}")))?;
    Ok(Saved {
        notes: checked.notes,
        ..report
    })
}

/// Checks digests, figures and signature of the report `file` with the contents `text`.
pub(crate) fn check(file: &Path, text: &str, allowed: Option<&Path>) -> Checked {
    let folder = file.parent().unwrap_or(Path::new("."));
    let read = |name: &str| disk::read(&folder.join(name)).ok();
    let mut checked = Checked::default();
    let (missing, altered): (Vec<_>, _) = sealed::problems(JSON, text, read)
        .into_iter()
        .partition(|p| p.ends_with(MISSING));
    checked.problems = altered;
    match schema(text).as_deref() {
        Some(OLD_SCHEMA) => checked.notes.push(OLDER.to_owned()),
        Some(SCHEMA) if missing.is_empty() => {
            let again = again::check(text, read);
            checked.problems.extend(again.problems);
            checked.notes.extend(again.notes);
        }
        Some(SCHEMA) => {}
        found => checked.problems.push(format!(
            "{JSON}: schema {}, expected {SCHEMA:?}",
            found.unwrap_or("of none")
        )),
    }
    checked.notes.extend(missing);
    match sign::signer(file, allowed) {
        Ok(note) => checked.notes.push(note),
        Err(problem) => checked.problems.push(problem.to_string()),
    }
    checked
}

fn schema(text: &str) -> Option<String> {
    let report: Value = serde_json::from_str(text).ok()?;
    Some(report["schema"].as_str()?.to_owned())
}

/// Returns the discrepancy if the report is not of the program `binary`.
fn other_program(report: &Value, binary: &Path, digest: &str) -> Option<String> {
    let programs = report["programs"].as_array().map_or(&[][..], Vec::as_slice);
    let text = |program: &Value, key: &str| program[key].as_str().unwrap_or_default().to_owned();
    if programs.iter().any(|program| text(program, "sha256") == digest) {
        return None;
    }
    let own_name = binary.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let named: Vec<String> = programs
        .iter()
        .map(|p| format!("{} {}", text(p, "name"), text(p, "sha256")))
        .collect();
    let named = if named.is_empty() {
        "no program".to_owned()
    } else {
        named.join(", ")
    };
    Some(format!(
        "{JSON}: a report of another program: {own_name} has the SHA-256 {digest}, the report names {named}"
    ))
}

#[cfg(test)]
mod forgeries;
#[cfg(test)]
mod tests;
