//! The files of a measurement: JSON, page and raw histograms, each with its digest.

use crate::disk::DiskError;
use crate::html;
use crate::measure::Measured;
use crate::plots::DrawError;
use crate::provenance::sha256;
use crate::report::{FileDigest, HISTOGRAMS, JSON, NO_DIGEST, PAGE, Report};
use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};
use std::path::Path;
use std::time::Duration;
use stylet_write::write_whole;

/// The files of a measurement cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FilesError {
    #[error(transparent)]
    Draw(#[from] DrawError),
    #[error("the histograms cannot be written: {0}")]
    Histograms(String),
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// Writes all three files into `folder`, each with its digest in the report.
pub fn write(folder: &Path, report: &mut Report, measured: &Measured) -> Result<(), FilesError> {
    let put = |name: &str, bytes: &[u8]| write_whole(&folder.join(name), bytes).map_err(DiskError::from);
    let raw = raw_histograms(report, measured)?;
    put(HISTOGRAMS, &raw)?;
    let page = html::page(report, measured)?;
    report.files = vec![
        FileDigest {
            name: HISTOGRAMS,
            sha256: sha256(&raw),
        },
        FileDigest {
            name: PAGE,
            sha256: sha256(page.as_bytes()),
        },
    ];
    let json = serde_json::to_string_pretty(report).map_err(DiskError::from)? + "\n";
    report.sha256 = sha256(json.as_bytes());
    put(JSON, json.replacen(NO_DIGEST, &report.sha256, 1).as_bytes())?;
    Ok(put(PAGE, page.replacen(NO_DIGEST, &report.sha256, 1).as_bytes())?)
}

/// Returns every histogram in the interval log format of HdrHistogram, nanoseconds, one tagged line each.
fn raw_histograms(report: &Report, measured: &Measured) -> Result<Vec<u8>, FilesError> {
    let mut all: Vec<(String, &Histogram<u64>)> = Vec::new();
    let second = measured.second.as_ref().map(|timing| ("second", timing));
    let loops = [("haptic", &measured.haptic), ("tissue", &measured.tissue)];
    for (name, timing) in loops.into_iter().chain(second) {
        let mut add = |what: &str, h| all.push((format!("{name}/{}", what.replace(' ', "_")), h));
        add("wake", &timing.wake);
        add("jitter", &timing.jitter);
        for (stage, h) in timing.stage_names.iter().zip(&timing.stages) {
            add(stage, h);
        }
        add("work", &timing.work);
        add("path", &timing.path);
        add("due_to_output", &timing.due_to_output);
        add("recording", &timing.recording);
        for (i, part) in timing.sample.parts.iter().enumerate() {
            add(&format!("wake/part_{}", i + 1), part);
        }
    }
    all.push(("host/tip_to_host".to_owned(), &measured.host.tip_to_host));
    all.push(("host/tissue_to_host".to_owned(), &measured.host.tissue_to_host));
    all.push(("gap_watch/gaps".to_owned(), &measured.gaps.gaps));
    all.push(("gap_watch/wake".to_owned(), &measured.gaps.wake));
    if let Some(comparison) = &report.comparison {
        all.push(("comparison/ours".to_owned(), &comparison.ours));
        all.push(("comparison/other".to_owned(), &comparison.others));
    }
    let failed = |e: &dyn std::fmt::Debug| FilesError::Histograms(format!("{e:?}"));
    let mut bytes = Vec::new();
    let mut serializer = V2DeflateSerializer::new();
    let mut log = IntervalLogWriterBuilder::new()
        .add_comment("nanoseconds")
        .with_max_value_divisor(1e3)
        .begin_log_with(&mut bytes, &mut serializer)
        .map_err(|e| failed(&e))?;
    let length = Duration::from_secs_f64(report.protocol.measured_s);
    for (name, h) in &all {
        let tag = Tag::new(name).ok_or_else(|| failed(name))?;
        log.write_histogram(h, Duration::ZERO, length, Some(tag))
            .map_err(|e| failed(&e))?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_is_that_of_the_standard() {
        // FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(b"abc"), abc);
        assert_eq!(NO_DIGEST.len(), abc.len());
    }
}
