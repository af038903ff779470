//! Files that once gave a wrong answer without a word: the command, the answer then, and the answer now. Each kind has
//! three further files.

mod contours;
mod doses;
mod images;
mod names;
mod objects;
mod plans;

use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use stylet_test_kit::{program, repository, scratch};

const PAGE: &str = "docs/cases.md";
const HEAD: &str = "\
# Cases

Troubles that users of other programs have reported in public, with small files. `UPDATE_DOCS=1 cargo test --profile quick
-p stylet-tests-files cases` makes the files, runs the commands and writes this page; without `UPDATE_DOCS` the test fails where an
answer is another one. The first file of each kind is like one that Stylet got wrong, with its answer of November 2026. The others were
made without it. `source` is `sources/i125_6711.toml`, `out` a new folder. A figure is that of the last command.

";

/// A file, its command and the right answer.
pub struct Case {
    kind: &'static str,
    file: &'static str,
    /// Commands, their words separated by spaces.
    commands: &'static str,
    before: &'static str,
    make: Box<dyn Fn(&Path)>,
    right: Right,
    /// Beginnings of lines of the output that belong to the answer.
    shows: &'static [&'static str],
}

/// Right answer of the last command.
pub enum Right {
    /// It is refused with these words.
    Refused(&'static str),
    /// It has these words, which may be none, in its notes or its output.
    Says(&'static [&'static str]),
    /// Like `Says`; structures have these volumes in cc.
    Volumes(&'static [&'static str], Vec<(&'static str, f64)>),
    /// It writes a file with a line of this beginning and end.
    Holds(&'static str, &'static str, &'static str),
    /// Each of these seeds (RAS, mm) is found within 1.5 mm or listed as doubtful, and no other one is without a doubt.
    Seeds(Vec<[f64; 3]>),
}

impl Case {
    fn new(
        kind: &'static str,
        file: &'static str,
        commands: &'static str,
        right: Right,
        make: impl Fn(&Path) + 'static,
    ) -> Self {
        Self {
            kind,
            file,
            commands,
            before: "",
            make: Box::new(make),
            right,
            shows: &[],
        }
    }

    /// Gives the answer of the time when the file was found.
    fn before(self, before: &'static str) -> Self {
        Self { before, ..self }
    }

    fn shows(self, shows: &'static [&'static str]) -> Self {
        Self { shows, ..self }
    }

    /// Makes the files, and returns the answer in words, and the reason why it is wrong.
    fn answer(&self, folder: &Path) -> (String, Option<String>) {
        (self.make)(folder);
        let source = repository("sources/i125_6711.toml").display().to_string();
        let (mut done, mut out, mut said) = (true, String::new(), String::new());
        for command in self.commands.split("; ") {
            assert!(done, "{} {}: {said}", self.kind, self.file);
            let words = command
                .split(' ')
                .map(|word| if word == "source" { source.as_str() } else { word });
            let ended = Command::new(program("host-ui"))
                .args(words)
                .current_dir(folder)
                .output()
                .expect("host-ui runs");
            done = ended.status.success();
            out = String::from_utf8_lossy(&ended.stdout).into_owned();
            said += &String::from_utf8_lossy(&ended.stderr);
        }
        let said = said.replace(&source, "source");
        let shown = out.lines().filter(|line| {
            self.shows
                .iter()
                .any(|beginning| line.trim_start().starts_with(beginning))
        });
        let lines = said
            .lines()
            .chain(shown)
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
        let mut lines: Vec<String> = lines
            .map(|line| line.trim_start_matches("stylet-clinic: ").replace('|', "/"))
            .collect();
        lines.dedup();
        if let (true, Right::Holds(file, beginning, _)) = (done, &self.right) {
            let bytes = std::fs::read(folder.join(file)).expect("written");
            let text = String::from_utf8_lossy(&bytes).into_owned();
            lines.extend(
                text.lines()
                    .find(|line| line.starts_with(beginning))
                    .map(|line| format!("`{line}`")),
            );
        }
        if let (true, Right::Seeds(places)) = (done, &self.right) {
            let found = places
                .iter()
                .filter(|place| found_mm(folder).iter().any(|seed| far_mm(seed, place) < 1.5))
                .count();
            lines.push(format!("{found} of {} right", places.len()));
        }
        let answer = if done {
            lines.join("; ")
        } else {
            format!("refused: {}", lines.join("; "))
        };
        let missing = |words: &[&str]| {
            words
                .iter()
                .find(|word| !said.contains(**word) && !out.contains(**word))
                .map(|word| format!("\"{word}\" is missing"))
        };
        let wrong = match &self.right {
            Right::Refused(words) => (done || !said.contains(words)).then(|| format!("not refused with \"{words}\"")),
            Right::Says(words) => (!done).then(|| "refused".to_owned()).or_else(|| missing(words)),
            Right::Holds(_, beginning, end) => {
                let line = format!("`{beginning}{end}`");
                (!done || lines.last() != Some(&line)).then(|| format!("not {line}"))
            }
            Right::Seeds(places) => match done {
                true => wrong_seed(folder, &out, places),
                false => Some("refused".to_owned()),
            },
            Right::Volumes(words, volumes) => {
                let is_wrong = |(name, cc): &&(&str, f64)| {
                    volume_cc(&out, name).is_none_or(|found| (found / cc - 1.0).abs() > 5e-3)
                };
                let wrong = volumes
                    .iter()
                    .find(is_wrong)
                    .map(|(name, cc)| format!("{name} has {cc:.2} cc"));
                (!done)
                    .then(|| "refused".to_owned())
                    .or(wrong)
                    .or_else(|| missing(words))
            }
        };
        (answer, wrong)
    }
}

fn far_mm(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|n| (a[n] - b[n]).powi(2)).sum::<f64>().sqrt()
}

