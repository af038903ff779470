//! Further output of commands, and their reports on implausible seeds and sources.

use std::path::{Path, PathBuf};
use std::process::Command;
use stylet_test_kit::{program, repository, scratch};

fn source() -> PathBuf {
    repository("sources/i125_6711.toml")
}

/// Runs `host-ui dose` on some seeds; returns whether it succeeded, and its output.
fn dose(source: &Path, seeds: &Path, out: &Path, more: &[&str]) -> (bool, String) {
    let ended = Command::new(program("host-ui"))
        .args([
            Path::new("dose"),
            Path::new("--source"),
            source,
            Path::new("--seeds"),
            seeds,
        ])
        .arg("--out")
        .arg(out)
        .args(more)
        .output()
        .expect("host-ui runs");
    (
        ended.status.success(),
        String::from_utf8_lossy(&ended.stderr).into_owned(),
    )
}

/// Results used to be written among those of another plan, and none named its inputs.
#[test]
fn results_go_into_a_folder_of_their_own_and_name_their_inputs() {
    let folder = scratch("results-named");
    let (seeds, out) = (folder.join("seeds.csv"), folder.join("out"));
    std::fs::write(&seeds, "x_mm,y_mm,z_mm,strength_u\n0,0,0,0.5\n").expect("written");
    let (done, said) = dose(&source(), &seeds, &out, &["--spacing-mm", "5"]);
    assert!(done, "{said}");
    let made = std::fs::read_to_string(out.join("made.json")).expect("written");
    let made: serde_json::Value = serde_json::from_str(&made).expect("JSON");
    assert_eq!(made["inputs"][1]["option"], "--seeds");
    let digest = Command::new("sha256sum").arg(&seeds).output().expect("sha256sum runs");
    let found = made["inputs"][1]["sha256"].as_str().expect("a digest");
    assert!(String::from_utf8_lossy(&digest.stdout).starts_with(found) && found.len() == 64);
    assert!(made["version"].is_string() && made["made_at"].is_string(), "{made:#}");
    let before = std::fs::read(out.join("dose_grid.csv")).expect("written");
    let (done, said) = dose(&source(), &seeds, &out, &["--spacing-mm", "4"]);
    assert!(!done && said.contains("holds 2 files already"), "{said}");
    assert_eq!(std::fs::read(out.join("dose_grid.csv")).expect("still there"), before);
}

/// Seeds outside the target or at one position, and an HDR source counted for ever, used to give figures without a
/// warning.
#[test]
fn implausible_seeds_are_reported_and_temporary_sources_need_a_time() {
    let folder = scratch("results-odd");
    let seeds = folder.join("odd.csv");
    let table = "x_mm,y_mm,z_mm,strength_u\n-1,4,38,0.5\n-1,4,38,0.5\n300,0,40,0.5\n";
    std::fs::write(&seeds, table).expect("written");
    let structures = repository("tests/files/data/dicom/structures.dcm");
    let structures = structures.to_string_lossy();
    let more = ["--structures", &structures];
    let (done, said) = dose(&source(), &seeds, &folder.join("a"), &more);
    assert!(done, "{said}");
    assert!(
        said.contains("1 of its 3 seeds lie on the spot of another one"),
        "{said}"
    );
    assert!(
        said.contains("1 of its 3 seeds lie outside Prostate, the farthest by 29"),
        "{said}"
    );
    let text = std::fs::read_to_string(source()).expect("a source");
    let temporary = folder.join("ir192.toml");
    std::fs::write(&temporary, text.replace("I-125", "Ir-192")).expect("written");
    let (done, said) = dose(&temporary, &seeds, &folder.join("b"), &more);
    assert!(
        !done && said.contains("give the time that they stay with --to-days"),
        "{said}"
    );
    let more = [more.as_slice(), &["--to-days", "2"]].concat();
    let (done, said) = dose(&temporary, &seeds, &folder.join("c"), &more);
    assert!(done, "{said}");
}

/// Names of structures used to reach the terminal with their escape sequences.
#[test]
fn names_of_structures_reach_the_terminal_without_control_characters() {
    let folder = scratch("results-escape");
    let labels = folder.join("labels.seg.nrrd");
    let convert = |from: &Path, to: &Path| {
        let ended = Command::new(program("host-ui"))
            .arg("convert")
            .args([from, to])
            .output();
        assert!(ended.expect("host-ui runs").status.success());
    };
    convert(&repository("tests/files/data/dicom/structures.dcm"), &labels);
    let mut bytes = std::fs::read(&labels).expect("written");
    let name = b"Name:=Prostate";
    let at = bytes.windows(name.len()).position(|w| w == name).expect("a name") + name.len();
    bytes.splice(at..at, *b"\x1b[31m");
    std::fs::write(&labels, bytes).expect("written");
    for task in [["scene", "check"].as_slice(), &["convert"]] {
        let to = folder.join("labels.nii.gz");
        let mut command = Command::new(program("host-ui"));
        command.args(task).arg(&labels).args((task.len() == 1).then_some(&to));
        let ended = command.output().expect("host-ui runs");
        let said = [ended.stdout, ended.stderr].concat();
        assert!(ended.status.success() && !said.contains(&0x1b), "{task:?}");
        assert!(String::from_utf8_lossy(&said).contains("Prostate[31m"), "{task:?}");
    }
}
