//! The file of a campaign, its checkpoints, and that nothing counts twice.

use super::chain::{CHAIN, Chain};
use super::plan::Plan;
use super::report::{About, report};
use super::session::{FORCE, Store, TISSUE};
use super::{COPY, CampaignError, Progress, REPORT, check, page, refuse_altered, time, write};
use crate::collect::{LoopTiming, Plan as Gathering};
use crate::load::Load;
use crate::sealed::{self, seal};
use crate::whose::Whose;
use std::path::{Path, PathBuf};
use stylet_runtime::rt::timing::TickTimes;

const FILE: &str = "name = \"night\"\nrepeat = 2\nwindow = \"2s\"\n[[part]]\nduration = \"10s\"\n[[part]]\nload = \"io\"\nrate = 2000\nduration = \"20s\"\n";

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-campaign-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
    folder
}

/// Returns the timing of a loop over `seconds` from `first_ns` on: each tick wakes 10 µs late, the last one 900.
fn gathered(first_ns: u64, seconds: u64) -> LoopTiming {
    let mut timing = LoopTiming::new(
        &[],
        Gathering {
            period_ns: 1_000_000,
            warm_up_ticks: 0,
            window_ns: 2_000_000_000,
            windows: 40,
            grid: seconds * 1_000,
        },
    );
    let (mut into, ring) = rtrb::RingBuffer::new((seconds * 1_000) as usize);
    for i in 0..seconds * 1_000 {
        let due_ns = first_ns + i * 1_000_000;
        let late_ns = if i + 1 == seconds * 1_000 { 900_000 } else { 10_000 };
        let mut tick = TickTimes::default();
        (tick.due_ns, tick.woke_ns) = (due_ns, due_ns + late_ns);
        tick.push_mark(due_ns + late_ns + 5_000);
        into.push(tick).expect("room");
    }
    drop(into);
    timing = timing.gather(ring);
    timing
}

fn about() -> About {
    About::this(Whose::default(), None)
}

fn put(store: &Store, part: usize, first_ns: u64, seconds: u64) {
    let writer = store.begin(part).expect("readable");
    for name in [FORCE, TISSUE] {
        writer.put(name, &gathered(first_ns, seconds), 2_000_000_000);
    }
    writer.ended().expect("written");
}

#[test]
fn the_file_names_its_parts_and_every_problem() {
    let plan = Plan::of(FILE).expect("valid");
    let said: Vec<(Load, u32, u64)> = plan
        .parts
        .iter()
        .map(|p| (p.load, p.rate, p.duration_ns / 1_000_000_000))
        .collect();
    let once = [(Load::None, 1_000, 10), (Load::Io, 2_000, 20)];
    assert_eq!(said, [once, once].concat());
    assert_eq!((plan.window_ns, plan.checkpoint_ns), (2_000_000_000, 60_000_000_000));
    let problems = Plan::of("repeat = 0\n[[part]]\nduration = \"5s\"\nrate = 20\n").expect_err("invalid");
    assert_eq!(problems.0.len(), 2, "{problems:?}");
    let short = Plan::of("[[part]]\nduration = \"5\"\n").expect_err("without a unit");
    assert!(short.to_string().contains("duration"), "{short}");
    assert!(
        Plan::of("[[part]]\nduration = \"5s\"\nlod = \"io\"\n")
            .expect_err("a misspelt key")
            .to_string()
            .contains("lod")
    );
}

