//! The latency laboratory in use: report, verdict in the exit code, an altered report, a second rate.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use stylet_tests::{program, scratch};

/// Runs `rt-core latency` for two seconds into `out`. Without real-time rights it measures all the same.
fn latency(out: &Path, more: &[&str]) -> Output {
    Command::new(program("rt-core"))
        .args(["latency", "--duration", "2s", "--rt-if-allowed", "--out"])
        .arg(out)
        .args(more)
        .output()
        .expect("rt-core starts")
}

fn read(out: &Path) -> Value {
    let text = std::fs::read_to_string(out.join("report.json")).expect("rt-core wrote its report");
    serde_json::from_str(&text).expect("the report is JSON")
}

fn verify(out: &Path) -> (Option<i32>, String) {
    let output = Command::new(program("rt-core"))
        .arg("verify")
        .arg(out)
        .output()
        .expect("rt-core starts");
    (
        output.status.code(),
        String::from_utf8_lossy(&output.stdout).into_owned(),
    )
}

fn times<'a>(report: &'a Value, section: &str, name: &str) -> &'a Value {
    let all = report[section]["times"].as_array().expect("a list");
    all.iter()
        .find(|t| t["name"] == name)
        .unwrap_or_else(|| panic!("no {name} in {section}"))
}

fn outcome<'a>(report: &'a Value, limit: &str) -> &'a Value {
    let all = report["verdict"]["limits"].as_array().expect("a list");
    &all.iter()
        .find(|l| l["name"] == limit)
        .unwrap_or_else(|| panic!("no limit {limit}"))["outcome"]
}

#[test]
fn report_holds_the_whole_path_and_the_loops_stayed_clean() {
    let out = scratch("lab-report");
    let output = latency(&out, &["--load", "ui"]);
    let report = read(&out);
    assert_eq!(report["schema"], "stylet.latency/2");
    // Every part of the path was measured: device, law, tissue, host.
    for (section, name) in [
        ("haptic", "wake-up"),
        ("haptic", "device read to force written"),
        ("tissue", "tip moved to response published"),
        ("host", "tip moved to host saw it"),
    ] {
        let t = times(&report, section, name);
        assert!(t["count"].as_u64().expect("a count") > 100, "{section} {name}: {t}");
        assert!(t["max_us"].as_f64() >= t["min_us"].as_f64(), "{t}");
    }
    // No stage of a tick took longer than the longest tick.
    let whole_us = times(&report, "haptic", "whole tick")["max_us"]
        .as_f64()
        .expect("measured");
    for stage in ["orders", "device read", "force chain", "write", "publish and record"] {
        let us = times(&report, "haptic", stage)["max_us"].as_f64().expect("measured");
        assert!(us <= whole_us * 1.002, "{stage} {us} us in a tick of {whole_us} us");
    }
    for section in ["haptic", "tissue"] {
        let counts = &report[section]["counts"];
        assert_eq!(counts["heap_calls"], 0, "{section}: {counts}");
        assert_eq!(counts["voluntary_switches_beyond_sleep"], 0, "{section}: {counts}");
        assert_eq!(counts["unmeasured"], 0, "{section}: {counts}");
    }
    assert_eq!(report["host"]["records_missing"], 0);
    // 1500 ticks are too few for p99.99; the report states the length that it needs.
    let p9999 = &times(&report, "haptic", "wake-up")["quantiles"][4];
    assert_eq!((&p9999["us"], &p9999["needs_s"]), (&Value::Null, &Value::from(100.0)));
    // The exit code is the verdict.
    let code = match report["verdict"]["overall"].as_str() {
        Some("PASS") => 0,
        Some("FAIL") => 1,
        _ => 2,
    };
    assert_eq!(output.status.code(), Some(code));
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.matches("<svg").count() >= 6 && !page.contains("http-equiv") && !page.contains("<script"));
    let raw = std::fs::read_to_string(out.join("histograms.hlog")).expect("raw histograms");
    assert!(raw.contains("Tag=haptic/wake,") && raw.contains("Tag=tissue/constraints,"));
    assert!(!out.join("load-0.tmp").exists(), "the load left its file");
}

