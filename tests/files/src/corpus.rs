//! Every file of the corpora, cut and altered, is answered by its reader, within bounded memory.
//!
//! The corpora hold the seeds and the findings of fuzzing (docs/tools/fuzz).

use std::path::{Path, PathBuf};
use stylet_files as files;

/// Memory limit of all readers together, in addition to the test's own (KiB).
const MAX_KIB: u64 = 1 << 20;

fn corpus(reader: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = stylet_test_kit::repository("tests/files/corpus").join(reader);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{reader} has no corpus");
    let bytes = |path: PathBuf| (path.clone(), std::fs::read(path).expect("a file"));
    files.into_iter().map(bytes).collect()
}

/// Largest memory of this process since the last call (KiB).
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("status");
    let line = status.lines().find(|l| l.starts_with("VmHWM")).expect("VmHWM");
    line.split_whitespace()
        .nth(1)
        .and_then(|n| n.parse().ok())
        .expect("a number")
}

/// Replays each file unchanged, cut at every 64th byte, with bytes altered, and with runs of ones instead of sizes.
fn replay(reader: &str, read: fn(&[u8]) -> Option<files::ContentError>) {
    let before = peak_kib();
    let (mut runs, mut refused) = (0, 0);
    let mut take = |bytes: &[u8]| {
        runs += 1;
        if let Some(why) = read(bytes).map(|why| why.to_string()) {
            refused += 1;
            assert!(
                !why.trim().is_empty() && why.len() < 20_000,
                "{} bytes of message",
                why.len()
            );
        }
    };
    for (path, bytes) in corpus(reader) {
        take(&bytes);
        (0..64).for_each(|n| take(&bytes[..bytes.len() * n / 64]));
        // Fuzzing's slow files only take time when altered.
        if path
            .file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with("found"))
        {
            continue;
        }
        let step = (bytes.len() / 192).max(1);
        for at in (0..bytes.len()).step_by(step) {
            for change in [0x01, 0x80, 0xff] {
                let mut bent = bytes.clone();
                bent[at] ^= change;
                take(&bent);
            }
            let mut large = bytes.clone();
            large.iter_mut().skip(at).take(4).for_each(|b| *b = 0xff);
            take(&large);
        }
    }
    let grown = peak_kib().saturating_sub(before);
    println!("{reader}: {runs} runs, {refused} refused, {grown} KiB more");
    assert!(refused > 0 && grown < MAX_KIB, "{reader}: {grown} KiB");
}

#[test]
fn nifti() {
    replay("nifti", |b| {
        files::nifti::read(b, files::Sink::labels(&files::Progress::default())).err()
    });
}

#[test]
fn nrrd() {
    replay("nrrd", |b| {
        files::nrrd::read(b, &|_| Ok(b.to_vec()), files::Sink::labels(&files::Progress::default())).err()
    });
}

#[test]
fn metaimage() {
    replay("metaimage", |b| {
        files::metaimage::read(b, &|_| Ok(b.to_vec()), files::Sink::labels(&files::Progress::default())).err()
    });
}

#[test]
fn structures() {
    replay("structures", |b| {
        files::dicom::read(b)
            .and_then(|o| files::dicom::structures::read(&o, Path::new("")))
            .err()
    });
}

#[test]
fn segmentation() {
    replay("segmentation", |b| files::dicom::segmentation::read(b).err());
}

#[test]
fn plan() {
    replay("plan", |b| {
        files::dicom::read(b).and_then(|o| files::dicom::plan::of(&o)).err()
    });
}

#[test]
fn image() {
    replay("image", |b| {
        files::dicom::read(b).err().or(files::dicom::image_geometry(b).err())
    });
}

#[test]
fn scene() {
    replay("scene", |b| {
        std::str::from_utf8(b)
            .map_err(|e| e.to_string().into())
            .and_then(files::scene::parse)
            .err()
    });
}

/// Guards against a reader that `make fuzz` leaves out.
#[test]
fn every_corpus_has_its_fuzz_target() {
    let names = |folder: &str| {
        let entries = std::fs::read_dir(stylet_test_kit::repository(folder)).expect("a folder");
        let mut names: Vec<_> = entries
            .map(|e| e.expect("an entry").path())
            .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
            .collect();
        names.sort();
        names
    };
    let text = |file: &str| std::fs::read_to_string(stylet_test_kit::repository(file)).expect("a file");
    let corpora = names("tests/files/corpus");
    assert_eq!(corpora, names("host-ui/fuzz/targets"));
    let (manifest, script) = (text("host-ui/fuzz/Cargo.toml"), text("docs/tools/fuzz"));
    let run = script.split_once("${@:-").and_then(|(_, rest)| rest.split_once('}'));
    let run: Vec<_> = run.expect("the readers by default").0.split(' ').collect();
    for name in &corpora {
        assert!(
            manifest.contains(&format!("\"targets/{name}.rs\"")),
            "{name} is not built"
        );
        assert!(run.contains(&name.as_str()), "{name} is not run");
    }
}
