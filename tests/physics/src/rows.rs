//! Rows of `docs/stability.md` written by tests: hard cases of the shipped program, each with its figure.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};

/// One hard case in one model.
#[derive(Clone, Debug)]
pub struct Row {
    /// Number in the list of hard cases.
    pub number: u32,
    /// Case.
    pub case: &'static str,
    /// Tissue.
    pub model: &'static str,
    /// Requirement.
    pub should: &'static str,
    /// Outcome, with figures.
    pub happened: String,
    /// The outcome meets the requirement.
    pub met: bool,
    /// Live warning for a case known to fall short.
    pub warning: &'static str,
}

/// Tests of one binary run in parallel.
static PAGE: Mutex<()> = Mutex::new(());

const BEGIN: &str = "<!-- rows that tests write -->\n";
const END: &str = "<!-- end of the rows that tests write -->\n";
const HEAD: &str = "| | case | model | should | happened | met |\n|---|---|---|---|---|---|\n";

/// Locks the page, so that no other test rewrites it meanwhile.
pub fn lock() -> std::sync::MutexGuard<'static, ()> {
    PAGE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the row with `UPDATE_DOCS`; otherwise checks that the page has the row with the same outcome.
pub fn keep(row: &Row) {
    println!(
        "{:>2} {}, {}: {} {}",
        row.number, row.case, row.model, row.met, row.happened
    );
    assert!(
        row.met || !row.warning.is_empty(),
        "{} is not met, and nothing warns of it",
        row.case
    );
    let _lock = lock();
    let path = stylet_test_kit::repository("docs/stability.md");
    let page = std::fs::read_to_string(&path).expect("the page");
    let (before, rest) = page.split_once(BEGIN).expect("the rows begin");
    let (old, after) = rest.split_once(END).expect("the rows end");
    let mut lines: BTreeMap<(u32, String), &str> = BTreeMap::new();
    for line in old.lines().skip(2) {
        let cells: Vec<&str> = line.split(" | ").collect();
        let number = cells[0].trim_start_matches("| ").parse().expect("a number in front");
        lines.insert((number, format!("{} | {}", cells[1], cells[2])), line);
    }
    let key = (row.number, format!("{} | {}", row.case, row.model));
    let mut text = String::new();
    let met = if row.met {
        "yes".to_owned()
    } else {
        format!("**no**: {}", row.warning)
    };
    write!(
        text,
        "| {} | {} | {} | {} | {} | {met} |",
        row.number, row.case, row.model, row.should, row.happened
    )
    .expect("a string takes all");
    if std::env::var_os("UPDATE_DOCS").is_none() {
        let kept = lines.get(&key).copied().unwrap_or_default();
        assert!(
            !kept.is_empty(),
            "docs/stability.md lacks \"{} | {}\"",
            row.number,
            key.1
        );
        let is_met = !kept.contains("| **no**");
        assert_eq!(row.met, is_met, "docs/stability.md has it the other way: {kept}");
        return;
    }
    lines.insert(key, &text);
    let rows: String = lines.values().map(|line| format!("{line}\n")).collect();
    std::fs::write(path, format!("{before}{BEGIN}{HEAD}{rows}{END}{after}")).expect("docs can be written");
}
