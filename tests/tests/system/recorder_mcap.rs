//! `host-ui record`: no tick is lost with the window open, other programs can read the file, and the hand can be
//! replayed.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;
use stylet_tests::hand::Insertion;
use stylet_tests::window_process::Window;
use stylet_tests::witness::where_the_machine_runs;
use stylet_tests::{Core, program, scratch, until};

/// Duration of the recording; `STYLET_RECORD_S` makes it longer for a figure.
fn seconds() -> f64 {
    std::env::var("STYLET_RECORD_S")
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(15.0)
}

fn host(arguments: &[&str]) -> Output {
    Command::new(program("host-ui"))
        .args(arguments)
        .output()
        .expect("host-ui runs")
}

fn text(output: &Output) -> String {
    format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// Returns the MCAP project's own reader for Python, in a virtual environment that is made once.
fn independent_reader() -> Result<PathBuf, String> {
    let folder = program("rt-core").with_file_name("test-out").join("mcap-reader");
    let python = folder.join("bin/python");
    let works = || {
        let status = Command::new(&python)
            .args(["-c", "import mcap, zstandard"])
            .stderr(Stdio::null())
            .status();
        status.is_ok_and(|s| s.success())
    };
    if !works() {
        let made = Command::new("python3")
            .args(["-m", "venv"])
            .arg(&folder)
            .output()
            .map_err(|e| e.to_string())?;
        let put = Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "mcap==1.2.2"])
            .output();
        if !works() {
            return Err(format!(
                "{}{}",
                text(&made),
                put.map_or_else(|e| e.to_string(), |o| text(&o))
            ));
        }
    }
    Ok(python)
}

const READ: &str = r#"
import json, math, sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file)
    ticks, topics, gaps = [], {}, 0
    for schema, channel, message in reader.iter_messages():
        topics[channel.topic] = topics.get(channel.topic, 0) + 1
        data = json.loads(message.data)
        assert schema.encoding == "jsonschema" and json.loads(schema.data)["title"] == schema.name
        known = json.loads(schema.data).get("properties")
        # What a window needs beside what moves is described in words alone.
        assert known or schema.name in ("stylet.Plan", "stylet.Parameters", "stylet.State", "stylet.Session", "stylet.Scene", "stylet.Field")
        assert not known or set(data) == set(known), (schema.name, set(data))
        if channel.topic == "/stylet/tick":
            ticks.append(data["tick"])
            assert all(math.isfinite(f) for f in data["force_on_hand_n"])
    ticks.sort()
    missing = sum(b - a - 1 for a, b in zip(ticks, ticks[1:]))
    totals = [m.metadata for m in reader.iter_metadata() if m.name == "stylet.totals"][0]
    print(json.dumps({"topics": topics, "missing": missing, "totals": totals}))
"#;

