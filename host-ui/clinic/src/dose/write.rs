//! Results as CSV, JSON and tables; the header of each column gives its unit.

use super::Checked;
use crate::CommandError;
use crate::finder::FoundSeed;
use crate::sheet::{NotComputed, Row};
use serde_json::{Value, json};
use std::path::Path;
use stylet_base::format::cell;
use stylet_base::{write_streamed, write_whole};
use stylet_dose::Dvh;
use stylet_dose::criterion::CriterionCount;
use stylet_dose::perturb::{PERCENTILES, Spread};
use stylet_files::dicom::Identity;
use stylet_implant::readers::seeds::{AXIS, FOUND, PLACE};

pub fn json(path: &Path, value: &Value) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(value)?;
    Ok(write_whole(path, (text + "\n").as_bytes())?)
}

fn csv(path: &Path, header: &[String], rows: impl Iterator<Item = Vec<String>>) -> Result<(), CommandError> {
    csv_after("", path, header, rows)
}

/// Writes comment lines, then a table.
fn csv_after(
    comments: &str,
    path: &Path,
    header: &[String],
    rows: impl Iterator<Item = Vec<String>>,
) -> Result<(), CommandError> {
    let table = |file: &mut dyn std::io::Write| -> std::io::Result<()> {
        file.write_all(comments.as_bytes())?;
        let mut writer = csv::Writer::from_writer(file);
        writer.write_record(header.iter().map(|name| cell(name).into_owned()))?;
        for row in rows {
            writer.write_record(row.iter().map(|value| cell(value).into_owned()))?;
        }
        writer.flush()
    };
    Ok(write_streamed(path, |file| table(file))?)
}

fn owned(header: &[&str]) -> Vec<String> {
    header.iter().map(|&h| h.to_owned()).collect()
}

/// Writes doses at places, after comment lines with patient and frame of reference.
pub fn doses(
    path: &Path,
    identity: Option<&Identity>,
    points_m: impl Iterator<Item = [f64; 3]>,
    dose_gy: &[f64],
) -> Result<(), CommandError> {
    doses_after(&comments(identity), path, points_m, dose_gy)
}

fn comments(identity: Option<&Identity>) -> String {
    identity.map(Identity::comments).unwrap_or_default()
}

/// Writes comment lines, then doses at places.
pub fn doses_after(
    comments: &str,
    path: &Path,
    points_m: impl Iterator<Item = [f64; 3]>,
    dose_gy: &[f64],
) -> Result<(), CommandError> {
    let rows = points_m.zip(dose_gy).map(|(p, gy)| {
        let [x, y, z] = p.map(|v| format!("{:.4}", v * 1e3));
        vec![x, y, z, format!("{gy:.6}")]
    });
    csv_after(comments, path, &owned(&["x_mm", "y_mm", "z_mm", "dose_gy"]), rows)
}

/// Writes the seeds of a CT in the columns that `host-ui dose --seeds` reads; the last three give
/// the certainty of each. Comment lines before them have the patient and frame of the CT.
pub fn found_seeds(path: &Path, identity: Option<&Identity>, seeds: &[FoundSeed]) -> Result<(), CommandError> {
    let header = [PLACE.as_slice(), &AXIS, &FOUND].concat();
    let rows = seeds.iter().map(|s| {
        let place = s.position_m.map(|m| format!("{:.3}", m * 1e3));
        let axis = s.axis.map(|v| format!("{v:.4}"));
        let sure = [
            format!("{:.3}", s.confidence),
            format!("{:.3}", s.deviation_m * 1e3),
            s.together.to_string(),
        ];
        [place, axis, sure].concat()
    });
    csv_after(&comments(identity), path, &owned(&header), rows)
}

