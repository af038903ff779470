//! A forger who knows the format and computes every digest anew is found out, and nobody else is.

use super::tests::key;
use super::*;
use crate::args::LatencyArgs;
use crate::collect::{LoopTiming, Plan};
use crate::files;
use crate::gaps::GapReport;
use crate::host::HostReport;
use crate::load::Load;
use crate::machine::Machine;
use crate::measure::Measured;
use crate::others::Others;
use crate::paired::Paired;
use crate::raw::Raw;
use crate::report::{FILES, HISTOGRAMS, PAGE, Parts, WAKES, report};
use crate::sample::{Batched, histogram};
use crate::sealed::NO_DIGEST;
use crate::verdict;
use crate::whose::Whose;
use clap::Parser;
use stylet_random::Random;
use stylet_runtime::process::RunReport;
use stylet_runtime::rt::haptic::HAPTIC_STAGES;
use stylet_runtime::rt::timing::TickTimes;
use stylet_runtime::rt::tissue::TISSUE_STAGES;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    args: LatencyArgs,
}

/// Returns the timing of a loop whose ticks are late at random.
fn timing(random: &mut Random, stages: &'static [&'static str], period_ns: u64, ticks: u64) -> LoopTiming {
    let plan = Plan {
        period_ns,
        warm_up_ticks: 0,
        window_ns: 500_000_000,
        windows: 6,
        grid: 3_000_000_000 / period_ns,
    };
    let (mut into, ring) = rtrb::RingBuffer::new(ticks as usize);
    for i in 1..=ticks {
        let mut tick = TickTimes::default();
        tick.due_ns = i * period_ns;
        let mut at = tick.due_ns + 5_000 + random.draw() % 60_000;
        tick.woke_ns = at;
        for _ in stages {
            at += 100 + random.draw() % 3_000;
            tick.push_mark(at);
        }
        (tick.path_ns, tick.output_ns) = (Some(at - tick.woke_ns), Some(at));
        tick.recording_ns = 100 + random.draw() % 100;
        into.push(tick).expect("room");
    }
    drop(into);
    LoopTiming::new(stages, plan).gather(ring)
}

/// Writes a genuine report of 2,400 ticks into a folder of its own.
fn genuine(root: &Path, seed: u64) -> PathBuf {
    let random = &mut Random(seed);
    let folder = root.join(format!("genuine-{seed}"));
    std::fs::create_dir_all(&folder).expect("made");
    let out = folder.display().to_string();
    let args = Command::parse_from(["rt-core", "--duration", "3s", "--no-rt", "--out", &out]).args;
    let options = args.options().expect("valid");
    let mut tip_to_host = Batched::default();
    (0..2_400).for_each(|i| tip_to_host.take(i / 300, 500_000 + random.draw() % 500_000));
    let mut paired = Paired::default();
    (1..=2_400).for_each(|i| paired.take(i * 1_000_000, 5_000 + random.draw() % 60_000, 100_000));
    let mut run = RunReport::default();
    (run.haptic.ticks, run.tissue.ticks) = (2_400, 480);
    let measured = Measured {
        run,
        haptic: timing(random, HAPTIC_STAGES, 1_000_000, 2_400),
        tissue: timing(random, TISSUE_STAGES, 5_000_000, 480),
        second: None,
        host: HostReport {
            tissue_to_host: tip_to_host.clone(),
            tip_to_host,
            snapshots: 1_200,
            records: 2_400,
            records_missing: 0,
            faults: Vec::new(),
            insertions: 1,
        },
        gaps: GapReport {
            core: Some(1),
            watched_ns: 240_000_000,
            gaps: histogram(),
            switched: histogram(),
            wake: histogram(),
            found: Vec::new(),
            found_switched: Vec::new(),
            late: Vec::new(),
        },
        noise: None,
        cores: Vec::new(),
        others: Others::default(),
        paired: Some(paired),
        trace: None,
        window_ns: 500_000_000,
        began_s: jiff::Timestamp::now().as_second() as u64 - 3,
    };
    let raw = Raw::of(&measured, None);
    let parts = Parts {
        options: &options,
        duration_ns: 3_000_000_000,
        load: Load::None,
        limits: &verdict::limits(options.haptic_period_ns, &[]).expect("the defaults"),
        measured: &measured,
        comparison: None,
        machine: &Machine::this(),
        whose: &Whose::default(),
        spin_search: None,
        nonce: None,
    };
    let mut report = report(&parts, &raw);
    report.command = ["rt-core", "latency", "--out", &out].map(str::to_owned).to_vec();
    files::write(&folder, &mut report, &raw).expect("written");
    folder
}