fn record(core: &Core, out: &Path, duration_s: f64) -> Child {
    Command::new(program("host-ui"))
        .args([
            "record",
            "--instance",
            core.instance.name(),
            "--duration",
            &duration_s.to_string(),
            "--out",
        ])
        .arg(out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("host-ui starts")
}

/// The core sent a batch every 2 ms into a queue of 64: a recorder that was delayed by 0.2 s lost ticks.
#[test]
fn a_recorder_that_stalls_for_ten_seconds_loses_no_tick() {
    where_the_machine_runs(|| {
        let file = scratch("recording-stalled").join("session.mcap");
        let mut core = Core::start_with(&["--no-rt"]);
        drop(core.host());
        let recorder = record(&core, &file, 14.0);
        std::thread::sleep(Duration::from_secs(2));
        let id = recorder.id() as libc::pid_t;
        // SAFETY: signals to a child of ours that was not waited for.
        unsafe { libc::kill(id, libc::SIGSTOP) };
        std::thread::sleep(Duration::from_secs(10));
        // SAFETY: as above.
        unsafe { libc::kill(id, libc::SIGCONT) };
        let output = recorder.wait_with_output().expect("ours");
        println!("{}", text(&output));
        assert!(output.status.success(), "ticks were lost");
        let recording = stylet_host::record::read(&file).expect("readable");
        assert_eq!(recording.gaps.missing(), 0);
        let [first, last] = [recording.ticks.first(), recording.ticks.last()].map(|t| t.expect("ticks").due_ns);
        assert!(last - first > 10_500_000_000, "the stall is part of the recording");
        // The queue holds no snapshots of that time, and the recorder says so.
        assert!(!text(&output).contains("in 0 gaps; "), "{}", text(&output));
    });
}

#[test]
fn a_recording_with_the_window_open_loses_no_tick_and_others_read_it() {
    where_the_machine_runs(|| {
        let folder = scratch("recording");
        let file = folder.join("session.mcap");
        let mut core = Core::start();
        let window = Window::open(&core);
        let mut hand = Insertion::begin(&mut core, 0.005);
        let recorder = record(&core, &file, seconds());
        hand.watch(Duration::from_secs_f64(seconds() + 1.0));
        let output = recorder.wait_with_output().expect("ours");
        println!("{}", text(&output));
        assert!(output.status.success(), "ticks were lost");
        drop(window);

        // This program reads what the host saw.
        let recording = stylet_host::record::read(&file).expect("readable");
        // If the machine takes the core away there are fewer ticks to record, and the records count those missed.
        let served = recording.ticks.len();
        let missed: u64 = recording.ticks.iter().map(|t| u64::from(t.missed)).sum();
        assert!(
            served as f64 + missed as f64 > 900.0 * seconds(),
            "{served} ticks, {missed} missed by the loop"
        );
        assert_eq!((recording.gaps.missing(), recording.cut_off), (0, None));
        let mut compared = 0;
        for seen in &hand.records {
            let at = recording.ticks.binary_search_by_key(&seen.tick, |t| t.tick);
            if let Ok(at) = at {
                let tick = &recording.ticks[at];
                assert_eq!(
                    tick.force_on_hand_n.map(f64::to_bits),
                    seen.force_on_hand_n.map(f64::to_bits)
                );
                assert_eq!(
                    tick.tip_in_scene_m.map(f64::to_bits),
                    seen.tip_in_scene_m.map(f64::to_bits)
                );
                compared += 1;
            }
        }
        assert!(
            compared as f64 > 0.9 * served as f64,
            "{compared} of {served} ticks compared"
        );
        let size = std::fs::metadata(&file).expect("there").len() as f64;
        println!("{:.1} kB/s on disk", size / 1e3 / seconds());

        match independent_reader() {
            Err(why) => println!("SKIPPED: no independent reader here (python3, venv and pip are needed): {why}"),
            Ok(python) => {
                let output = Command::new(python)
                    .args(["-c", READ])
                    .arg(&file)
                    .output()
                    .expect("python runs");
                assert!(output.status.success(), "{}", text(&output));
                let read: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
                println!("{read}");
                assert_eq!(read["missing"], 0);
                assert_eq!(read["topics"]["/stylet/tick"], recording.ticks.len());
                assert_eq!(read["totals"]["ticks"], recording.ticks.len().to_string());
                assert!(read["topics"]["/stylet/gland"].as_u64() > Some(50), "{read}");
            }
        }
        drop(hand);
        core.finish();
    });
}

#[test]
fn a_recorded_hand_plays_again_and_the_forces_are_those_of_then() {
    where_the_machine_runs(|| {
        let folder = scratch("replayed");
        let (file, table, motion) = (folder.join("a.mcap"), folder.join("a.csv"), folder.join("a.motion"));
        let mut core = Core::start();
        let mut hand = Insertion::begin(&mut core, 0.02);
        hand.go(0.0, 0.1);
        hand.watch(Duration::from_secs(1));
        let recorder = record(&core, &file, 5.0);
        std::thread::sleep(Duration::from_millis(700));
        hand.go(0.03, 0.02);
        hand.watch(Duration::from_secs(4));
        assert!(recorder.wait_with_output().expect("ours").status.success());
        drop(hand);
        core.finish();

        let [file, table, motion] = [file, table, motion].map(|p| p.display().to_string());
        let output = host(&["export", &file, "--csv", &table, "--motion", &motion]);
        println!("{}", text(&output));
        assert!(output.status.success());
        let rows = std::fs::read_to_string(&table).expect("written");
        let ticks = stylet_host::record::read(Path::new(&file)).expect("readable").ticks;
        assert_eq!(rows.lines().count(), ticks.len() + 1, "one row a tick");

        let mut core = Core::start_with(&["--rt-if-allowed", "--device", &format!("replay:{motion}")]);
        let mut link = core.host();
        stylet_tests::ask(&mut link, &stylet_shm_schema::Request::Engage).expect("engaged");
        let mut played = Vec::new();
        // Missed ticks stretch five seconds of motion.
        let silent = until(Duration::from_secs(30), || {
            link.poll();
            played.append(&mut link.take_records());
            played
                .last()
                .is_some_and(|r| r.fault == stylet_shm_schema::Fault::DeviceSilent as u32)
        });
        let peak = |forces: &mut dyn Iterator<Item = f64>| forces.fold(0.0, f64::max);
        let norm = |f: [f64; 3]| f.iter().map(|x| x * x).sum::<f64>().sqrt();
        let then = peak(&mut ticks.iter().map(|t| norm(t.force_on_hand_n)));
        let now = peak(&mut played.iter().map(|r| norm(r.force_on_hand_n)));
        println!("peak force then {then:.3} N, played {now:.3} N");
        // The tissue loop meets the tip at another of its ticks: up to 5 ms at 20 mm/s are 0.1 mm of depth.
        assert!(
            then > 3.0 && (now - then).abs() < 0.05 * then,
            "{then} N then, {now} N now"
        );
        assert!(silent, "the end is reported as silence");
        drop(link);
        core.finish();
    });
}