/// Writes differential and cumulative histograms, up to the highest dose but not beyond ten times
/// the prescription.
pub fn dvh(path: &Path, curves: &[(&str, &Dvh)], prescription_gy: f64, bin_gy: f64) -> Result<(), CommandError> {
    let header = owned(&[
        "structure",
        "dose_from_gy",
        "dose_to_gy",
        "dose_from_percent",
        "volume_in_bin_cc",
        "volume_in_bin_percent",
        "volume_at_least_cc",
        "volume_at_least_percent",
    ]);
    let rows = curves.iter().flat_map(|(name, dvh)| {
        let most_gy = dvh.highest_gy().min(10.0 * prescription_gy) + bin_gy;
        let percent = |m3: f64| format!("{:.5}", m3 / dvh.volume_m3() * 100.0);
        let cc = |m3: f64| format!("{:.6}", m3 * 1e6);
        dvh.bins(bin_gy, most_gy).into_iter().map(move |b| {
            vec![
                (*name).to_owned(),
                format!("{:.4}", b.from_gy),
                format!("{:.4}", b.to_gy),
                format!("{:.4}", b.from_gy / prescription_gy * 100.0),
                cc(b.volume_m3),
                percent(b.volume_m3),
                cc(b.at_least_m3),
                percent(b.at_least_m3),
            ]
        })
    });
    csv(path, &header, rows)
}

/// Writes the measures of an imported dose and of the TG-43U1 dose; an empty field is undefined.
pub fn second_check(path: &Path, measures: &[Checked]) -> Result<(), CommandError> {
    let header = owned(&["measure [unit]", "tg43", "imported", "difference", "difference_percent"]);
    let rows = measures.iter().map(|m| {
        let values = [m.own, m.imported, m.difference(), m.percent()];
        let values = values.map(|v| v.map_or_else(String::new, |v| format!("{v:.6}")));
        [vec![m.name.clone()], values.to_vec()].concat()
    });
    csv(path, &header, rows)
}

pub fn checked_json(measures: &[Checked]) -> Value {
    let of = |m: &Checked| {
        json!({
            "measure": m.name, "tg43": m.own, "imported": m.imported, "difference": m.difference(), "difference_percent": m.percent(),
        })
    };
    measures.iter().map(of).collect()
}

pub fn checked_table(model: &str, measures: &[Checked]) -> String {
    let mut text = format!(
        "{:32} {:>10} {:>10} {:>10} {:>8}",
        "second check", "imported", "TG-43U1", "difference", "%"
    );
    for m in measures {
        let figure = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        let percent = m.percent().map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        let (name, imported, own) = (&m.name, figure(m.imported), figure(m.own));
        text += &format!(
            "\n{name:32} {imported:>10} {own:>10} {:>10} {percent:>8}",
            figure(m.difference())
        );
    }
    text + &format!("\nof seeds of {model}; percents are those of TG-43U1\n")
}

/// Writes the figures of several states, one line each; a field without a figure gives the reason.
pub fn figures(path: &Path, columns: &[&str], rows: &[Row]) -> Result<(), CommandError> {
    let header = [owned(&["group", "figure", "unit"]), owned(columns)].concat();
    let rows = rows.iter().map(|row| {
        let value = |v: &Result<f64, NotComputed>| v.as_ref().map_or_else(ToString::to_string, |v| format!("{v:.6}"));
        let names = [row.group.to_owned(), row.name.clone(), row.unit.to_owned()];
        names.into_iter().chain(row.values.iter().map(value)).collect()
    });
    csv(path, &header, rows)
}

/// Returns the figures as a table for the terminal.
pub fn figure_table(columns: &[&str], rows: &[Row]) -> String {
    let mut text = format!("{:44}", "");
    columns.iter().for_each(|name| text += &format!(" {name:>16}"));
    for row in rows {
        text += &format!("\n{:44}", format!("{} {} {}", row.group, row.name, row.unit));
        for value in &row.values {
            let value = value
                .as_ref()
                .map_or_else(|_| "-".to_owned(), |v| format!("{v:.*}", row.digits));
            text += &format!(" {value:>16}");
        }
    }
    text + "\n"
}

/// Writes the trials; an empty field is a measure that is undefined in that trial.
pub fn trials(
    path: &Path,
    measures: &[(String, Option<f64>)],
    trials: &[(usize, Vec<Option<f64>>)],
) -> Result<(), CommandError> {
    let names = measures.iter().map(|(name, _)| name.clone());
    let header: Vec<String> = std::iter::once("trial".to_owned()).chain(names).collect();
    let rows = trials.iter().map(|(trial, values)| {
        let values = values.iter().map(|v| v.map_or_else(String::new, |v| format!("{v:.6}")));
        std::iter::once(trial.to_string()).chain(values).collect()
    });
    csv(path, &header, rows)
}