#[test]
fn limits_set_the_exit_code_and_an_inconclusive_tail_is_not_judged() {
    let out = scratch("lab-limits");
    let output = latency(&out, &["--limit", "wake_p50_us=0", "--limit", "jitter_p99_us=1e9"]);
    assert_eq!(
        output.status.code(),
        Some(1),
        "{}",
        String::from_utf8_lossy(&output.stdout)
    );
    let report = read(&out);
    assert_eq!(*outcome(&report, "wake_p50_us"), "FAIL");
    assert_eq!(*outcome(&report, "jitter_p99_us"), "PASS");
    if report["environment"]["qualified"] == false {
        for tail in ["wake_p999_us", "wake_max_us", "missed_deadlines"] {
            let judged = ["PASS", "FAIL"].iter().any(|o| outcome(&report, tail) == *o);
            assert!(!judged, "{tail}: {}", outcome(&report, tail));
        }
        let evidence = report["environment"]["evidence"].as_array().expect("a list");
        assert!(
            evidence
                .iter()
                .any(|e| e.as_str().is_some_and(|e| e.contains("gap watch")))
        );
    }
    let unknown = latency(&out, &["--limit", "wake_p5_us=1"]);
    assert_eq!(unknown.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("the limits are: wake_p50_us"));
}

#[test]
fn changed_report_is_found() {
    let out = scratch("lab-verify");
    latency(&out, &[]);
    let (code, said) = verify(&out);
    assert_eq!((code, said.contains("unaltered")), (Some(0), true), "{said}");
    let json = out.join("report.json");
    let text = std::fs::read_to_string(&json).expect("a report");
    std::fs::write(&json, text.replacen("\"limit\": 50.0", "\"limit\": 90.0", 1)).expect("written");
    let (code, said) = verify(&json);
    assert_eq!(
        (code, said.contains("report.json: tampered")),
        (Some(1), true),
        "{said}"
    );
    std::fs::write(&json, text).expect("written");
    // A report is never overwritten.
    let again = latency(&out, &[]);
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("is not overwritten"));
    let page = out.join("report.html");
    let changed = std::fs::read_to_string(&page)
        .expect("a page")
        .replacen("insertions", "inserti0ns", 1);
    std::fs::write(&page, changed).expect("written");
    let (code, said) = verify(&out);
    assert_eq!(
        (code, said.contains("report.html: tampered")),
        (Some(1), true),
        "{said}"
    );
}

#[test]
fn the_same_loops_run_at_five_kilohertz() {
    let out = scratch("lab-rate");
    latency(&out, &["--rate", "5000", "--spin-us", "20"]);
    let report = read(&out);
    let counts = &report["haptic"]["counts"];
    let (ticks, missed) = (
        counts["ticks"].as_u64().expect("a count"),
        counts["missed_deadlines"].as_u64().expect("a count"),
    );
    let seconds = |name: &str| report["protocol"][name].as_f64().expect("a time");
    let measured_s = seconds("measured_s");
    let grid = ((measured_s + seconds("warm_up_s")) * 5_000.0).round() as u64;
    // Every point of the 5 kHz grid was either served or counted as missed. The warm-up ends after that many ticks,
    // including missed ones.
    assert!(
        (grid..=grid + grid / 10).contains(&(ticks + missed)),
        "{ticks} ticks and {missed} missed of {grid}"
    );
    assert!(measured_s >= 1.98, "{measured_s} s of 2");
    assert!(ticks > 1_000, "{ticks} ticks");
    let refused = latency(&out, &["--rate", "5000", "--spin-us", "199"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("at most"));
}

#[test]
fn comparison_with_cyclictest_says_when_it_is_not_installed() {
    let out = scratch("lab-compare");
    // A search path without it, whether or not this machine has it.
    let output = Command::new(program("rt-core"))
        .args([
            "latency",
            "--duration",
            "2s",
            "--rt-if-allowed",
            "--compare",
            "--rounds",
            "1",
            "--out",
        ])
        .arg(&out)
        .env("PATH", "/nonexistent")
        .output()
        .expect("rt-core starts");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("rt-tests"), "{said}");
    assert!(!out.join("report.json").exists(), "nothing was measured");
}

#[test]
fn doctor_reports_the_same_in_words_and_in_json() {
    let doctor = |more: &[&str]| {
        let output = Command::new(program("rt-core"))
            .arg("doctor")
            .args(more)
            .output()
            .expect("rt-core starts");
        (
            output.status.code(),
            String::from_utf8_lossy(&output.stdout).into_owned(),
        )
    };
    let (code, words) = doctor(&[]);
    let (json_code, text) = doctor(&["--json"]);
    let json: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(code, json_code);
    assert!(words.contains(json["verdict"].as_str().expect("a verdict")));
    let findings = json["findings"].as_array().expect("a list");
    let blocked = findings.iter().any(|f| f["severity"] == "blocker");
    assert_eq!(code, Some(i32::from(blocked)));
    // The kernel's own data, read another way.
    let virtual_machine = std::fs::read_to_string("/proc/cpuinfo")
        .expect("readable")
        .contains(" hypervisor");
    let finding = findings.iter().find(|f| f["check"] == "hypervisor").expect("checked");
    if virtual_machine {
        assert_eq!(finding["severity"], "blocker", "{finding}");
    }
}