/// The forger's view of a folder.
struct Forged {
    folder: PathBuf,
}

impl Forged {
    fn of(genuine: &Path, name: &str) -> Self {
        let folder = genuine.with_file_name(name);
        std::fs::create_dir_all(&folder).expect("made");
        for entry in std::fs::read_dir(genuine).expect("readable").flatten() {
            std::fs::copy(entry.path(), folder.join(entry.file_name())).expect("copied");
        }
        Self { folder }
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.join(name)).expect("text")
    }

    fn put(&self, name: &str, text: &str) {
        std::fs::write(self.folder.join(name), text).expect("written");
    }

    /// Changes a file that the report lists, and its digest there.
    fn change(&self, name: &str, change: impl FnOnce(String) -> String) {
        let before = self.text(name);
        let after = change(before.clone());
        assert_ne!(before, after, "{name}: not a forgery");
        self.put(name, &after);
        let [old, new] = [before, after].map(|text| sha256(text.as_bytes()));
        self.seal(|json| json.replace(&old, &new));
    }

    /// Changes the report, and its own digest.
    fn seal(&self, change: impl FnOnce(String) -> String) {
        let before = self.text(JSON);
        let old = super::tests::text_digest(&before);
        let bare = change(before).replacen(&old, NO_DIGEST, 1);
        self.put(JSON, &bare.replacen(NO_DIGEST, &sha256(bare.as_bytes()), 1));
    }

    /// Changes the line of the report at `place` among those with `key`.
    fn line(&self, key: &str, place: usize, change: impl Fn(&str) -> String) {
        self.seal(|json| {
            let lines: Vec<&str> = json.lines().collect();
            let with: Vec<usize> = (0..lines.len()).filter(|&i| lines[i].contains(key)).collect();
            let at = with[place % with.len()];
            let all = (0..lines.len()).map(|i| if i == at { change(lines[i]) } else { lines[i].to_owned() } + "\n");
            all.collect()
        });
    }

    fn problems(&self, allowed: Option<&Path>) -> Vec<String> {
        let file = self.folder.join(JSON);
        let text = disk::read(&file).map(|b| String::from_utf8_lossy(&b).into_owned());
        let mut checked = check(&file, &text.expect("a report"), allowed);
        checked
            .problems
            .extend(checked.notes.extract_if(.., |n| n.ends_with(MISSING)));
        checked.problems
    }
}

/// Changes the last digit of a line.
fn other_digit(line: &str) -> String {
    let at = line.rfind(|c: char| c.is_ascii_digit()).expect("a number");
    let digit = (line.as_bytes()[at] - b'0' + 3) % 10;
    format!("{}{digit}{}", &line[..at], &line[at + 1..])
}

fn swap_lines(text: &str, a: usize, b: usize) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    let n = lines.len();
    lines.swap(a % n, b % n);
    lines.join("\n") + "\n"
}

