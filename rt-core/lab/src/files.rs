//! The files of a measurement: JSON, page and raw histograms, each with its digest.

use crate::html;
use crate::measure::Measured;
use crate::report::{FileDigest, HISTOGRAMS, JSON, NO_DIGEST, PAGE, Report};
use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};
use sha2::{Digest, Sha256};
use std::fs::Permissions;
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::time::Duration;

/// Writes all three files into `folder`, each with its digest in the report.
pub fn write(folder: &Path, report: &mut Report, measured: &Measured) -> Result<(), String> {
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_whole(&path, bytes).map_err(|e| format!("cannot write {}: {e}", path.display()))
    };
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
    let json = serde_json::to_string_pretty(report).map_err(|e| format!("the report cannot be written: {e}"))? + "\n";
    report.sha256 = sha256(json.as_bytes());
    put(JSON, json.replacen(NO_DIGEST, &report.sha256, 1).as_bytes())?;
    put(PAGE, page.replacen(NO_DIGEST, &report.sha256, 1).as_bytes())
}

/// Permissions of a new file before the umask, as of every file that a program creates.
const MODE: u32 = 0o666;

/// Writes to a temporary file beside `path` and renames it: a reader sees the old content or the new, never a part.
fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = tempfile::Builder::new()
        .permissions(Permissions::from_mode(MODE))
        .tempfile_in(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

/// SHA-256 of `bytes` as 64 lower-case hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Every histogram in the interval log format of HdrHistogram, nanoseconds, one tagged line each.
fn raw_histograms(report: &Report, measured: &Measured) -> Result<Vec<u8>, String> {
    let mut all: Vec<(String, &Histogram<u64>)> = Vec::new();
    for (name, timing) in [("haptic", &measured.haptic), ("tissue", &measured.tissue)] {
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
    }
    all.push(("host/tip_to_host".to_owned(), &measured.host.tip_to_host));
    all.push(("host/tissue_to_host".to_owned(), &measured.host.tissue_to_host));
    all.push(("gap_watch/gaps".to_owned(), &measured.gaps.gaps));
    all.push(("gap_watch/wake".to_owned(), &measured.gaps.wake));
    if let Some(comparison) = &report.comparison {
        all.push(("comparison/ours".to_owned(), &comparison.ours));
        all.push(("comparison/other".to_owned(), &comparison.others));
    }
    let failed = |e: &dyn std::fmt::Debug| format!("the histograms cannot be written: {e:?}");
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

    #[test]
    fn a_file_is_replaced_whole_and_a_failed_write_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join(JSON);
        write_whole(&path, b"a longer old report").expect("written");
        write_whole(&path, b"new").expect("written");
        assert_eq!(std::fs::read(&path).expect("readable"), b"new");
        // A folder has this name: the rename fails.
        let taken = folder.path().join("taken");
        std::fs::create_dir(&taken).expect("made");
        assert!(write_whole(&taken, b"new").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).expect("readable").count(), 2);
    }

    #[test]
    fn a_new_file_has_the_permissions_of_any_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = |path: &Path| std::fs::metadata(path).expect("there").permissions().mode() & 0o777;
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_whole(&ours, b"x").expect("written");
        std::fs::write(&plain, b"x").expect("written");
        assert_eq!(mode(&ours), mode(&plain));
    }
}
