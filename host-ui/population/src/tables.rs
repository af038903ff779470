//! Tables for spreadsheets.

use crate::dose::Scored;
use crate::error::PopulationError;
use crate::figures::{Distribution, mean_misplacement_mm};
use std::path::Path;
use stylet_base::format::cell;
use stylet_base::write_whole;
use stylet_insertions::{MEASURED, Table};

/// Writes insertions.csv, implants.csv and distributions.csv.
///
/// # Errors
///
/// If the folder cannot be written.
pub fn write_tables(
    folder: &Path,
    table: &Table,
    scored: &Scored,
    figures: &[Distribution],
) -> Result<(), PopulationError> {
    let file = |name: &str, bytes: Vec<u8>| write_whole(&folder.join(name), &bytes);
    file("insertions.csv", insertions(table)?)?;
    file("implants.csv", implants(scored)?)?;
    file("distributions.csv", distributions(figures)?)?;
    Ok(())
}

fn bytes(mut rows: csv::Writer<Vec<u8>>) -> Result<Vec<u8>, PopulationError> {
    rows.flush().map_err(csv::Error::from)?;
    rows.into_inner()
        .map_err(|e| PopulationError::Csv(e.into_error().into()))
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}

fn insertions(table: &Table) -> Result<Vec<u8>, PopulationError> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    let fixed = ["id", "scene", "plan", "implant", "needle", "hole", "tissue"];
    let ending = ["seeds", "mean_misplacement_mm", "failure"];
    let drawn = table.quantities.iter().map(String::as_str);
    let measured = MEASURED.map(|(name, _)| name);
    let head = fixed.into_iter().chain(drawn).chain(measured).chain(ending);
    rows.write_record(head.map(|name| cell(name).into_owned()))?;
    for row in &table.rows {
        let m = row.outcome.as_ref();
        let (implant, needle) = (row.implant.to_string(), row.needle.to_string());
        let fixed = [
            &row.id,
            &row.scene,
            &row.plan,
            &implant,
            &needle,
            &row.hole,
            &row.tissue,
        ];
        let ending = [
            row.seeds.len().to_string(),
            number(mean_misplacement_mm(row)),
            m.err().cloned().unwrap_or_default(),
        ];
        let measured = MEASURED.map(|(_, of)| number(m.ok().map(of)));
        let drawn = row.drawn.iter().map(f64::to_string);
        let record = fixed.into_iter().cloned().chain(drawn).chain(measured).chain(ending);
        rows.write_record(record.map(|value| cell(&value).into_owned()))?;
    }
    bytes(rows)
}

fn implants(scored: &Scored) -> Result<Vec<u8>, PopulationError> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    rows.write_record([
        "implant",
        "seeds",
        "planned_d90_percent",
        "delivered_d90_percent",
        "planned_v100_percent",
        "delivered_v100_percent",
    ])?;
    for i in &scored.implants {
        let (p, d) = (i.planned, i.delivered);
        let figures = [p.d90_percent, d.d90_percent, p.v100_percent, d.v100_percent];
        let record = [cell(&i.id).into_owned(), i.seeds.to_string()].into_iter();
        rows.write_record(record.chain(figures.map(|f| f.to_string())))?;
    }
    bytes(rows)
}

fn distributions(figures: &[Distribution]) -> Result<Vec<u8>, PopulationError> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    rows.write_record([
        "quantity", "unit", "each", "count", "mean", "sd", "p5", "p25", "p50", "p75", "p95", "max",
    ])?;
    for d in figures {
        let record = [
            d.name.to_owned(),
            d.unit.to_owned(),
            d.each.to_owned(),
            d.values.len().to_string(),
        ];
        let percentiles = [5.0, 25.0, 50.0, 75.0, 95.0, 100.0].map(|p| d.percentile(p));
        let figures = [d.mean(), d.deviation()].into_iter().chain(percentiles).map(number);
        rows.write_record(record.into_iter().chain(figures))?;
    }
    bytes(rows)
}
