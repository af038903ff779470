//! The rows of `speed-vs-error.csv`.

use crate::models::Family;
use crate::runs::Run;
use serde::Serialize;
use std::path::Path;
use stylet_benches::error::Error;
use stylet_benches::insertions::Insertion;

/// One model through one insertion.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub spacing_mm: f64,
    pub elements: usize,
    pub insertion: &'static str,
    pub fitted_to: bool,
    #[serde(skip)]
    pub family: Family,
    pub model: &'static str,
    pub setting: String,
    pub travel_mm: f64,
    pub ticks: usize,
    pub mean_us: f64,
    pub p50_us: f64,
    pub p99_us: f64,
    pub max_us: f64,
    pub rms_mm: f64,
    pub rms_percent: f64,
    pub max_mm: f64,
    pub max_percent: f64,
    pub seed_rms_mm: f64,
    pub seed_max_mm: f64,
    pub seed_rms_percent: f64,
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
pub fn row(place: &Where, insertion: &Insertion, family: Family, setting: &str, rounds: &[Run]) -> Row {
    let first = &rounds[0];
    let least = |tick: usize| rounds.iter().map(|r| r.micros[tick]).fold(f64::INFINITY, f64::min);
    let mut micros: Vec<f64> = (0..first.micros.len()).map(least).collect();
    let mean_us = micros.iter().sum::<f64>() / micros.len() as f64;
    micros.sort_by(f64::total_cmp);
    let quantile = |q: f64| micros[((micros.len() - 1) as f64 * q).round() as usize];
    let (mm, percent) = (1e3, 100.0 / insertion.travel_m);
    let error = &first.error;
    Row {
        spacing_mm: place.spacing_m * mm,
        elements: place.elements,
        insertion: insertion.name,
        fitted_to: insertion.fitted,
        family,
        model: family.name(),
        setting: setting.to_owned(),
        travel_mm: insertion.travel_m * mm,
        ticks: micros.len(),
        mean_us,
        p50_us: quantile(0.5),
        p99_us: quantile(0.99),
        max_us: quantile(1.0),
        rms_mm: error.rms_m() * mm,
        rms_percent: error.rms_m() * percent,
        max_mm: error.max_m() * mm,
        max_percent: error.max_m() * percent,
        seed_rms_mm: error.seed_rms_m() * mm,
        seed_max_mm: error.seed_max_m() * mm,
        seed_rms_percent: error.seed_rms_m() * percent,
        tip_force_rms_percent: first.tip_force.map(|f| f[0] * 100.0),
        tip_force_max_percent: first.tip_force.map(|f| f[1] * 100.0),
        residual: first.residual,
        unconverged_ticks: first.unconverged,
        nothing_moves_percent: place.without_model[0].rms_m() * percent,
        best_shift_percent: place.without_model[1].rms_m() * percent,
    }
}

pub fn write(rows: &[Row], path: &Path) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_path(path)?;
    rows.iter().try_for_each(|row| writer.serialize(row))?;
    writer.flush().map_err(Into::into)
}

/// Mean over the insertions that were held back, of one model and setting at one spacing.
#[derive(Clone, Debug)]
pub struct Point {
    pub family: Family,
    pub setting: String,
    pub spacing_mm: f64,
    pub elements: usize,
    pub mean_us: f64,
    pub worst_p99_us: f64,
    pub rms_percent: f64,
    pub worst_rms_percent: f64,
    pub worst_max_percent: f64,
    pub seed_rms_mm: f64,
    /// Worst of the insertions, largest error of the force on the tip.
    pub worst_tip_force_percent: Option<f64>,
    pub unconverged_ticks: usize,
    pub nothing_moves_percent: f64,
    pub best_shift_percent: f64,
}

pub fn points(rows: &[Row]) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let mut counts = Vec::new();
    for row in rows.iter().filter(|row| !row.fitted_to) {
        let same = |p: &Point| p.family == row.family && p.setting == row.setting && p.spacing_mm == row.spacing_mm;
        let n = points.iter().position(same).unwrap_or_else(|| {
            counts.push(0.0);
            points.push(Point {
                family: row.family,
                setting: row.setting.clone(),
                spacing_mm: row.spacing_mm,
                elements: row.elements,
                mean_us: 0.0,
                worst_p99_us: 0.0,
                rms_percent: 0.0,
                worst_rms_percent: 0.0,
                worst_max_percent: 0.0,
                seed_rms_mm: 0.0,
                worst_tip_force_percent: None,
                unconverged_ticks: 0,
                nothing_moves_percent: 0.0,
                best_shift_percent: 0.0,
            });
            points.len() - 1
        });
        let point = &mut points[n];
        counts[n] += 1.0;
        point.mean_us += row.mean_us;
        point.rms_percent += row.rms_percent;
        point.seed_rms_mm += row.seed_rms_mm;
        point.nothing_moves_percent += row.nothing_moves_percent;
        point.best_shift_percent += row.best_shift_percent;
        point.worst_p99_us = point.worst_p99_us.max(row.p99_us);
        point.worst_rms_percent = point.worst_rms_percent.max(row.rms_percent);
        point.worst_max_percent = point.worst_max_percent.max(row.max_percent);
        point.worst_tip_force_percent = [point.worst_tip_force_percent, row.tip_force_max_percent]
            .into_iter()
            .flatten()
            .reduce(f64::max);
        point.unconverged_ticks += row.unconverged_ticks;
    }
    for (point, count) in points.iter_mut().zip(counts) {
        point.mean_us /= count;
        point.rms_percent /= count;
        point.seed_rms_mm /= count;
        point.nothing_moves_percent /= count;
        point.best_shift_percent /= count;
    }
    points
}

/// Returns the points that no other beats in both time and error.
pub fn pareto<'a>(points: &[&'a Point]) -> Vec<&'a Point> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.mean_us.total_cmp(&b.mean_us));
    let mut front: Vec<&Point> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point.rms_percent < last.rms_percent) {
            front.push(point);
        }
    }
    front
}