/// Forges the report in one of eight ways that need no signature; `i` is from 0 to 9.
fn forge(kind: &str, forged: &Forged, i: usize, other: &Path) {
    match kind {
        "values" => {
            let keys = [
                "\"us\": ",
                "\"mean_us\"",
                "\"max_us\"",
                "\"missed\"",
                "\"ticks\"",
                "\"value\": ",
                "\"worst_wake_us\"",
                "\"measured_s\"",
                "\"at_most\"",
                "\"k_max_n_per_m\"",
            ];
            let has_digit = |line: &str| {
                if line.contains(|c: char| c.is_ascii_digit()) {
                    other_digit(line)
                } else {
                    line.replace("null", "1.0")
                }
            };
            forged.line(keys[i], 1 + i / 2, has_digit);
        }
        "outcomes" => forged.line("\"outcome\": ", i, |line| {
            if line.contains("PASS") {
                line.replace("PASS", "FAIL")
            } else {
                line.replace("NOT MEASURABLE", "PASS")
                    .replace("OVER THE LIMIT, CAUSE UNDECIDED", "PASS")
                    .replace("FAIL", "PASS")
            }
        }),
        "histograms" => forged.change(HISTOGRAMS, |log| {
            let theirs = std::fs::read_to_string(other.join(HISTOGRAMS)).expect("text");
            let is_data = |l: &&str| l.starts_with("Tag=");
            let lines: Vec<&str> = log.lines().filter(is_data).collect();
            let at = i * 11;
            let replacement = theirs.lines().filter(is_data).nth(at).expect("as many");
            match i % 3 {
                0 => log.replace(lines[at], replacement),
                1 => log.replace(&format!("{}\n", lines[at]), ""),
                _ => log.replace(lines[at], &format!("{0}\n{0}", lines[at])),
            }
        }),
        "computed" => forged.change(FILES[2 + i % 3], |text| {
            let places: Vec<usize> = text
                .match_indices(['<', ',', '"'])
                .map(|(at, _)| at)
                .filter(|&at| at > 0 && text.as_bytes()[at - 1].is_ascii_digit())
                .collect();
            let at = places[i * places.len() / 10];
            format!("{}{}", other_digit(&text[..at]), &text[at..])
        }),
        "order" => match i % 3 {
            0 => forged.change(WAKES, |wakes| swap_lines(&wakes, 100 + i, 700)),
            1 => forged.change(HISTOGRAMS, |log| swap_lines(&log, 10 + i, 20 + i)),
            _ => forged.seal(|json| {
                let at: Vec<usize> = json
                    .match_indices("\"at_s\"")
                    .map(|(at, _)| json[..at].lines().count())
                    .collect();
                swap_lines(&json, at[i % 3], at[i % 3 + 3])
            }),
        },
        "dates" => match i {
            0..5 => forged.line("\"made_at\"", 0, |line| line.replace("202", &format!("2{}2", i + 1))),
            5..8 => forged.change(HISTOGRAMS, |log| {
                let from = log.find("[StartTime: ").expect("a start") + "[StartTime: ".len();
                format!("{}{i}{}", &log[..from], &log[from + 1..])
            }),
            _ => {
                let made = super::schema(&forged.text(JSON)).expect("a report");
                assert!(made.starts_with("stylet"));
                let report: Value = serde_json::from_str(&forged.text(JSON)).expect("JSON");
                let made = report["made_at"].as_str().expect("a date").to_owned();
                let sooner = made.replace("202", "201");
                forged.change(PAGE, |page| page.replace(&made, &sooner));
                forged.seal(|json| json.replace(&made, &sooner));
            }
        },
        "names" => match i {
            0..3 => forged.line("\"name\": \"histograms.hlog\"", 0, |line| {
                line.replace("histograms", ["other", "../genuine-1/histograms", "wakes"][i])
            }),
            3..6 => std::fs::rename(
                forged.folder.join([HISTOGRAMS, WAKES, PAGE][i - 3]),
                forged.folder.join("renamed"),
            )
            .expect("renamed"),
            6..9 => drop(
                std::fs::copy(
                    other.join([HISTOGRAMS, WAKES, PAGE][i - 6]),
                    forged.folder.join([HISTOGRAMS, WAKES, PAGE][i - 6]),
                )
                .expect("copied"),
            ),
            _ => forged.line("\"name\": \"report.html\"", 0, |line| {
                line.replace("report", "histograms").replace("html", "hlog")
            }),
        },
        _ => unreachable!("{kind}"),
    }
}

