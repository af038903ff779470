//! A campaign that is killed three times ends as one report in which every second counts exactly once.

use crate::sweep;
use serde_json::Value;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use stylet_test_kit::{program, scratch};

/// Two parts of six seconds, with a checkpoint each second.
const FILE: &str = "name = \"killed\"\nwindow = \"2s\"\ncheckpoint = \"1s\"\n\
    [[part]]\nduration = \"6s\"\n[[part]]\nload = \"io\"\nrate = 2000\nduration = \"6s\"\n";

fn start(file: &Path, out: &Path) -> Child {
    Command::new(program("rt-core"))
        .args(["campaign", "--rt-if-allowed", "--out"])
        .arg(out)
        .arg(file)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("rt-core starts")
}

/// Seconds measured so far, by the checkpoints of the force loop.
fn measured_s(out: &Path) -> f64 {
    let files = std::fs::read_dir(out).into_iter().flatten().flatten();
    let files = files.filter(|f| f.file_name().to_string_lossy().ends_with("-force.json"));
    let of = |path: std::path::PathBuf| {
        let record: Value = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
        record["measured_ns"].as_f64()
    };
    files.filter_map(|f| of(f.path())).sum::<f64>() / 1e9
}

/// Kills the process after that progress; its loads follow their parent and end too.
fn kill_after_progress(file: &Path, out: &Path, seconds: f64) {
    let before = measured_s(out);
    let mut child = start(file, out);
    let begin = Instant::now();
    while measured_s(out) < before + seconds {
        assert!(
            begin.elapsed() < Duration::from_secs(40),
            "no checkpoint: {} s",
            measured_s(out)
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    child.kill().expect("ours");
    child.wait().expect("ours");
    sweep(child.id());
}

#[test]
fn a_campaign_killed_three_times_counts_no_second_twice() {
    let folder = scratch("lab-campaign");
    let (file, out) = (folder.join("night.toml"), folder.join("out"));
    std::fs::write(&file, FILE).expect("written");
    // Twice in the first part, then in the second.
    for seconds in [0.9, 1.9, 3.9] {
        kill_after_progress(&file, &out, seconds);
    }
    let killed_at = measured_s(&out);
    assert!((6.0..12.0).contains(&killed_at), "{killed_at} s before the last start");
    let status = start(&file, &out).wait().expect("ours");
    let text = std::fs::read_to_string(out.join("campaign.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(report["complete"], true);
    let verdict = match report["verdict"].as_str() {
        Some("PASS") => 0,
        Some("FAIL") => 1,
        _ => 2,
    };
    assert_eq!(status.code(), Some(verdict), "the exit code is the verdict");
    let verified = Command::new(program("rt-core"))
        .arg("verify")
        .arg(&out)
        .output()
        .expect("rt-core starts");
    assert_eq!(
        verified.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&verified.stdout)
    );
    let total = report["measured_s"].as_f64().expect("a time");
    // A part may end half a second early, and a loop some ticks late.
    assert!((11.0..12.3).contains(&total), "{total} s of 12");
    let parts = report["parts"].as_array().expect("a list");
    assert_eq!(parts.len(), 2);
    let mut sessions = 0;
    for (part, rate) in parts.iter().zip([1_000.0, 2_000.0]) {
        sessions += part["sessions"].as_u64().expect("a count");
        let force = &part["force"];
        let points = force["ticks"].as_f64().expect("a count") + force["missed_deadlines"].as_f64().expect("a count");
        let measured = part["measured_s"].as_f64().expect("a time");
        // Each grid point was either served or missed, once. Points missed between the last tick of a session and its
        // end, and those before its first, are at most a few.
        assert!(
            (points - measured * rate).abs() <= 0.02 * measured * rate,
            "{points} of {measured} s at {rate} Hz"
        );
        let windows = part["maxima"].as_array().expect("a list");
        let in_windows: f64 = windows.iter().map(|w| w["ticks"].as_f64().expect("a count")).sum();
        assert_eq!(Some(in_windows), force["ticks"].as_f64());
    }
    assert!(sessions >= 4, "{sessions} sessions");
    // The sessions do not overlap in time.
    let mut times: Vec<(u64, u64)> = Vec::new();
    for s in report["sessions"].as_array().expect("a list") {
        let record: Value = serde_json::from_str(
            &std::fs::read_to_string(out.join(s["file"].as_str().expect("a name"))).expect("there"),
        )
        .expect("JSON");
        let number = |key: &str| record[key].as_u64().expect("a number");
        times.push((number("first_due_ns"), number("first_due_ns") + number("measured_ns")));
    }
    times.sort_unstable();
    assert!(times.windows(2).all(|w| w[0].1 <= w[1].0), "{times:?}");
    assert!(
        std::fs::read_to_string(out.join("campaign.html"))
            .expect("a page")
            .contains("<svg")
    );
    // Once complete, it measures nothing more; another file for the same folder is refused.
    assert_eq!(start(&file, &out).wait().expect("ours").code(), Some(verdict));
    let again: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("campaign.json")).expect("a report")).expect("JSON");
    assert_eq!(
        (&again["measured_s"], &again["sessions"]),
        (&report["measured_s"], &report["sessions"])
    );
    std::fs::write(&file, FILE.replace("6s", "7s")).expect("written");
    assert_eq!(start(&file, &out).wait().expect("ours").code(), Some(1));
}
