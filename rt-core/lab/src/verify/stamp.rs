//! The time at which an authority saw a report (RFC 3161), from a file that another tool fetched.

use crate::disk::{self, DiskError};
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// The time stamp does not hold.
#[derive(Debug, thiserror::Error)]
pub enum StampError {
    #[error("openssl is not installed, and time stamps need it: sudo apt-get install openssl")]
    Missing,
    #[error("openssl does not run: {0}")]
    Run(io::Error),
    #[error(transparent)]
    Disk(#[from] DiskError),
    #[error("{}: not a time stamp of this report by that authority: {said}", .stamp.display())]
    Refused { stamp: PathBuf, said: String },
}

/// Returns the time at which the authority with the certificates `ca` saw `file`, in words.
pub fn check(file: &Path, ca: &Path) -> Result<String, StampError> {
    let stamp = file.with_added_extension("tsr");
    for needed in [file, ca, &stamp] {
        disk::read(needed)?;
    }
    let word = OsStr::new;
    let of_file = [word("-verify"), word("-data"), file.as_ref()];
    let by_stamp = [word("-in"), stamp.as_ref(), word("-CAfile"), ca.as_ref()];
    let verified = openssl(of_file.into_iter().chain(by_stamp))?;
    if !verified.status.success() {
        let said = String::from_utf8_lossy(&verified.stderr).into_owned();
        let why = said.lines().find(|l| l.contains("error:")).or(said.lines().next());
        let said = why.unwrap_or("no reason given").to_owned();
        return Err(StampError::Refused { stamp, said });
    }
    let shown = openssl([word("-reply"), word("-in"), stamp.as_ref(), word("-text")])?;
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    let time = shown.lines().find_map(|l| l.strip_prefix("Time stamp:"));
    Ok(format!(
        "stamped by the authority at {}",
        time.unwrap_or("a time that openssl does not name").trim()
    ))
}

fn openssl<'a>(words: impl IntoIterator<Item = &'a OsStr>) -> Result<Output, StampError> {
    let run = Command::new("openssl")
        .arg("ts")
        .args(words)
        .stdin(Stdio::null())
        .output();
    run.map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => StampError::Missing,
        _ => StampError::Run(e),
    })
}