/// Returns the places of `find-seeds`.
fn found_mm(folder: &Path) -> Vec<[f64; 3]> {
    let table = std::fs::read_to_string(folder.join("out/seeds.csv")).expect("written");
    let rows = table.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| three(row, ',')).collect()
}

fn three(text: &str, separator: char) -> [f64; 3] {
    let mut numbers = text.split(separator).filter_map(|number| number.trim().parse().ok());
    [(); 3].map(|()| numbers.next().expect("three numbers"))
}

fn wrong_seed(folder: &Path, out: &str, places: &[[f64; 3]]) -> Option<String> {
    let found = found_mm(folder);
    let doubts = out
        .lines()
        .filter_map(|line| line.strip_prefix("doubtful: at ")?.split_once(" mm"));
    let doubtful: Vec<[f64; 3]> = doubts.map(|(place, _)| three(place, ',')).collect();
    let is_near = |all: &[[f64; 3]], place: &[f64; 3], mm: f64| all.iter().any(|other| far_mm(other, place) < mm);
    let lost = places
        .iter()
        .find(|place| !is_near(&found, place, 1.5) && !is_near(&doubtful, place, 3.0));
    let extra = found
        .iter()
        .find(|seed| !is_near(places, seed, 1.5) && !is_near(&doubtful, seed, 3.0));
    let lost = lost.map(|place| format!("the seed at {place:?} is neither found nor listed"));
    lost.or_else(|| extra.map(|place| format!("a seed at {place:?} without a doubt")))
}

/// Returns the volume of a structure in the table of `host-ui dose`.
fn volume_cc(out: &str, name: &str) -> Option<f64> {
    let line = out.lines().find(|line| line.starts_with(&format!("{name} (")))?;
    line.split(['(', ' ']).rev().nth(1)?.parse().ok()
}

#[test]
fn every_case_has_its_right_answer() {
    let all = [
        contours::cases(),
        names::cases(),
        doses::cases(),
        plans::cases(),
        images::cases(),
    ];
    let all: Vec<Case> = all.into_iter().flatten().collect();
    let mut page = HEAD.to_owned();
    let (mut kind, mut wrong) = ("", Vec::new());
    for (n, case) in all.iter().enumerate() {
        if case.kind != kind {
            kind = case.kind;
            writeln!(
                page,
                "## {kind}\n\n| file | command | answer before | answer now |\n|---|---|---|---|"
            )
            .expect("a text");
        }
        let (answer, why) = case.answer(&scratch(&format!("case-{n:02}")));
        wrong.extend(why.map(|why| format!("{kind}, {}: {why}: {answer}", case.file)));
        let command = case.commands.replace("; ", "`, then `");
        writeln!(page, "| {} | `{command}` | {} | {answer} |", case.file, case.before).expect("a text");
        if all.get(n + 1).is_some_and(|next| next.kind != kind) {
            page.push('\n');
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let path = repository(PAGE);
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, page).expect("the page can be written");
        return;
    }
    let written = std::fs::read_to_string(&path).expect("the page is there");
    assert_eq!(
        written, page,
        "write it anew: UPDATE_DOCS=1 cargo test --profile quick -p stylet-tests-files cases"
    );
}
