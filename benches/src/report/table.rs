//! The rows of `speed-vs-error.csv`.

use crate::models::Entry;
use crate::runs::Run;
use serde::Serialize;
use std::path::Path;
use stylet_benches::error::{Error, quantile};
use stylet_benches::insertions::Insertion;

/// One model through one insertion.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub spacing_mm: f64,
    pub elements: usize,
    pub insertion: &'static str,
    pub model: &'static str,
    pub setting: String,
    pub travel_mm: f64,
    pub ticks: usize,
    pub mean_us: f64,
    pub p50_us: f64,
    pub p99_us: f64,
    pub max_us: f64,
    pub rms_percent: f64,
    pub max_percent: f64,
    pub seed_rms_mm: f64,
    pub seed_max_mm: f64,
    /// Error over the insertion's largest force on the tip, RMS and largest; empty where the model knows no forces.
    pub tip_force_rms_percent: Option<f64>,
    pub tip_force_max_percent: Option<f64>,
    pub residual: f64,
    pub unconverged_ticks: usize,
    /// RMS of the same insertion where nothing moves.
    pub nothing_moves_percent: f64,
    /// RMS of the same insertion where the body goes along as one piece, by the best shift of each tick.
    pub best_shift_percent: f64,
}

pub struct Where {
    pub spacing_m: f64,
    pub elements: usize,
    /// Errors where nothing moves, and of the best shift.
    pub without_model: [Error; 2],
}

/// Makes a row from equal runs `rounds`; each tick's time is the least of them, as the tissue does the same in each.
pub fn row(place: &Where, insertion: &Insertion, entry: &Entry, rounds: &[Run]) -> Row {
    let first = &rounds[0];
    let least = |tick: usize| rounds.iter().map(|r| r.micros[tick]).fold(f64::INFINITY, f64::min);
    let micros: Vec<f64> = (0..first.micros.len()).map(least).collect();
    let mean_us = micros.iter().sum::<f64>() / micros.len() as f64;
    let (mm, percent) = (1e3, 100.0 / insertion.travel_m);
    let error = &first.error;
    Row {
        spacing_mm: place.spacing_m * mm,
        elements: place.elements,
        insertion: insertion.name,
        model: entry.model_name,
        setting: entry.setting.clone(),
        travel_mm: insertion.travel_m * mm,
        ticks: micros.len(),
        mean_us,
        p50_us: quantile(&micros, 0.5),
        p99_us: quantile(&micros, 0.99),
        max_us: quantile(&micros, 1.0),
        rms_percent: error.all.rms_m() * percent,
        max_percent: error.all.max_m * percent,
        seed_rms_mm: error.seeds.rms_m() * mm,
        seed_max_mm: error.seeds.max_m * mm,
        tip_force_rms_percent: first.tip_force.map(|f| f[0] * 100.0),
        tip_force_max_percent: first.tip_force.map(|f| f[1] * 100.0),
        residual: first.residual,
        unconverged_ticks: first.unconverged,
        nothing_moves_percent: place.without_model[0].all.rms_m() * percent,
        best_shift_percent: place.without_model[1].all.rms_m() * percent,
    }
}

pub fn write(rows: &[impl Serialize], path: &Path) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_path(path)?;
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    writer.flush().map_err(Into::into)
}

/// Mean over the insertions, of one model and setting at one spacing.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    pub spacing_mm: f64,
    pub model: &'static str,
    pub setting: String,
    pub mean_us: f64,
    pub worst_p99_us: f64,
    pub rms_percent: f64,
    pub worst_rms_percent: f64,
    pub worst_max_percent: f64,
    pub nothing_moves_percent: f64,
    pub best_shift_percent: f64,
    pub seed_rms_mm: f64,
    /// Worst of the insertions, largest error of the force on the tip.
    pub worst_tip_force_percent: Option<f64>,
    pub unconverged_ticks: usize,
}

pub fn points(rows: &[Row]) -> Vec<Point> {
    let mut groups: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        let key = |row: &Row| (row.spacing_mm.to_bits(), row.model, row.setting.clone());
        match groups.iter_mut().find(|group| key(group[0]) == key(row)) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    groups.iter().map(|group| point(group)).collect()
}

fn point(rows: &[&Row]) -> Point {
    let mean = |of: fn(&Row) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() / rows.len() as f64;
    let worst = |of: fn(&Row) -> f64| rows.iter().map(|row| of(row)).fold(0.0, f64::max);
    Point {
        spacing_mm: rows[0].spacing_mm,
        model: rows[0].model,
        setting: rows[0].setting.clone(),
        mean_us: mean(|row| row.mean_us),
        worst_p99_us: worst(|row| row.p99_us),
        rms_percent: mean(|row| row.rms_percent),
        worst_rms_percent: worst(|row| row.rms_percent),
        worst_max_percent: worst(|row| row.max_percent),
        nothing_moves_percent: mean(|row| row.nothing_moves_percent),
        best_shift_percent: mean(|row| row.best_shift_percent),
        seed_rms_mm: mean(|row| row.seed_rms_mm),
        worst_tip_force_percent: rows.iter().filter_map(|row| row.tip_force_max_percent).reduce(f64::max),
        unconverged_ticks: rows.iter().map(|row| row.unconverged_ticks).sum(),
    }
}
