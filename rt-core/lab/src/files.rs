//! The files of a measurement: report, raw data, and what is computed from them, each with its digest.

use crate::cyclictest;
use crate::disk::{self, DiskError};
use crate::html;
use crate::plots::DrawError;
use crate::provenance::sha256;
use crate::raw::{Raw, RawError};
use crate::report::{CYCLICTEST, FileDigest, HISTOGRAMS, JSON, OSADL, PAGE, Report, WAKES};
use crate::sealed::seal;
use std::path::Path;
use stylet_write::write_whole;

/// The files of a measurement cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    #[error(transparent)]
    Draw(#[from] DrawError),
    #[error(transparent)]
    Raw(#[from] RawError),
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// Writes all files into `folder`, each with its digest in the report.
pub fn write(folder: &Path, report: &mut Report, raw: &Raw) -> Result<(), FilesError> {
    let put = |name: &str, bytes: &[u8]| write_whole(&folder.join(name), bytes).map_err(DiskError::from);
    let digest = |name: &str, bytes: &[u8]| FileDigest {
        name: name.to_owned(),
        sha256: sha256(bytes),
    };
    let (log, wakes) = (raw.log(report.protocol.measured_s)?, raw.wakes());
    report.files = vec![digest(HISTOGRAMS, &log), digest(WAKES, wakes.as_bytes())];
    let derived = derived(report, raw)?;
    let digests = derived.iter().map(|(name, text)| digest(name, text.as_bytes()));
    report.files.extend(digests);
    put(HISTOGRAMS, &log)?;
    put(WAKES, wakes.as_bytes())?;
    for (name, text) in &derived {
        put(name, text.as_bytes())?;
    }
    Ok(put(JSON, seal(&disk::json(report)?).as_bytes())?)
}

/// Returns the files that report and raw data determine.
pub fn derived(report: &Report, raw: &Raw) -> Result<[(&'static str, String); 3], FilesError> {
    Ok([
        (CYCLICTEST, cyclictest::json(report, raw)?),
        (OSADL, html::osadl(report, raw)?),
        (PAGE, html::page(report, raw)?),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sealed::NO_DIGEST;

    #[test]
    fn digest_is_that_of_the_standard() {
        // FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(b"abc"), abc);
        assert_eq!(NO_DIGEST.len(), abc.len());
    }
}
