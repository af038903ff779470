//! Reads a table from a Parquet file; columns are found by name.

use crate::columns::{self, FAILURE, MEASURED, PRESCRIPTION, SEED_COLUMNS, SEEDS, TEXTS, WHOLES};
use crate::write::{DEFINITION, FINGERPRINT, QUANTITIES, STUDY};
use crate::{About, Insertion, Motion, Seed, Table, TableError};
use parquet::errors::ParquetError;
use parquet::file::metadata::FileMetaData;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};
use std::collections::HashMap;
use std::fs::File;
use std::path::Path;

/// Reads a file written by [`write`](crate::write).
///
/// # Errors
/// If it is not Parquet, or lacks a column or the name of its study.
pub fn read(path: &Path) -> Result<Table, TableError> {
    let opened = File::open(path).map_err(|source| TableError::Open {
        path: path.to_owned(),
        source,
    })?;
    decode(opened).map_err(|why| TableError::Content {
        path: path.to_owned(),
        why: why.to_string(),
    })
}

fn decode(file: File) -> Result<Table, ParquetError> {
    let reader = SerializedFileReader::new(file)?;
    let about = reader.metadata().file_metadata();
    let quantities = noted(about, QUANTITIES)?;
    let mut table = Table {
        about: About {
            study: noted(about, STUDY)?,
            fingerprint: noted(about, FINGERPRINT)?,
            definition: noted(about, DEFINITION)?,
            made_by: about.created_by().unwrap_or_default().to_owned(),
        },
        quantities: quantities
            .split(',')
            .filter(|name| !name.is_empty())
            .map(str::to_owned)
            .collect(),
        rows: Vec::new(),
    };
    for row in reader.get_row_iter(None)? {
        table.rows.push(insertion(row?, &table.quantities)?);
    }
    Ok(table)
}

fn noted(about: &FileMetaData, key: &str) -> Result<String, ParquetError> {
    let pairs = about.key_value_metadata();
    let pair = pairs.and_then(|pairs| pairs.iter().find(|pair| pair.key == key));
    pair.and_then(|pair| pair.value.clone())
        .ok_or_else(|| ParquetError::General(format!("it does not note {key}")))
}

/// The values of one row, or of one seed, by column.
struct Columns(HashMap<String, Field>);

impl Columns {
    fn of(row: Row) -> Self {
        Self(row.into_columns().into_iter().collect())
    }

    /// Returns the value of a column; `None` if it is null.
    fn optional<T>(&mut self, name: &str, typed: fn(Field) -> Option<T>) -> Result<Option<T>, ParquetError> {
        let value = self.0.remove(name).ok_or_else(|| wrong("it has no column", name))?;
        if value == Field::Null {
            return Ok(None);
        }
        typed(value)
            .map(Some)
            .ok_or_else(|| wrong("it holds another type in column", name))
    }

    fn required<T>(&mut self, name: &str, typed: fn(Field) -> Option<T>) -> Result<T, ParquetError> {
        self.optional(name, typed)?
            .ok_or_else(|| wrong("it lacks a value in column", name))
    }
}

fn insertion(row: Row, quantities: &[String]) -> Result<Insertion, ParquetError> {
    let mut row = Columns::of(row);
    let [id, scene, plan, hole, tissue, source] = TEXTS.map(|(name, _)| row.required(name, text));
    let [implant, needle] = WHOLES.map(|(name, _)| row.required(name, whole));
    let [m0, m1, m2, m3, m4] = MEASURED.map(|(name, _)| row.optional(name, double));
    let m = [m0?, m1?, m2?, m3?, m4?];
    let motion = || {
        Some(Motion {
            peak_force_n: m[0]?,
            displacement_before_puncture_mm: m[1]?,
            largest_displacement_mm: m[2]?,
            target_shift_mm: m[3]?,
            duration_s: m[4]?,
        })
    };
    let failure = row.optional(FAILURE, text)?;
    let drawn = quantities.iter().map(|name| row.required(name, double));
    Ok(Insertion {
        drawn: drawn.collect::<Result<_, _>>()?,
        id: id?,
        scene: scene?,
        plan: plan?,
        implant: implant?,
        needle: needle?,
        hole: hole?,
        tissue: tissue?,
        source: source?,
        prescription_gy: row.required(PRESCRIPTION, double)?,
        outcome: motion().ok_or_else(|| failure.unwrap_or_default()),
        seeds: row
            .required(SEEDS, seeds)?
            .into_iter()
            .map(seed)
            .collect::<Result<_, _>>()?,
    })
}

fn seed(row: Row) -> Result<Seed, ParquetError> {
    let mut row = Columns::of(row);
    let mut values = [None; SEED_COLUMNS.len()];
    for (value, name) in values.iter_mut().zip(SEED_COLUMNS) {
        *value = row.optional(name, double)?;
    }
    columns::seed_of(values).ok_or_else(|| wrong("a seed lacks its planned place in column", SEEDS))
}

fn text(value: Field) -> Option<String> {
    match value {
        Field::Str(text) => Some(text),
        _ => None,
    }
}

fn whole(value: Field) -> Option<i32> {
    match value {
        Field::Int(whole) => Some(whole),
        _ => None,
    }
}

fn double(value: Field) -> Option<f64> {
    match value {
        Field::Double(double) => Some(double),
        _ => None,
    }
}

fn seeds(value: Field) -> Option<Vec<Row>> {
    let Field::ListInternal(list) = value else {
        return None;
    };
    let row = |seed: &Field| match seed {
        Field::Group(row) => Some(row.clone()),
        _ => None,
    };
    list.elements().iter().map(row).collect()
}

fn wrong(what: &str, name: &str) -> ParquetError {
    ParquetError::General(format!("{what} {name}"))
}
