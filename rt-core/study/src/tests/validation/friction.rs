//! Misplacement of seeds in strands by the friction of the shaft: what fits patients along the needle.

use super::figures::{failed, in_strands, mean_parts_mm};
use super::{docs, published};
use crate::Study;
use crate::tests::shards::finished_in;
use std::fmt::Write as _;
use stylet_insertions::Table;
use stylet_shm_schema::ParameterId;

/// Frictions of the shaft in the gland, N/m, above the default.
const HIGHER: [f64; 5] = [110.0, 140.0, 170.0, 210.0, 500.0];

struct Row {
    n_per_m: f64,
    failed: usize,
    mm: [f64; 4],
}

impl Row {
    fn of(n_per_m: f64, table: &Table) -> Self {
        Row {
            n_per_m,
            failed: failed(table),
            mm: mean_parts_mm(&in_strands(table)),
        }
    }
}

/// Returns the study of the page with another friction, and the same draws.
fn with_friction(n_per_m: f64) -> Study {
    let folder = docs("study");
    let text = std::fs::read_to_string(folder.join("validation.toml")).expect("a study");
    Study::of_text(&format!("{text}\"force.shaft_friction\" = {n_per_m:?}\n"), &folder).expect("valid")
}

/// Returns the section of the page; `usual` is the study at the defaults.
pub fn section(usual: &Table) -> String {
    let default = ParameterId::ShaftFriction.spec().default;
    let higher = HIGHER.map(|n_per_m| Row::of(n_per_m, &finished_in(&with_friction(n_per_m))));
    let rows: Vec<Row> = [Row::of(default, usual)].into_iter().chain(higher).collect();
    let published_mm = ["", ", to the side", ", up or down", ", along the needle"].map(|part| {
        let of_part = |figure: &super::Published| figure.what == format!("seed misplacement{part}");
        published().into_iter().find(of_part).expect("is published").value
    });
    let mut text = "\
## Friction of the shaft, fitted along the needle

*Fitted.* The same insertions and draws, with another friction of the shaft in the gland; friction in perineum and fat stays. Means of
seeds in strands, mm.

| friction | misplacement | along the needle | to the side | up or down | failed needles |
|---|---|---|---|---|---|
"
    .to_owned();
    for Row { n_per_m, failed, mm } in &rows {
        let [total, side, up, along] = mm;
        let _ = writeln!(
            text,
            "| {n_per_m:.0} N/m | {total:.2} | {along:.2} | {side:.2} | {up:.2} | {failed} |"
        );
    }
    let [total, side, up, along] = published_mm;
    let _ = writeln!(text, "| patients | {total} | {along} | {side} | {up} | |\n");
    match rows.iter().find(|row| row.mm[3] >= along) {
        Some(Row { n_per_m, .. }) => {
            let _ = writeln!(
                text,
                "Patients' figure along the needle is reached by {n_per_m:.0} N/m."
            );
        }
        None => {
            text.push_str("No friction that the table of parameters permits gives patients' figure along the needle.\n")
        }
    }
    text
}