#[test]
fn ninety_forgeries_are_named_and_no_genuine_report_is() {
    let root = tempfile::tempdir().expect("a folder");
    // A hundred genuine reports take a minute: STYLET_GENUINE=100.
    let genuine_reports = std::env::var("STYLET_GENUINE").map_or(10, |n| n.parse().expect("a number"));
    let all: Vec<PathBuf> = (0..genuine_reports).map(|seed| genuine(root.path(), seed)).collect();
    let Some(meyer) = key(root.path(), "meyer") else { return };
    let other = key(root.path(), "other").expect("ssh-keygen runs");
    let allowed = root.path().join("allowed");
    let public = std::fs::read_to_string(meyer.with_extension("pub")).expect("a key");
    std::fs::write(&allowed, format!("a.meyer@site {public}")).expect("written");
    for (i, folder) in all.iter().enumerate() {
        let unsigned = Forged { folder: folder.clone() };
        assert_eq!(unsigned.problems(None), Vec::<String>::new());
        if i >= 10 {
            continue;
        }
        for kind in [
            "values",
            "outcomes",
            "histograms",
            "computed",
            "order",
            "dates",
            "names",
        ] {
            let forged = Forged::of(folder, &format!("{kind}-{i}"));
            forge(kind, &forged, i, &all[(i + 1) % 10]);
            let found = forged.problems(None);
            println!("{kind} {i}: {}", found.first().map_or("NOT NAMED", String::as_str));
            assert!(!found.is_empty(), "{kind} {i}");
        }
        sign::sign(&folder.join(JSON), &meyer).expect("signed");
        assert_eq!(unsigned.problems(Some(&allowed)), Vec::<String>::new());
        // A value is changed with every figure that follows from it: only the signature knows.
        let forged = Forged::of(folder, &format!("signature-{i}"));
        forged.seal(|json| json.replace("\"insertions\": 1", "\"insertions\": 2"));
        assert!(
            forged.problems(None).iter().any(|p| p.contains("report.json.sig")),
            "signature {i}"
        );
        let forged = Forged::of(folder, &format!("key-{i}"));
        sign::sign(&forged.folder.join(JSON), &other).expect("signed");
        assert!(
            forged.problems(Some(&allowed)).iter().any(|p| p.contains("wrong key")),
            "key {i}"
        );
    }
}

/// Nothing in a report can be changed alone: each line is changed in turn.
#[test]
fn each_changed_line_of_a_report_is_named() {
    let root = tempfile::tempdir().expect("a folder");
    let folder = genuine(root.path(), 3);
    let lines = std::fs::read_to_string(folder.join(JSON))
        .expect("text")
        .lines()
        .count();
    let every = if std::env::var_os("STYLET_EVERY_LINE").is_some() {
        1
    } else {
        29
    };
    let forged = Forged::of(&folder, "lines");
    assert_eq!(forged.problems(None), Vec::<String>::new());
    let whole = forged.text(JSON);
    let mut missed = Vec::new();
    for at in (0..lines).step_by(every) {
        let line = whole.lines().nth(at).expect("a line");
        let own = line.contains("\"sha256\"") || !line.contains(|c: char| c.is_ascii_alphanumeric());
        if own || line.trim_end().ends_with(['[', '{']) {
            continue;
        }
        forged.put(JSON, &whole);
        forged.line("", at, |line| {
            let last = line.rfind(|c: char| c.is_ascii_alphanumeric()).expect("a character");
            let other = match line.as_bytes()[last] {
                b'0' => "1",
                b'1'..=b'9' => "0",
                b'x' => "y",
                _ => "x",
            };
            format!("{}{other}{}", &line[..last], &line[last + 1..])
        });
        if forged.problems(None).is_empty() {
            missed.push(line.to_owned());
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}
