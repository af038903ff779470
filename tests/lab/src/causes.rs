//! Every injected cause is named, and no other.

use crate::inject::{ALL, Injection, NAME, Target};
use crate::sweep;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use stylet_test_kit::{program, scratch};

/// Injections of ten that must be named.
const AT_LEAST: usize = 8;

/// Returns why tracing is unavailable here; the tests then report it and end.
fn no_trace() -> Option<String> {
    // SAFETY: no preconditions.
    if unsafe { libc::geteuid() } != 0 {
        return Some("not root".to_owned());
    }
    let known = std::fs::read_to_string("/proc/filesystems").unwrap_or_default();
    (!known.contains("tracefs")).then(|| "this kernel has no tracefs".to_owned())
}

fn start(out: &Path, seconds: u32, over_us: u64) -> Child {
    Command::new(program("rt-core"))
        .args(["latency", "--rt-if-allowed", "--trace", "--rounds", "0"])
        .args(["--duration", &format!("{seconds}s")])
        .args(["--trace-over-us", &over_us.to_string()])
        .arg("--out")
        .arg(out)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("rt-core starts")
}

/// Name of the force loop's thread.
const FORCE: &str = "haptic";
/// Name of the thread that watches its core before it starts.
const NOISE: &str = "noise";

/// Returns the measurement, once a thread of that name runs on the force loop's core.
fn target(child: &Child, name: &str) -> Target {
    let process = child.id() as i32;
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(20) {
        for task in std::fs::read_dir(format!("/proc/{process}/task"))
            .into_iter()
            .flatten()
            .flatten()
        {
            let found = std::fs::read_to_string(task.path().join("comm")).unwrap_or_default();
            if found.trim() == name {
                let thread = task.file_name().to_string_lossy().parse().expect("a number");
                let status = std::fs::read_to_string(task.path().join("status")).unwrap_or_default();
                let core = status
                    .lines()
                    .find_map(|l| l.strip_prefix("Cpus_allowed_list:")?.trim().parse().ok());
                if let Some(core) = core {
                    return Target { process, thread, core };
                }
            }
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("no thread {name} started");
}

fn outliers(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("report.json")).expect("rt-core wrote its report");
    let report: Value = serde_json::from_str(&text).expect("the report is JSON");
    let trace = &report["trace"];
    assert!(trace["absent"].is_null(), "{}", trace["absent"]);
    trace["outliers"].as_array().expect("a list").clone()
}

fn folder(name: &str) -> PathBuf {
    scratch(&format!(
        "lab-causes-{}",
        name.replace(|c: char| !c.is_ascii_alphanumeric(), "-")
    ))
}

/// Returns whether no instance of an ended measurement is left in the kernel.
fn instances_left(process: i32) -> bool {
    let mounts = std::fs::read_to_string("/proc/mounts").unwrap_or_default();
    let path = mounts
        .lines()
        .find_map(|l| l.split(' ').nth(1).filter(|_| l.contains(" tracefs ")));
    path.is_some_and(|p| Path::new(p).join(format!("instances/stylet-{process}")).exists())
}

/// Returns `Ok(true)` if at least two late ticks have the injected cause as their first one; and the report's text for
/// them.
fn run(injection: &Injection) -> Result<(bool, String), String> {
    let out = folder(injection.name);
    let mut child = start(&out, 4, injection.over_us);
    let target = target(&child, FORCE);
    std::thread::sleep(Duration::from_millis(1_200));
    let injected = (injection.run)(target, Instant::now() + Duration::from_millis(2_500));
    child.wait().expect("ours");
    injected?;
    let outliers = outliers(&out);
    let is_named = |o: &&Value| o["causes"].get(0).is_some_and(injection.is_named);
    let named = outliers.iter().filter(is_named).count();
    let example = outliers.iter().find(is_named).or(outliers.first());
    let example = example.map_or("no late tick".to_owned(), |o| o["cause"].to_string());
    assert!(!instances_left(target.process));
    Ok((
        named >= 2,
        format!("{named} of {} late ticks: {example}", outliers.len()),
    ))
}

/// Measures without an injection.
fn undisturbed(seconds: u32) {
    let out = folder("undisturbed");
    let mut child = start(&out, seconds, 100);
    child.wait().expect("ours");
    for outlier in &outliers(&out) {
        // The first cause counts, as for an injection.
        if let Some(cause) = outlier["causes"].get(0) {
            let who = cause["who"].as_str().expect("a name");
            let kind = cause["kind"].as_str().expect("a kind");
            let injected = ["stopped", "throttled", "lost-priority", "same-priority", "timers"];
            assert!(
                !who.starts_with(NAME) && !injected.contains(&kind),
                "{}",
                outlier["cause"]
            );
        }
    }
}

/// `make causes`.
#[test]
#[ignore = "depends on what else the machine does; run by `make causes`"]
fn three_injected_causes_are_named_and_none_where_nothing_was_injected() {
    if let Some(why) = no_trace() {
        eprintln!("skipped: {why}");
        return;
    }
    undisturbed(2);
    for injection in &ALL[..3] {
        let (is_named, said) = run(injection).expect("root is all that it needs");
        assert!(is_named, "{}: {said}", injection.name);
    }
}

/// `make causes`.
#[test]
#[ignore = "a minute; run by `make causes`"]
fn eight_of_ten_injected_causes_are_named() {
    if let Some(why) = no_trace() {
        eprintln!("skipped: {why}");
        return;
    }
    undisturbed(8);
    let mut named = 0;
    for injection in ALL {
        let (is_named, said) = run(injection).unwrap_or_else(|why| (false, format!("not injected: {why}")));
        named += usize::from(is_named);
        eprintln!(
            "{:<6} {:<52} {said}",
            if is_named { "named" } else { "MISSED" },
            injection.name
        );
    }
    assert!(named >= AT_LEAST, "{named} of {} were named", ALL.len());
}

/// Measures without a trace, and injects while a thread of that name is on the force loop's core; returns the report.
fn untraced(name: &str, thread: &str, inject: Option<&Injection>) -> Value {
    let out = folder(name);
    let mut child = Command::new(program("rt-core"))
        .args(["latency", "--duration", "5s", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .spawn()
        .expect("rt-core starts");
    let target = target(&child, thread);
    let [after_ms, for_ms] = if thread == NOISE { [0, 1_800] } else { [1_500, 3_000] };
    std::thread::sleep(Duration::from_millis(after_ms));
    if let Some(injection) = inject {
        (injection.run)(target, Instant::now() + Duration::from_millis(for_ms)).expect("root is all that it needs");
    }
    child.wait().expect("ours");
    let text = std::fs::read_to_string(out.join("report.json")).expect("rt-core wrote its report");
    serde_json::from_str(&text).expect("the report is JSON")
}

/// Returns the causes of the latest wake-ups within the injection, which begins a second after the warm-up.
fn causes(report: &Value) -> Vec<String> {
    let late = report["latest_wake_ups"].as_array().expect("a list");
    let read = |l: &Value| Some((l["at_s"].as_f64()?, l["cause"].as_str()?.to_owned()));
    let within = late
        .iter()
        .filter_map(read)
        .filter(|(at_s, _)| (1.3..3.7).contains(at_s));
    within.map(|(_, cause)| cause).collect()
}

/// `make causes`.
#[test]
#[ignore = "depends on what else the machine does; run by `make causes`"]
fn a_thread_of_higher_priority_is_named_without_a_trace() {
    let is_named = |cause: &&String| cause.contains("of real-time priority");
    let quiet = untraced("quiet", FORCE, None);
    assert_eq!(causes(&quiet).iter().filter(is_named).count(), 0, "{quiet}");
    let disturbed = causes(&untraced("rival", FORCE, Some(&ALL[0])));
    let named = disturbed.iter().filter(is_named).count();
    println!("{named} of {} named: {:?}", disturbed.len(), disturbed.first());
    assert!(10 * named >= 9 * disturbed.len(), "{disturbed:?}");
}

/// `make causes`.
#[test]
#[ignore = "depends on what else the machine does; run by `make causes`"]
fn noise_of_a_thread_of_higher_priority_is_named_without_a_trace() {
    let is_named = |gap: &&Value| {
        gap["cause"]
            .as_str()
            .is_some_and(|cause| cause.starts_with("inj-higher"))
    };
    let named = |report: &Value| {
        let gaps = report["noise"]["longest"].as_array().expect("a list");
        (gaps.iter().filter(is_named).count(), gaps.len())
    };
    let quiet = untraced("quiet-core", FORCE, None);
    assert_eq!(named(&quiet).0, 0, "{}", quiet["noise"]);
    let noisy = untraced("noise", NOISE, Some(&ALL[0]));
    println!("{:?} gaps named: {}", named(&noisy), noisy["noise"]["longest"][0]);
    assert!(named(&noisy).0 >= 4, "{}", noisy["noise"]);
    let longest_us = noisy["noise"]["worst_switched_us"].as_f64();
    assert!(longest_us > Some(1_300.0), "{}", noisy["noise"]);
}

/// Measures for five seconds without a trace while `beside` runs; returns what else ran, and the process number of
/// `beside`.
fn others(name: &str, beside: Option<Command>) -> (Value, u32) {
    let out = folder(name);
    let mut running = beside.map(|mut c| c.spawn().expect("it starts"));
    let id = running.as_ref().map_or(0, Child::id);
    let mut child = Command::new(program("rt-core"))
        .args(["latency", "--duration", "5s", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("rt-core starts");
    child.wait().expect("ours");
    if let Some(other) = &mut running {
        other.kill().expect("ours");
        other.wait().expect("ours");
    }
    let text = std::fs::read_to_string(out.join("report.json")).expect("rt-core wrote its report");
    let report: Value = serde_json::from_str(&text).expect("the report is JSON");
    (report["others"].clone(), id)
}

/// `make causes`.
#[test]
#[ignore = "depends on what else the machine does; run by `make causes`"]
fn a_second_core_and_a_busy_pc_are_named_without_a_trace() {
    let lists = |all: &Value, name: &str| {
        let found = all["threads"].as_array().expect("a list");
        found.iter().any(|t| t["name"] == name)
    };
    let (quiet, _) = others("alone", None);
    assert!(!lists(&quiet, "inj-busy"), "{quiet}");
    let mut second = Command::new(program("rt-core"));
    let name = format!("causes-{}", std::process::id());
    second
        .args(["--instance", &name])
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let (second_core, id) = others("second-core", Some(second));
    let instances = second_core["instances"].as_array().expect("a list");
    assert!(
        instances.iter().any(|i| *i == format!("rt-core ({id})")),
        "{second_core}"
    );
    let mut busy = Command::new("sh");
    busy.args(["-c", "printf inj-busy > /proc/$$/comm; while :; do :; done"]);
    let (busy_pc, _) = others("busy", Some(busy));
    let taken = busy_pc["cores_taken"].as_f64();
    assert!(lists(&busy_pc, "inj-busy") && taken > Some(0.1), "{busy_pc}");
}

/// SIGKILL in the middle: the keeper removes the instance.
#[test]
fn a_killed_measurement_leaves_no_trace_instance() {
    if let Some(why) = no_trace() {
        eprintln!("skipped: {why}");
        return;
    }
    let out = folder("killed");
    let mut child = start(&out, 20, 1_000);
    let target = target(&child, FORCE);
    let keeper = format!("trace-keeper\0stylet-{}", target.process);
    let is_kept = || {
        let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
        let mut lines = all.filter_map(|p| std::fs::read_to_string(p.path().join("cmdline")).ok());
        lines.any(|l| l.contains(&keeper))
    };
    assert!(is_kept(), "no keeper");
    child.kill().expect("ours");
    child.wait().expect("ours");
    let begin = Instant::now();
    while is_kept() {
        assert!(begin.elapsed() < Duration::from_secs(10), "the keeper did not end");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(!instances_left(target.process));
    sweep(target.process as u32);
}
