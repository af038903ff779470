//! Reads a table from a Parquet file; columns are found by name.

use crate::columns::{self, FAILURE, MEASURED, PRESCRIPTION, SEED_COLUMNS, SEEDS, TEXTS, WHOLES};
use crate::write::{DEFINITION, FINGERPRINT, QUANTITIES, STUDY};
use crate::{About, Insertion, Motion, Seed, Table, TableError};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::FileMetaData;
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
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
    for n in 0..reader.num_row_groups() {
        let group = Group(reader.get_row_group(n)?);
        table.rows.extend(group.rows(&table.quantities)?);
    }
    Ok(table)
}

fn noted(about: &FileMetaData, key: &str) -> Result<String, ParquetError> {
    let pairs = about.key_value_metadata();
    let pair = pairs.and_then(|pairs| pairs.iter().find(|pair| pair.key == key));
    pair.and_then(|pair| pair.value.clone())
        .ok_or_else(|| ParquetError::General(format!("it does not note {key}")))
}

struct Group<'a>(Box<dyn RowGroupReader + 'a>);

/// Non-null values, with the definition and repetition level of each entry.
struct Column<T> {
    values: Vec<T>,
    defined: Vec<i16>,
    repeated: Vec<i16>,
}

impl Group<'_> {
    fn rows(&self, quantities: &[String]) -> Result<Vec<Insertion>, ParquetError> {
        let texts = TEXTS.iter().map(|(name, _)| self.required::<ByteArrayType>(name));
        let texts: Vec<_> = texts.collect::<Result<_, _>>()?;
        let wholes = WHOLES.iter().map(|(name, _)| self.required::<Int32Type>(name));
        let wholes: Vec<_> = wholes.collect::<Result<_, _>>()?;
        let prescriptions = self.required::<DoubleType>(PRESCRIPTION)?;
        let drawn = quantities.iter().map(|name| self.required::<DoubleType>(name));
        let drawn: Vec<_> = drawn.collect::<Result<_, _>>()?;
        let measured = MEASURED.iter().map(|(name, _)| self.optional::<DoubleType>(name));
        let measured: Vec<_> = measured.collect::<Result<_, _>>()?;
        let failures = self.optional::<ByteArrayType>(FAILURE)?;
        let row = |(i, seeds): (usize, Vec<Seed>)| {
            let text = |column: usize| Some(plain(texts[column].get(i)?));
            let measured = measured.iter().map(|column| column.get(i).copied());
            let measured = measured.collect::<Option<Vec<Option<f64>>>>()?;
            let failure = failures.get(i)?.as_ref().map(plain);
            let motion = || {
                Some(Motion {
                    peak_force_n: measured[0]?,
                    displacement_before_puncture_mm: measured[1]?,
                    largest_displacement_mm: measured[2]?,
                    target_shift_mm: measured[3]?,
                    duration_s: measured[4]?,
                })
            };
            Some(Insertion {
                id: text(0)?,
                scene: text(1)?,
                plan: text(2)?,
                hole: text(3)?,
                tissue: text(4)?,
                source: text(5)?,
                implant: *wholes[0].get(i)?,
                needle: *wholes[1].get(i)?,
                prescription_gy: *prescriptions.get(i)?,
                drawn: drawn
                    .iter()
                    .map(|column| column.get(i).copied())
                    .collect::<Option<_>>()?,
                outcome: motion().ok_or_else(|| failure.unwrap_or_default()),
                seeds,
            })
        };
        let rows: Option<Vec<Insertion>> = self.seeds()?.into_iter().enumerate().map(row).collect();
        let short = || ParquetError::General("a column is shorter than the file".to_owned());
        rows.filter(|rows| rows.len() as i64 == self.0.metadata().num_rows())
            .ok_or_else(short)
    }

    fn column<T: DataType>(&self, path: &str) -> Result<Column<T::T>, ParquetError> {
        let about = self.0.metadata();
        let place = about.columns().iter().position(|c| c.column_path().string() == path);
        let place = place.ok_or_else(|| ParquetError::General(format!("it has no column {path}")))?;
        let found = about.column(place).column_type();
        if found != T::get_physical_type() {
            return Err(ParquetError::General(format!(
                "column {path} holds {found}; it must hold {}",
                T::get_physical_type()
            )));
        }
        let mut reader = get_typed_column_reader::<T>(self.0.get_column_reader(place)?);
        let mut column = Column {
            values: Vec::new(),
            defined: Vec::new(),
            repeated: Vec::new(),
        };
        loop {
            let (records, _, _) = reader.read_records(
                about.num_rows() as usize,
                Some(&mut column.defined),
                Some(&mut column.repeated),
                &mut column.values,
            )?;
            if records == 0 {
                return Ok(column);
            }
        }
    }

    fn required<T: DataType>(&self, path: &str) -> Result<Vec<T::T>, ParquetError> {
        Ok(self.column::<T>(path)?.values)
    }

    fn optional<T: DataType>(&self, path: &str) -> Result<Vec<Option<T::T>>, ParquetError> {
        let column = self.column::<T>(path)?;
        let mut values = column.values.into_iter();
        Ok(column
            .defined
            .iter()
            .map(|&d| if d == 1 { values.next() } else { None })
            .collect())
    }

    /// Returns the seeds of each row.
    fn seeds(&self) -> Result<Vec<Vec<Seed>>, ParquetError> {
        let mut rows: Vec<Vec<[Option<f64>; SEED_COLUMNS.len()]>> = Vec::new();
        for (field, name) in SEED_COLUMNS.iter().enumerate() {
            let column = self.column::<DoubleType>(&format!("{SEEDS}.list.element.{name}"))?;
            let full = if field < columns::PLANNED { 1 } else { 2 };
            let mut values = column.values.into_iter();
            let (mut row, mut place) = (0, 0);
            for (n, (&defined, &repeated)) in column.defined.iter().zip(&column.repeated).enumerate() {
                if repeated == 0 {
                    row += usize::from(n > 0);
                    place = 0;
                }
                if rows.len() <= row {
                    rows.push(Vec::new());
                }
                if defined == 0 {
                    continue;
                }
                if rows[row].len() <= place {
                    rows[row].push([None; SEED_COLUMNS.len()]);
                }
                rows[row][place][field] = if defined == full { values.next() } else { None };
                place += 1;
            }
        }
        let lacks = || ParquetError::General("a seed lacks its planned place".to_owned());
        let of_row = |row: Vec<_>| {
            row.into_iter()
                .map(|seed| columns::seed_of(seed).ok_or_else(lacks))
                .collect()
        };
        rows.into_iter().map(of_row).collect()
    }
}

fn plain(text: &ByteArray) -> String {
    String::from_utf8_lossy(text.data()).into_owned()
}