#[test]
fn sessions_of_a_part_add_up_and_what_is_left_is_measured() {
    let plan = Plan::of(FILE).expect("valid");
    let out = folder("sum");
    let store = Store { folder: out.clone() };
    let left = |part: usize| store.left_ns(part, &plan.parts[part]).expect("readable") / 1_000_000_000;
    assert_eq!((left(0), left(1)), (10, 20));
    put(&store, 0, 1_000_000_000, 4);
    // A later checkpoint of the same session replaces the one before: it was killed, and began again.
    put(&store, 0, 20_000_000_000, 6);
    put(&store, 1, 40_000_000_000, 20);
    assert_eq!((left(0), left(1), left(2)), (0, 0, 10));
    let progress = Progress::new(&plan, &store, 2, 10_000_000_000).expect("readable");
    assert_eq!(
        progress.line(5.0),
        "part 3 of 4 (none, 1000 Hz): 5s left; campaign 58 %, 25s left"
    );
    let report = report(&plan, &store, about()).expect("disjoint");
    let part = &report.parts[0];
    assert_eq!((part.force.ticks, part.sessions, part.complete), (10_000, 2, true));
    assert!((part.measured_s - 10.0).abs() < 1e-9 && !report.complete);
    assert_eq!(part.maxima.iter().map(|m| u64::from(m.ticks)).sum::<u64>(), 10_000);
    assert_eq!(part.force.wake.max_us.map(|us| (us / 900.0 * 1e3).round()), Some(1e3));
    let page = page::page(&report).expect("drawn");
    assert!(page.contains("night") && page.contains("Not complete") && page.contains("<svg"));
    std::fs::remove_dir_all(out).expect("ours");
}

#[test]
fn two_sessions_of_one_moment_are_refused() {
    let plan = Plan::of(FILE).expect("valid");
    let out = folder("twice");
    let store = Store { folder: out.clone() };
    put(&store, 0, 1_000_000_000, 4);
    put(&store, 1, 4_500_000_000, 4);
    let refused = report(&plan, &store, about()).expect_err("half a second counts twice");
    assert!(
        matches!(&refused, CampaignError::Checkpoint { why, .. } if why.contains("twice")),
        "{refused}"
    );
    // The same times after a restart of the PC are different times.
    let file = out.join("part-001-session-000-force.json");
    for file in [file.clone(), out.join("part-001-session-000-tissue.json")] {
        let mut text: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&file).expect("there")).expect("JSON");
        text["boot"] = "another".into();
        std::fs::write(&file, text.to_string()).expect("written");
    }
    assert!(report(&plan, &store, about()).is_ok());
    std::fs::write(&file, "{\"schema\":").expect("written");
    assert!(matches!(store.records(FORCE), Err(CampaignError::Checkpoint { .. })));
    std::fs::remove_dir_all(out).expect("ours");
}

#[test]
fn times_are_said_in_hours_minutes_or_seconds() {
    assert_eq!([12.4, 250.0, 25_500.0].map(time), ["12s", "4m 10s", "7h 5m"]);
}

/// Makes a finished campaign with a report.
fn finished(name: &str) -> PathBuf {
    let out = folder(name);
    std::fs::write(out.join(COPY), "[[part]]\nduration = \"10s\"\n").expect("written");
    let plan = Plan::of(&std::fs::read_to_string(out.join(COPY)).expect("there")).expect("valid");
    let store = Store { folder: out.clone() };
    put(&store, 0, 1_000_000_000, 4);
    put(&store, 0, 20_000_000_000, 6);
    let mut all = report(&plan, &store, about()).expect("disjoint");
    write(&out, &mut all).expect("written");
    out
}

fn edited(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).expect("there");
    assert!(text.contains(from), "{from}");
    std::fs::write(file, text.replacen(from, to, 1)).expect("written");
}

