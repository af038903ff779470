//! `host-ui perturb` on the case of `dose_cli`: trials, shifts and criteria.

use crate::dose_cli::{NAMES, case, host, json, run, source};
use std::path::Path;
use std::time::Duration;

#[test]
fn trials_do_not_depend_on_threads_and_zero_error_moves_none() {
    let case = case("perturb-case");
    let trials = |threads: &str, more: &[&str], out: &str| {
        let out = case.folder.join(out);
        let files = [
            ("--source", source()),
            ("--plan", case.folder.join("seeds.csv")),
            ("--structures", case.folder.join("case.nii.gz")),
            ("--out", out.clone()),
        ];
        let arguments = [&["perturb", "--strength-u", "0.5"], NAMES.as_slice(), more].concat();
        let ended = run(host(&arguments, &files).env("RAYON_NUM_THREADS", threads));
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        (
            std::fs::read(out.join("trials.csv")).expect("written"),
            json(&out.join("distribution.json")),
        )
    };
    let (one, spread) = trials("1", &["--trials", "20", "--seed", "5"], "one");
    let (many, _) = trials("3", &["--trials", "20", "--seed", "5"], "many");
    assert!(one == many, "the number of threads shows in the trials");
    let (other, _) = trials("3", &["--trials", "20", "--seed", "6"], "other");
    assert!(one != other);
    let of =
        |spread: &serde_json::Value, name: &str, key: &str| spread["measures"][name][key].as_f64().expect("a number");
    let d90 = "Prostate D90 [gy]";
    // Seeds that miss by 4 mm leave the gland colder, by less than a third.
    let loss = 1.0 - of(&spread, d90, "mean") / of(&spread, d90, "planned");
    println!("D90 loses {:.1} %", loss * 100.0);
    assert!((0.0..0.33).contains(&loss) && of(&spread, d90, "sd") > 0.0);
    assert_eq!(spread["trials"], 20);
    let (_, still) = trials("2", &["--trials", "3", "--sigma-mm", "0"], "still");
    assert!(of(&still, d90, "sd") < 1e-9 && (of(&still, d90, "mean") - of(&still, d90, "planned")).abs() < 1e-9);
    // The planned values from a tenth of the points, against numpy.
    assert!((of(&still, d90, "planned") / case.expected[1] - 1.0).abs() < 5e-3);
    assert!((of(&still, "Prostate V100 [percent]", "planned") - case.expected[2]).abs() < 0.5);
}

/// The effect of a shift on the figures is known from seeds shifted in their file.
#[test]
fn a_shift_scores_as_shifted_seeds_and_criteria_count_trials() {
    let case = case("perturb-shifted");
    let seeds = case.folder.join("seeds.csv");
    let trials = |plan: &Path, out: &str, more: &[&str]| {
        let out = case.folder.join(out);
        let files = [
            ("--source", source()),
            ("--plan", plan.to_path_buf()),
            ("--structures", case.folder.join("case.nii.gz")),
            ("--out", out.clone()),
        ];
        let ended = run(&mut host(
            &[&["perturb", "--strength-u", "0.5"], NAMES.as_slice(), more].concat(),
            &files,
        ));
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        (ended.status.success(), said, out)
    };
    let text = std::fs::read_to_string(&seeds).expect("written");
    let shifted: Vec<String> = text
        .lines()
        .map(
            |line| match line.split(',').map(str::parse::<f64>).collect::<Result<Vec<_>, _>>() {
                Ok(v) => format!("{},{},{},{},{},{}", v[0] + 3.0, v[1], v[2] - 2.0, v[3], v[4], v[5]),
                Err(_) => line.to_owned(),
            },
        )
        .collect();
    let file = case.folder.join("shifted.csv");
    std::fs::write(&file, shifted.join("\n") + "\n").expect("written");
    let still = [
        "--sigma-mm",
        "0",
        "--trials",
        "2",
        "--criterion",
        "D90>=0.1",
        "--criterion",
        "Urethra V150<=-1",
    ];
    let (_, _, by_option) = trials(
        &seeds,
        "by-option",
        &[still.as_slice(), &["--shift-mm", "3,0,-2"]].concat(),
    );
    let (_, _, by_file) = trials(&file, "by-file", &still);
    let (found, expected) = (
        json(&by_option.join("distribution.json")),
        json(&by_file.join("distribution.json")),
    );
    for name in [
        "Prostate D90 [gy]",
        "Prostate V150 [percent]",
        "Urethra D10 [gy]",
        "Rectum D2cc [gy]",
    ] {
        let of = |spread: &serde_json::Value, key: &str| spread["measures"][name][key].as_f64().expect("a number");
        assert!(
            (of(&found, "mean") / of(&expected, "planned") - 1.0).abs() < 1e-3,
            "{name}"
        );
        assert!(
            (of(&found, "mean") - of(&found, "planned")).abs() > 1e-3,
            "{name} does not move"
        );
    }
    let criteria = found["criteria"].as_array().expect("a list");
    let percent: Vec<f64> = criteria.iter().filter_map(|c| c["percent"].as_f64()).collect();
    // Three for the target, two for the urethra, one for the rectum, then those requested.
    assert_eq!((percent.len(), percent[6], percent[7]), (8, 100.0, 0.0));
    let (fine, said, _) = trials(&seeds, "refused", &["--strand-correlation", "1"]);
    assert!(
        !fine && said.contains("40 of 40 seeds") && said.contains("have no needle"),
        "{said}"
    );
}

#[test]
fn ctrl_c_ends_early_and_writes_what_was_done() {
    let case = case("perturb-stopped");
    let out = case.folder.join("out");
    let files = [
        ("--source", source()),
        ("--plan", case.folder.join("seeds.csv")),
        ("--structures", case.folder.join("case.nii.gz")),
        ("--out", out.clone()),
    ];
    let mut command = host(&["perturb", "--strength-u", "0.5", "--trials", "1000000"], &files);
    let child = command
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("host-ui runs");
    // The folder is made when the work begins.
    while !out.exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(3));
    // SAFETY: a signal to a child of ours that has not been waited for.
    assert_eq!(unsafe { libc::kill(child.id() as i32, libc::SIGINT) }, 0);
    let ended = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&ended.stdout).into_owned();
    assert!(ended.status.success() && said.contains("stopped after"), "{said}");
    let lines = std::fs::read_to_string(out.join("trials.csv"))
        .expect("written")
        .lines()
        .count();
    let trials = json(&out.join("distribution.json"))["trials"]
        .as_u64()
        .expect("a number");
    assert!(trials > 0 && lines as u64 == trials + 1);
}
