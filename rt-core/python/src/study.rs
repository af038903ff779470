//! Population studies, as `rt-core study` runs them.

use crate::arrays;
use crate::work::{interruptible, refused};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;
use stylet_insertions::{Insertion, MEASURED, Seed, Shard, Table, digest};
use stylet_study::{Ended, Order, Progress, Study};

type Text = (&'static str, fn(&Insertion) -> &str);
type Whole = (&'static str, fn(&Insertion) -> i32);

/// Runs a study file into a folder, and returns its rows.
///
/// :param file: the study (TOML, as of ``rt-core study --help``), with plans relative to it.
/// :param folder: gets the Parquet file of the rows. Rows that are there are not run again; another study is refused.
/// :param jobs: threads; as many as there are cores without it.
/// :returns: a dict. ``insertions`` has a column for each quantity, one value an insertion: texts as lists, numbers as
///     arrays of shape (N,), NaN and a text in ``failure`` where the insertion failed. ``seeds`` has one row for each
///     seed: ``insertion``, the number of its row, of shape (M,), ``planned_mm``, ``rest_mm``, ``rest_axis`` of shape
///     (M, 3), ``strength_u``, ``dropped_after_s`` of shape (M,). ``digest`` is the SHA-256 of all rows that the
///     program prints; whatever the threads, the same study gives the same.
/// :raises ValueError: everything that is wrong with study, plans or folder.
///
/// >>> rows = stylet.study("paper.toml", "out/paper")
/// >>> pandas.DataFrame(rows["insertions"])
#[pyfunction]
#[pyo3(signature = (file, folder, *, jobs=None))]
pub fn study(
    py: Python<'_>,
    file: PathBuf,
    folder: PathBuf,
    jobs: Option<NonZeroUsize>,
) -> PyResult<Bound<'_, PyDict>> {
    let study = Study::read(&file).map_err(refused)?;
    let cores = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    let order = Order {
        shard: Shard::WHOLE,
        folder,
        jobs: jobs.unwrap_or(cores),
    };
    let progress = Progress::new(Duration::MAX);
    let ended = interruptible(py, |stop| stylet_study::run(&study, &order, stop, &progress))?;
    match ended.map_err(refused)? {
        Ended::Before(table) | Ended::Now { table, .. } => into_dict(py, &table),
        Ended::Stopped { .. } => Err(PyKeyboardInterrupt::new_err(())),
    }
}

fn into_dict<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("study", &table.about.study)?;
    dict.set_item("fingerprint", &table.about.fingerprint)?;
    dict.set_item("digest", digest(table))?;
    dict.set_item("insertions", insertions(py, table)?)?;
    dict.set_item("seeds", seeds(py, table)?)?;
    Ok(dict)
}

fn insertions<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let texts: [Text; 6] = [
        ("id", |row| &row.id),
        ("scene", |row| &row.scene),
        ("plan", |row| &row.plan),
        ("hole", |row| &row.hole),
        ("tissue", |row| &row.tissue),
        ("source", |row| &row.source),
    ];
    for (name, of) in texts {
        columns.set_item(name, table.rows.iter().map(of).collect::<Vec<_>>())?;
    }
    let wholes: [Whole; 2] = [("implant", |row| row.implant), ("needle", |row| row.needle)];
    for (name, of) in wholes {
        columns.set_item(name, arrays::column(py, table.rows.iter().map(of).collect()))?;
    }
    let number = |of: &dyn Fn(&Insertion) -> f64| arrays::column(py, table.rows.iter().map(of).collect());
    columns.set_item("prescription_gy", number(&|row| row.prescription_gy))?;
    for (n, name) in table.quantities.iter().enumerate() {
        columns.set_item(name, number(&|row| row.drawn.get(n).copied().unwrap_or(f64::NAN)))?;
    }
    for (name, of) in MEASURED {
        columns.set_item(name, number(&|row| row.outcome.as_ref().map_or(f64::NAN, of)))?;
    }
    let failure = |row: &Insertion| row.outcome.as_ref().err().cloned();
    columns.set_item("failure", table.rows.iter().map(failure).collect::<Vec<_>>())?;
    Ok(columns)
}

fn seeds<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyDict>> {
    let rows = table.rows.iter().enumerate();
    let all: Vec<(i64, &Seed)> = rows
        .flat_map(|(n, row)| row.seeds.iter().map(move |seed| (n as i64, seed)))
        .collect();
    let three = |of: &dyn Fn(&Seed) -> [f64; 3]| arrays::table(py, all.iter().map(|(_, seed)| of(seed)), 1.0);
    let one = |of: &dyn Fn(&Seed) -> f64| arrays::column(py, all.iter().map(|(_, seed)| of(seed)).collect());
    let columns = PyDict::new(py);
    columns.set_item("insertion", arrays::column(py, all.iter().map(|(n, _)| *n).collect()))?;
    columns.set_item("planned_mm", three(&|seed| seed.planned_mm))?;
    columns.set_item("strength_u", one(&|seed| seed.strength_u))?;
    columns.set_item(
        "rest_mm",
        three(&|seed| seed.rest.map_or([f64::NAN; 3], |rest| rest.at_mm)),
    )?;
    columns.set_item(
        "rest_axis",
        three(&|seed| seed.rest.map_or([f64::NAN; 3], |rest| rest.axis)),
    )?;
    let after = |seed: &Seed| seed.rest.map_or(f64::NAN, |rest| rest.dropped_after_s);
    columns.set_item("dropped_after_s", one(&after))?;
    Ok(columns)
}