/// A checkpoint was edited by hand, and the report said 0 missed deadlines.
#[test]
fn an_edited_missing_repeated_or_reordered_part_is_named() {
    let first = "part-000-session-000-force.json";
    let second = "part-000-session-001-force.json";
    type Forgery = (&'static str, fn(&Path, &str, &str), &'static str);
    let forgeries: [Forgery; 9] = [
        (
            "edited ticks",
            |out, first, _| edited(&out.join(first), "\"ticks\":4000", "\"ticks\":4001"),
            first,
        ),
        (
            "edited time",
            |out, first, _| edited(&out.join(first), "\"measured_ns\":4", "\"measured_ns\":5"),
            first,
        ),
        (
            "edited bin",
            |out, _, second| edited(&out.join(second), "\"wake\":[[[", "\"wake\":[[[1,1],["),
            second,
        ),
        (
            "edited",
            |out, first, _| {
                edited(&out.join(first), "\"missed\":0", "\"missed\":9");
            },
            first,
        ),
        (
            "missing",
            |out, first, _| std::fs::remove_file(out.join(first)).expect("there"),
            first,
        ),
        (
            "repeated",
            |out, first, _| {
                std::fs::copy(out.join(first), out.join("part-000-session-002-force.json")).expect("copied");
            },
            "part-000-session-002-force.json",
        ),
        (
            "reordered",
            |out, first, second| {
                let between = out.join("between");
                for (from, to) in [
                    (out.join(first), between.clone()),
                    (out.join(second), out.join(first)),
                    (between, out.join(second)),
                ] {
                    std::fs::rename(from, to).expect("renamed");
                }
            },
            first,
        ),
        (
            "chain cut",
            |out, _, _| {
                let text = std::fs::read_to_string(out.join(CHAIN)).expect("there");
                let rest = text.split_once('\n').expect("a line").1.to_owned();
                std::fs::write(out.join(CHAIN), rest).expect("written");
            },
            "campaign.chain, line 1",
        ),
        (
            "chain moved",
            |out, _, _| {
                let text = std::fs::read_to_string(out.join(CHAIN)).expect("there");
                let mut lines: Vec<&str> = text.lines().collect();
                lines.swap(1, 2);
                std::fs::write(out.join(CHAIN), lines.join("\n") + "\n").expect("written");
            },
            "campaign.chain, line 2",
        ),
    ];
    for (name, forge, named) in forgeries {
        let out = finished(name);
        assert_eq!(check(&out, None).expect("readable").0, Vec::<String>::new(), "{name}");
        forge(&out, first, second);
        let store = Store { folder: out.clone() };
        let refused = refuse_altered(&store).expect_err(name).to_string();
        let (problems, _) = check(&out, None).expect("readable");
        assert!(refused.contains(named), "{name}: {refused}");
        assert!(problems.iter().any(|p| p.starts_with(named)), "{name}: {problems:?}");
        std::fs::remove_dir_all(out).expect("ours");
    }
    // A forger who makes the whole chain anew cannot make the figures agree.
    let out = finished("anew");
    edited(&out.join(REPORT), "\"missed_deadlines\": 0", "\"missed_deadlines\": 9");
    let old: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join(REPORT)).expect("there")).expect("JSON");
    let old = old["sha256"].as_str().expect("a digest");
    let text = std::fs::read_to_string(out.join(REPORT))
        .expect("there")
        .replacen(old, sealed::NO_DIGEST, 1);
    std::fs::write(out.join(REPORT), seal(&text)).expect("written");
    let (problems, _) = check(&out, None).expect("readable");
    assert!(
        problems[0].contains("says \"missed_deadlines\": 9, the raw data give \"missed_deadlines\": 0"),
        "{problems:?}"
    );
    std::fs::remove_dir_all(out).expect("ours");
}

#[test]
fn a_session_killed_between_announcement_and_file_is_settled() {
    let out = finished("killed");
    let store = Store { folder: out.clone() };
    let mut chain = Chain::read(&out).expect("readable");
    chain
        .append("part-000-session-001-force.json", "0123".to_owned())
        .expect("written");
    std::fs::write(
        out.join(CHAIN),
        std::fs::read_to_string(out.join(CHAIN)).expect("there") + "part-000-se",
    )
    .expect("written");
    assert!(refuse_altered(&store).is_err());
    Chain::read(&out).expect("readable").settle().expect("written");
    refuse_altered(&store).expect("settled");
    std::fs::remove_dir_all(out).expect("ours");
}
