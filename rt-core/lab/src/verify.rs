//! Verifies that a saved report is unaltered, its signature, and its programs.

use crate::disk::{self, DiskError};
use crate::provenance::sha256;
use crate::report::{JSON, NO_DIGEST};
use crate::sign::{self, SignError};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};
use stylet_text::printable;

/// What to verify.
#[derive(Args, Clone, Debug)]
pub struct VerifyArgs {
    /// The folder of the report, or its report.json
    pub report: PathBuf,
    /// Who may sign: OpenSSH's file of allowed signers, a line `NAME ssh-ed25519 KEY` for each. The report must then be
    /// signed
    #[arg(long, value_name = "FILE")]
    pub allowed_signers: Option<PathBuf>,
    /// Program that the report must be of, rt-core or host-ui; may be given for both
    #[arg(long, value_name = "FILE")]
    pub binary: Vec<PathBuf>,
}

/// Checks the report, and prints every problem; without one, the signer.
///
/// Returns 0 if the report is unaltered and meets the request, else 1.
///
/// # Errors
/// `report.json` or a named program cannot be read.
pub fn run(args: &VerifyArgs) -> Result<u8, DiskError> {
    let file = if args.report.is_dir() {
        args.report.join(JSON)
    } else {
        args.report.clone()
    };
    let bytes = disk::read(&file)?;
    // Damaged bytes may not be text; the file then differs from its digest.
    let text = String::from_utf8_lossy(&bytes);
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut problems = problems(&text, |name| std::fs::read(folder.join(name)).ok());
    let mut notes = Vec::new();
    match signature(&file, args.allowed_signers.as_deref()) {
        Ok(note) => notes.push(note),
        Err(problem) => problems.push(problem),
    }
    let report: Value = serde_json::from_str(&text).unwrap_or_default();
    for binary in &args.binary {
        problems.extend(other_program(&report, binary, &sha256(&disk::read(binary)?)));
    }
    for problem in &problems {
        println!("{}", printable(&problem.to_string()));
    }
    if problems.is_empty() {
        println!("{}: unaltered", file.display());
        notes.iter().for_each(|note| println!("{}", printable(note)));
    }
    Ok(u8::from(!problems.is_empty()))
}

/// Returns the signer of the report, or the problem with its signature.
fn signature(file: &Path, allowed: Option<&Path>) -> Result<String, String> {
    let signature = sign::signature_of(file);
    let name = signature.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if !signature.exists() {
        return match allowed {
            Some(_) => Err(format!("{name}: missing, the report is not signed")),
            None => Ok("not signed".to_owned()),
        };
    }
    match sign::check(file, allowed) {
        Ok(signer) => Ok(match signer.person {
            Some(person) => format!("signed by {person} with {}", signer.key),
            None => format!(
                "signed with {}; --allowed-signers FILE names whose key it is",
                signer.key
            ),
        }),
        // A check that needs the missing program is a problem only if it was requested.
        Err(SignError::Missing) if allowed.is_none() => Ok(format!("{name}: not checked: {}", SignError::Missing)),
        Err(problem) => Err(format!("{name}: {problem}")),
    }
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

/// Returns everything that was altered; `read` returns the contents of a file in the report's folder.
pub(crate) fn problems(text: &str, read: impl Fn(&str) -> Option<Vec<u8>>) -> Vec<String> {
    let Ok(report) = serde_json::from_str::<Value>(text) else {
        return vec![format!("{JSON}: tampered with or damaged, it is not JSON")];
    };
    let digest = report["sha256"].as_str().unwrap_or_default();
    if digest.len() != NO_DIGEST.len() || digest == NO_DIGEST {
        return vec![format!("{JSON}: it carries no SHA-256")];
    }
    let mut problems = Vec::new();
    let found = sha256(text.replacen(digest, NO_DIGEST, 1).as_bytes());
    if found != digest {
        problems.push(format!(
            "{JSON}: tampered with: its SHA-256 is {found}, it says {digest}"
        ));
    }
    for file in report["files"].as_array().into_iter().flatten() {
        let (name, said) = (
            file["name"].as_str().unwrap_or_default(),
            file["sha256"].as_str().unwrap_or_default(),
        );
        let Some(bytes) = read(name) else {
            problems.push(format!("{name}: missing"));
            continue;
        };
        // The page shows the report's digest, which did not exist yet when the page's was computed.
        let bare = match std::str::from_utf8(&bytes) {
            Ok(page) => page.replacen(digest, NO_DIGEST, 1).into_bytes(),
            Err(_) => bytes,
        };
        if sha256(&bare) != said {
            problems.push(format!(
                "{name}: tampered with: its SHA-256 is not the one that the report names"
            ));
        }
    }
    problems
}

#[cfg(test)]
mod tests;
