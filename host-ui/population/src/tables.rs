//! Tables for spreadsheets.

use crate::dose::Scored;
use crate::error::PopulationError;
use crate::figures::{Distribution, mean_misplacement_mm};
use std::path::Path;
use stylet_base::format::cell;
use stylet_base::write_whole;
use stylet_insertions::Table;

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
    let results = [
        "peak_force_n",
        "displacement_before_puncture_mm",
        "largest_displacement_mm",
        "target_shift_mm",
        "duration_s",
        "seeds",
        "mean_misplacement_mm",
        "failure",
    ];
    let drawn = table.quantities.iter().map(String::as_str);
    rows.write_record(
        fixed
            .into_iter()
            .chain(drawn)
            .chain(results)
            .map(|name| cell(name).into_owned()),
    )?;
    for row in &table.rows {
        let m = row.outcome.as_ref().ok();
        let mut record = vec![row.id.clone(), row.scene.clone(), row.plan.clone()];
        record.extend([
            row.implant.to_string(),
            row.needle.to_string(),
            row.hole.clone(),
            row.tissue.clone(),
        ]);
        record.extend(row.drawn.iter().map(f64::to_string));
        record.extend([
            number(m.map(|m| m.peak_force_n)),
            number(m.map(|m| m.displacement_before_puncture_mm)),
            number(m.map(|m| m.largest_displacement_mm)),
            number(m.map(|m| m.target_shift_mm)),
            number(m.map(|m| m.duration_s)),
            row.seeds.len().to_string(),
            number(mean_misplacement_mm(row)),
            row.outcome.as_ref().err().cloned().unwrap_or_default(),
        ]);
        rows.write_record(record.iter().map(|value| cell(value).into_owned()))?;
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
        let figures = [
            i.planned.d90_percent,
            i.delivered.d90_percent,
            i.planned.v100_percent,
            i.delivered.v100_percent,
        ];
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
