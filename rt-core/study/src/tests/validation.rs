//! `docs/validation.md`: published figures beside those of Stylet, and the error that is left for one seed.

mod budget;
mod figures;
mod friction;

use crate::Study;
use crate::tests::shards::finished_in;
use serde::Deserialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const PUBLISHED: &str = include_str!("../../../../host-ui/population/src/published.toml");

const HEAD: &str = "\
# Validation

What was published, what Stylet has, and what its own error is. `make validation` computes every figure of Stylet on this
page and writes it. The published figures are those of a [study's page](study.md#against-people).

*Fitted*: a parameter was fitted to it or set by it. Agreement then says nothing, and **no fitted figure counts as
reproduced**. *Check*: no parameter was fitted to it. *Context*: another organ, needle or cause, so that no agreement is
expected. *Not checked against the source*: from a second text or from memory.

";

/// A published figure, of `host-ui/population/src/published.toml`.
#[derive(Deserialize)]
struct Published {
    what: String,
    value: f64,
    unit: String,
    how: String,
    source: String,
    used: String,
    note: String,
}

#[derive(Deserialize)]
struct File {
    published: Vec<Published>,
}

fn docs(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(file)
}

/// Returns a study of `docs/study`.
pub fn study(file: &str) -> Study {
    Study::read(&docs("study").join(file)).unwrap_or_else(|why| panic!("{why}"))
}

fn published() -> Vec<Published> {
    toml::from_str::<File>(PUBLISHED)
        .expect("a test of population reads it")
        .published
}

/// Every published figure stands on the page, with the use it has in the file.
#[test]
fn the_page_of_validation_has_every_published_figure() {
    let page = std::fs::read_to_string(docs("validation.md")).expect("a page");
    for Published { what, used, .. } in published() {
        let row = page.lines().find(|line| line.starts_with(&format!("| {what} |")));
        let row = row.unwrap_or_else(|| panic!("no row of \"{what}\": `make validation`"));
        assert!(row.contains(&format!("| {used}")), "{row}");
    }
}

/// Writes the page: `make validation`.
#[test]
#[ignore = "insertions of some minutes"]
fn validation_is_written() {
    let table = finished_in(&study("validation.toml"));
    let stylet = figures::of_stylet(&table);
    let mut page = HEAD.to_owned();
    page.push_str(&figures::about());
    page.push_str("| what | published | Stylet | Stylet / published | use | source, and what it means |\n|---|---|---|---|---|---|\n");
    for Published {
        what,
        value,
        unit,
        how,
        source,
        used,
        note,
    } in published()
    {
        let own = stylet.iter().find(|own| own.what == what);
        let [own, ratio] = own.map_or(["-".to_owned(), "-".to_owned()], |own| {
            [
                format!("{:.2}; {}", own.value, own.how),
                format!("{:.2}", own.value / value),
            ]
        });
        let note = note.split_whitespace().collect::<Vec<_>>().join(" ");
        let checked = match note.contains("unverified") {
            true => "; not checked against the source",
            false => "",
        };
        let _ = writeln!(
            page,
            "| {what} | {value} {unit}; {how} | {own} | {ratio} | {used}{checked} | {source}: {note} |"
        );
    }
    page.push('\n');
    page.push_str(&friction::section(&table));
    page.push('\n');
    page.push_str(&budget::section());
    print!("{page}");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(docs("validation.md"), page).expect("docs can be written");
    }
}