pub fn distribution(path: &Path, spreads: &[Spread]) -> Result<(), CommandError> {
    let percentiles = PERCENTILES.map(|p| format!("p{p}"));
    let header: Vec<String> = owned(&["measure [unit]", "planned", "mean", "mean_low", "mean_high", "sd"])
        .into_iter()
        .chain(percentiles)
        .chain(["trials".to_owned()])
        .collect();
    let rows = spreads.iter().map(|s| {
        let planned = s.planned.map_or_else(String::new, |v| format!("{v:.6}"));
        let percentiles = PERCENTILES.iter().enumerate().map(|(i, _)| s.percentiles.map(|p| p[i]));
        let [low, high] = [0, 1].map(|end| s.interval.map(|ends| ends[end]));
        let figures = [s.mean, low, high, s.deviation].into_iter().chain(percentiles);
        [s.name.clone(), planned]
            .into_iter()
            .chain(figures.map(|v| v.map_or_else(String::new, |v| format!("{v:.6}"))))
            .chain([s.defined.to_string()])
            .collect()
    });
    csv(path, &header, rows)
}

pub fn spreads_json(spreads: &[Spread]) -> Value {
    let measures: serde_json::Map<String, Value> = spreads
        .iter()
        .map(|s| {
            let percentiles: serde_json::Map<String, Value> = PERCENTILES
                .iter()
                .enumerate()
                .map(|(i, p)| (format!("p{p}"), json!(s.percentiles.map(|all| all[i]))))
                .collect();
            let value = json!({
                "planned": s.planned, "mean": s.mean, "mean_interval": s.interval, "sd": s.deviation, "trials": s.defined, "percentiles": percentiles,
            });
            (s.name.clone(), value)
        })
        .collect();
    json!({ "measures": measures })
}

pub fn spread_table(spreads: &[Spread]) -> String {
    let wide = spreads.iter().map(|s| s.name.len()).max().unwrap_or(0);
    let mut text = format!(
        "{:wide$} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}\n",
        "", "planned", "mean", "sd", "p5", "p50", "p95"
    );
    for s in spreads {
        let figure = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        let percentile = |i: usize| figure(s.percentiles.map(|all| all[i]));
        text += &format!(
            "{:wide$} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}\n",
            s.name,
            figure(s.planned),
            figure(s.mean),
            figure(s.deviation),
            percentile(0),
            percentile(2),
            percentile(4)
        );
    }
    text
}

/// Writes the share of the trials that meet each criterion, with its 95 % interval.
pub fn criteria(path: &Path, kept: &[CriterionCount]) -> Result<(), CommandError> {
    let header = owned(&["criterion", "met", "trials", "percent", "percent_low", "percent_high"]);
    let rows = kept.iter().map(|k| {
        let percent = |i: usize| k.share().map_or_else(String::new, |s| format!("{:.4}", s[i] * 100.0));
        let count = [k.criterion.to_string(), k.met.to_string(), k.of.to_string()];
        count.into_iter().chain([0, 1, 2].map(percent)).collect()
    });
    csv(path, &header, rows)
}

pub fn criteria_json(kept: &[CriterionCount]) -> Value {
    let of = |k: &CriterionCount| {
        let percent = k.share().map(|s| s.map(|share| share * 100.0));
        json!({
            "criterion": k.criterion.to_string(), "met": k.met, "trials": k.of,
            "percent": percent.map(|p| p[0]), "percent_interval": percent.map(|p| [p[1], p[2]]),
        })
    };
    kept.iter().map(of).collect()
}

pub fn criteria_table(kept: &[CriterionCount]) -> String {
    let mut text = String::new();
    for k in kept {
        let share = k.share().map_or_else(
            || "defined in no trial".to_owned(),
            |s| {
                let [p, low, high] = s.map(|share| share * 100.0);
                format!("{p:.1} % of trials ({low:.1} to {high:.1})")
            },
        );
        text += &format!("{}: {share}\n", k.criterion);
    }
    text
}
