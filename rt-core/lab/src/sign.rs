//! Detached signatures of reports, made and checked by OpenSSH's `ssh-keygen -Y`, with keys that users already have.

use crate::disk::DiskError;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Purpose of the signature; a signature for another purpose with the same key is rejected.
const NAMESPACE: &str = "stylet-latency-report";
const PROGRAM: &str = "ssh-keygen";

/// A signature cannot be made, or is rejected.
#[derive(Debug, thiserror::Error)]
pub enum SignError {
    /// The program is missing.
    #[error("ssh-keygen is not installed, and signatures need it: sudo apt-get install openssh-client")]
    Missing,
    /// A named file is missing or unreadable.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// A signature is required.
    #[error("missing, the report is not signed")]
    Unsigned,
    /// `ssh-keygen` does not run.
    #[error("ssh-keygen does not run: {0}")]
    Run(io::Error),
    /// The key does not sign.
    #[error("{} cannot sign the report: {said}", .key.display())]
    Refused {
        /// The key.
        key: PathBuf,
        /// First line of the output of `ssh-keygen`.
        said: String,
    },
    /// The file or its signature was altered.
    #[error("the signature is not one of this {file}: one of the two was altered ({said})")]
    Altered {
        /// Name of the file.
        file: String,
        /// First line of the output of `ssh-keygen`.
        said: String,
    },
    /// The signature is good, but its key belongs to no permitted signer.
    #[error("wrong key: signed with {key}, which {} does not list", .allowed.display())]
    WrongKey {
        /// Kind and fingerprint.
        key: String,
        /// The file of permitted signers.
        allowed: PathBuf,
    },
}

/// Problem with the signature of a report.
#[derive(Debug, thiserror::Error)]
#[error("{name}: {why}")]
pub struct SignatureProblem {
    /// Name of the signature's file.
    pub name: String,
    /// Problem with it.
    pub why: SignError,
}

/// The signer.
#[derive(Debug, PartialEq, Eq)]
pub struct Signer {
    /// Kind and fingerprint of the key.
    pub key: String,
    /// Name in the file of permitted signers; `None` without such a file.
    pub person: Option<String>,
}

/// Returns the signature that belongs to a file: its name with `.sig`.
pub fn signature_of(file: &Path) -> PathBuf {
    file.with_added_extension("sig")
}

/// Checks the requirements of signing before a long measurement.
pub fn ready(key: &Path) -> Result<(), SignError> {
    readable(key)?;
    let asked = Command::new(PROGRAM).arg("-?").stdin(Stdio::null()).output();
    asked.map(|_| ()).map_err(not_run)
}

/// Signs `file` with a private key, or with a public one whose private half an agent holds.
pub fn sign(file: &Path, key: &Path) -> Result<PathBuf, SignError> {
    ready(key)?;
    let signature = signature_of(file);
    // An older one would make ssh-keygen ask.
    let _ = std::fs::remove_file(&signature);
    // A separate input: a key may ask for its passphrase.
    let output = Command::new(PROGRAM)
        .args(["-Y", "sign", "-n", NAMESPACE, "-f"])
        .args([key, file])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .output()
        .map_err(not_run)?;
    if output.status.success() && signature.exists() {
        return Ok(signature);
    }
    Err(SignError::Refused {
        key: key.to_owned(),
        said: first_line(&output),
    })
}

/// Note of a report without a signature.
pub const UNSIGNED: &str = "not signed";

/// Returns the signer of the report, or the problem with its signature.
pub fn signer(file: &Path, allowed: Option<&Path>) -> Result<String, SignatureProblem> {
    let signature = signature_of(file);
    let name = signature.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if !signature.exists() {
        return match allowed {
            Some(_) => Err(SignatureProblem {
                name,
                why: SignError::Unsigned,
            }),
            None => Ok(UNSIGNED.to_owned()),
        };
    }
    match check(file, allowed) {
        Ok(signer) => Ok(match signer.person {
            Some(person) => format!("signed by {person} with {}", signer.key),
            None => format!(
                "signed with {}; --allowed-signers FILE names whose key it is",
                signer.key
            ),
        }),
        // A check that needs the missing program is a problem only if it was requested.
        Err(SignError::Missing) if allowed.is_none() => Ok(format!("{name}: not checked: {}", SignError::Missing)),
        Err(why) => Err(SignatureProblem { name, why }),
    }
}

/// Checks the signature of `file`; `allowed` is a file of permitted signers in OpenSSH's format.
pub fn check(file: &Path, allowed: Option<&Path>) -> Result<Signer, SignError> {
    let signature = signature_of(file);
    let good = ask(&["check-novalidate", "-n", NAMESPACE], &[("-s", &signature)], file)?;
    let key = good.status.success().then(|| key_of(&good)).flatten();
    let Some(key) = key else {
        return Err(SignError::Altered {
            file: file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            said: first_line(&good),
        });
    };
    let Some(allowed) = allowed else {
        return Ok(Signer { key, person: None });
    };
    readable(allowed)?;
    let listed = ask(&["find-principals"], &[("-s", &signature), ("-f", allowed)], file)?;
    let people = String::from_utf8_lossy(&listed.stdout).into_owned();
    // One line for each entry; an entry may name several people.
    let person = people
        .lines()
        .next()
        .and_then(|line| line.split(',').next())
        .unwrap_or_default()
        .trim();
    let wrong = || SignError::WrongKey {
        key: key.clone(),
        allowed: allowed.to_owned(),
    };
    if !listed.status.success() || person.is_empty() {
        return Err(wrong());
    }
    let verified = ask(
        &["verify", "-n", NAMESPACE, "-I", person],
        &[("-s", &signature), ("-f", allowed)],
        file,
    )?;
    if !verified.status.success() {
        return Err(wrong());
    }
    Ok(Signer {
        key,
        person: Some(person.to_owned()),
    })
}

fn ask(what: &[&str], files: &[(&str, &Path)], signed: &Path) -> Result<Output, SignError> {
    let input = readable(signed)?;
    for (_, file) in files {
        readable(file)?;
    }
    let mut command = Command::new(PROGRAM);
    command.arg("-Y").args(what);
    for (flag, file) in files {
        command.arg(flag).arg(file);
    }
    command.stdin(input).output().map_err(not_run)
}

fn readable(path: &Path) -> Result<File, DiskError> {
    File::open(path).map_err(DiskError::read(path))
}

fn not_run(e: io::Error) -> SignError {
    if e.kind() == io::ErrorKind::NotFound {
        SignError::Missing
    } else {
        SignError::Run(e)
    }
}

/// Reads the key from `Good "namespace" signature with ED25519 key SHA256:...`
fn key_of(output: &Output) -> Option<String> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let (_, key) = text
        .lines()
        .find(|line| line.starts_with("Good "))?
        .rsplit_once(" with ")?;
    Some(key.trim().to_owned())
}

fn first_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    text.lines()
        .find(|line| !line.trim().is_empty())
        .unwrap_or("no reason given")
        .trim()
        .to_owned()
}
