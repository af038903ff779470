//! The page of a run: what was measured, in tables with a column for each field of their rows.

use crate::budget::Cause;
use crate::ships::Ships;
use crate::table::Point;
use serde::Serialize;
use std::error::Error;
use std::fmt::Write as _;
use stylet_benches::insertions::{GLAND, TICK_S};

/// Everything that the page is written from.
pub struct Findings<'a> {
    pub machine: &'a [(String, String)],
    pub points: &'a [Point],
    pub refinement: &'a [Refinement],
    /// Shipped models against the converged solution of each tick.
    pub ships: &'a [Ships],
    /// Causes of the error of a needle's line.
    pub causes: &'a [Cause],
    pub seconds: f64,
}

/// Distance of the seeds at one spacing from those at the finest.
#[derive(Serialize)]
pub struct Refinement {
    pub spacing_mm: f64,
    pub rms_mm: f64,
    pub largest_mm: f64,
}

pub fn write(found: &Findings) -> Result<String, Box<dyn Error>> {
    let mut text = String::from("# Speed against error of the tissue models\n");
    let names = GLAND.map(|insertion| insertion.name);
    let of_models = format!(
        "The same insertions through every model, on the paper's gland cut at three spacings, in surroundings of the same stiffness. \
         Error: distance from the converged finite elements (f64) on the same lattice, over the elements that they move by more than \
         1 % of the tip's travel, every fourth tick of {} ms. Times are the least of equal rounds, interleaved. *Nothing moves* and \
         *best shift* are the errors without a model, and of the body shifted as one piece by what fits each tick best. Means over \
         the insertions {}; `speed-vs-error.csv` has each.",
        TICK_S * 1e3,
        names.join("; "),
    );
    section(&mut text, "Every model", &of_models, found.points)?;
    section(
        &mut text,
        "What ships",
        "The two loops as a run has them, a steady hand along z: in, rest, half the way out. Every fourth tick of the tissue loop is \
         compared with the converged solution of the same tick: every column of the same line solved to a residual of 1e-7 (1e-5 in \
         `pelvis`) on the body that `--tissue fem` has, behind the same law of contact, on the tip's path of that session. Field: RMS \
         distance over the elements that move, in percent of the tick's largest displacement. Forces: in percent of the insertion's \
         largest. *Own*: ChainMail against itself with nothing left to do in any tick; finite elements are their own. Times of a tick \
         on one thread, the tissue's with the force tick before it. Asked for: field within 1 %, force on the tip within 3 %.",
        found.ships,
    )?;
    section(
        &mut text,
        "Causes of error",
        "One needle through the middle of `paper` to 45 mm and half the way out, on one path, through one body and another that \
         differ in one thing. Field: mean and worst of the ticks, in percent of the tick's largest displacement. Forces: RMS and \
         worst, in percent of the largest. The error of linearity is in `tests/oracles/neo_hooke`.",
        found.causes,
    )?;
    section(
        &mut text,
        "What the spacing costs",
        "Converged finite elements at each spacing against the finest, at the seeds, at the end of the push.",
        found.refinement,
    )?;
    text.push_str("\n## Machine\n\n");
    for (name, value) in found.machine {
        writeln!(text, "- {name}: {value}")?;
    }
    writeln!(text, "- whole report: {:.0} s", found.seconds)?;
    Ok(text)
}

fn section(text: &mut String, title: &str, about: &str, rows: &[impl Serialize]) -> Result<(), Box<dyn Error>> {
    write!(text, "\n## {title}\n\n{about}\n\n")?;
    let mut writer = csv::Writer::from_writer(Vec::new());
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    let table = writer.into_inner()?;
    for (n, row) in csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(&table[..])
        .records()
        .enumerate()
    {
        let row = row?;
        writeln!(text, "| {} |", row.iter().map(short).collect::<Vec<_>>().join(" | "))?;
        if n == 0 {
            writeln!(text, "{}|", "|---".repeat(row.len()))?;
        }
    }
    Ok(())
}

/// Returns a number with as many digits as a reader compares, and anything else as it is.
fn short(field: &str) -> String {
    match field.parse::<f64>() {
        Ok(value) if field.contains('.') => match value.abs() {
            size if size >= 100.0 => format!("{value:.0}"),
            size if size >= 1e-3 || size == 0.0 => format!("{value:.3}"),
            _ => format!("{value:.0e}"),
        },
        _ => field.to_owned(),
    }
}
