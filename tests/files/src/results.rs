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

fn host_ui(words: &[&Path]) -> String {
    let ended = Command::new(program("host-ui"))
        .args(words)
        .output()
        .expect("host-ui runs");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert!(ended.status.success(), "{said}");
    said
}

/// Doses of other programs used to be compared voxel by voxel alone, without the figures that a clinic decides by.
#[test]
fn an_imported_dose_has_the_figures_of_its_seeds() {
    let folder = scratch("results-imported");
    let file = |name: &str| folder.join(name);
    let table = "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,strength_u\n-1,4,36,0,0,1,0.5\n5,4,41,0,0,1,0.5\n-6,8,38,0,0,1,0.45\n2,-2,39,,,,0.45\n";
    std::fs::write(file("seeds.csv"), table).expect("written");
    let (source, drawn) = (source(), repository("tests/files/data/dicom/structures.dcm"));
    let [study, check, alone] = ["study", "check", "alone"].map(file);
    let word = Path::new;
    let of_seeds = [word("--source"), &source, word("--out")];
    let seeds = file("seeds.csv");
    let dicom = [word("dicom"), word("--seeds"), &seeds, word("--structures"), &drawn];
    host_ui(&[&dicom, of_seeds.as_slice(), &[&study]].concat());
    let [set, plan, dose] = ["structure_set.dcm", "plan.dcm", "dose.dcm"].map(|name| study.join(name));
    let evaluated = [word("dose"), word("--structures"), &set, word("--rt-dose")];
    let said = host_ui(
        &[
            &evaluated,
            [&dose, word("--seeds"), &plan].as_slice(),
            &of_seeds,
            &[&check],
        ]
        .concat(),
    );
    assert!(!said.contains("names another file"), "{said}");
    let text = std::fs::read_to_string(check.join("second_check.csv")).expect("written");
    let mut measures = 0;
    for line in text.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [own, imported] = [1, 2].map(|n| fields[n].parse::<f64>().unwrap_or(f64::NAN));
        let bar = if fields[0].ends_with("[gy]") { 0.005 * own } else { 0.3 };
        let units = ["[gy]", "[percent]"];
        let is_measure = units.iter().any(|unit| fields[0].ends_with(unit)) && !fields[1].is_empty();
        assert!(!is_measure || (own - imported).abs() <= bar, "{line}");
        measures += usize::from(is_measure);
    }
    assert!(measures >= 6, "{text}");
    // The same dose in another format, without the seeds.
    let volume = file("dose.nrrd");
    host_ui(&[word("convert"), &dose, &volume]);
    let more = [word("--prescription-gy"), word("145"), word("--out"), &alone];
    host_ui(&[&evaluated, [volume.as_path()].as_slice(), &more].concat());
    let figures = |folder: &Path| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(folder.join("metrics.json")).expect("written")).expect("JSON")
    };
    let (check, alone) = (figures(&check), figures(&alone));
    let d90_gy = |figures: &serde_json::Value| {
        let gy = figures["structures"][0]["metrics"]["D90"]["gy"].as_f64();
        gy.expect("a dose")
    };
    // The places of an NRRD are rounded to the last digits.
    assert!((d90_gy(&check) / d90_gy(&alone) - 1.0).abs() < 1e-9);
    assert!(check["second_check"]["left_out"].is_string() && alone["second_check"].is_null());
    // Another structure set than the one that the dose names.
    let said = host_ui(&[
        word("dose"),
        word("--structures"),
        &drawn,
        word("--rt-dose"),
        &dose,
        word("--prescription-gy"),
        word("145"),
        word("--out"),
        &file("other"),
    ]);
    assert!(said.contains("names another file than"), "{said}");
}
