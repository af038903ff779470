//! The table of hard cases, as it stands in `docs/stability.md`.

use super::cases::SHORT;
use super::models::name;
use std::fmt::Write as _;
use std::path::PathBuf;
use stylet_sim::scene::TissueKind;

/// One case met by one model.
pub struct Row {
    /// Number in the list of hard cases.
    pub number: u32,
    pub case: &'static str,
    pub model: &'static str,
    pub should: &'static str,
    pub happened: String,
    pub met: bool,
}

const HEAD: &str = "\
# Numerical stability

How every tissue model handles the hard cases: what should happen and what happened, with figures. The suite that runs the cases
writes this page: `UPDATE_DOCS=1 cargo test --profile quick -p stylet-tests-physics stability`. Without `UPDATE_DOCS` it runs the
same cases and fails if one is not met or is missing here.

Lengths are in elements. *Corner* is the smallest volume that three links of an element span, relative to that at rest; a cell folds
where it is not above zero. *Residual* is, for ChainMail, the largest violation of a limit; for FEM, the residual force relative to
the force of the tip. No folded cell means a corner above -1e-3. FEM has forty cycles a tick here and holds one element, so that these
rows are of the solver; as it runs, with one cycle and a patch of 4 mm, it is among the rows that tests write, further below.

";

fn page() -> PathBuf {
    stylet_test_kit::repository("docs/stability.md")
}

/// Everything below this line belongs to other suites.
const END: &str = "<!-- end of the tissue cases -->\n";

pub fn write_or_compare(rows: &[Row]) {
    let _lock = crate::rows::lock();
    let old = std::fs::read_to_string(page()).unwrap_or_default();
    let rest = old.split_once(END).map_or("", |(_, rest)| rest);
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let text = format!("{HEAD}{}{}{END}{rest}", table(rows), shortfalls(rows));
        std::fs::write(page(), text).expect("docs can be written");
        return;
    }
    for row in rows {
        let line = format!("| {} | {} | {} |", row.number, row.case, row.model);
        assert!(
            old.contains(&line),
            "docs/stability.md lacks \"{line}\": run the command at its head"
        );
    }
}

/// Lists the reasons why rows are not met.
fn shortfalls(rows: &[Row]) -> String {
    let mut text = String::from("\nWhy some cases are not met:\n\n");
    for (number, kind, why) in SHORT {
        if rows.iter().any(|row| is(row, number, kind) && !row.met) {
            writeln!(text, "- ({number}) {}: {why}.", name(kind)).expect("a string takes all");
        }
    }
    text
}

pub fn is(row: &Row, number: u32, kind: TissueKind) -> bool {
    row.number == number && row.model == name(kind)
}

fn table(rows: &[Row]) -> String {
    let mut text = String::from("| | case | model | should | happened | met |\n|---|---|---|---|---|---|\n");
    for row in rows {
        let met = if row.met { "yes" } else { "**no**" };
        writeln!(
            text,
            "| {} | {} | {} | {} | {} | {met} |",
            row.number, row.case, row.model, row.should, row.happened
        )
        .expect("a string takes all");
    }
    text
}
