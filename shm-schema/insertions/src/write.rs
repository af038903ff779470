//! Writes a table to a Parquet file, which gets its name only once it is complete.

use crate::columns::{self, MEASURED, PLANNED, SEED_COLUMNS, TEXTS, WHOLES};
use crate::{Insertion, Table, TableError};
use parquet::basic::Compression;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use std::path::Path;
use std::sync::Arc;
use stylet_write::write_whole;

pub const STUDY: &str = "stylet.study";
pub const FINGERPRINT: &str = "stylet.fingerprint";
pub const DEFINITION: &str = "stylet.definition";
pub const QUANTITIES: &str = "stylet.quantities";

/// Writes all rows; the same table gives the same bytes.
///
/// # Errors
/// If a quantity cannot be a column, or the disk refuses the file.
pub fn write(path: &Path, table: &Table) -> Result<(), TableError> {
    let mut bytes = Vec::new();
    encode(&mut bytes, table)?;
    Ok(write_whole(path, &bytes)?)
}

type Group<'a, 'b> = SerializedRowGroupWriter<'a, &'b mut Vec<u8>>;

fn encode(bytes: &mut Vec<u8>, table: &Table) -> Result<(), ParquetError> {
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let about = &table.about;
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(about.made_by.clone())
        .set_key_value_metadata(Some(vec![
            pair(STUDY, about.study.clone()),
            pair(FINGERPRINT, about.fingerprint.clone()),
            pair(DEFINITION, about.definition.clone()),
            pair(QUANTITIES, table.quantities.join(",")),
        ]));
    let schema = columns::schema(&table.quantities)?;
    let mut file = SerializedFileWriter::new(bytes, schema, Arc::new(properties.build()))?;
    let mut group = file.next_row_group()?;
    for (_, text) in TEXTS {
        texts(&mut group, table.rows.iter().map(|row| Some(text(row))), false)?;
    }
    for (_, whole) in WHOLES {
        let values: Vec<i32> = table.rows.iter().map(whole).collect();
        column::<Int32Type>(&mut group, &values, None, None)?;
    }
    let prescriptions: Vec<f64> = table.rows.iter().map(|row| row.prescription_gy).collect();
    column::<DoubleType>(&mut group, &prescriptions, None, None)?;
    for (n, name) in table.quantities.iter().enumerate() {
        let lacks = || ParquetError::General(format!("a row has no value of {name}"));
        let values = table.rows.iter().map(|row| row.drawn.get(n).copied().ok_or_else(lacks));
        column::<DoubleType>(&mut group, &values.collect::<Result<Vec<_>, _>>()?, None, None)?;
    }
    for (_, measured) in MEASURED {
        let values: Vec<Option<f64>> = table
            .rows
            .iter()
            .map(|row| row.outcome.as_ref().ok().map(measured))
            .collect();
        let levels: Vec<i16> = values.iter().map(|v| i16::from(v.is_some())).collect();
        let values: Vec<f64> = values.into_iter().flatten().collect();
        column::<DoubleType>(&mut group, &values, Some(&levels), None)?;
    }
    let failures = table
        .rows
        .iter()
        .map(|row| row.outcome.as_ref().err().map(String::as_str));
    texts(&mut group, failures, true)?;
    for field in 0..SEED_COLUMNS.len() {
        seeds(&mut group, &table.rows, field)?;
    }
    group.close()?;
    file.close()?;
    Ok(())
}

fn texts<'t>(
    group: &mut Group,
    texts: impl Iterator<Item = Option<&'t str>>,
    optional: bool,
) -> Result<(), ParquetError> {
    let texts: Vec<Option<&str>> = texts.collect();
    let levels: Vec<i16> = texts.iter().map(|text| i16::from(text.is_some())).collect();
    let values: Vec<ByteArray> = texts.into_iter().flatten().map(ByteArray::from).collect();
    column::<ByteArrayType>(group, &values, optional.then_some(&levels), None)
}

/// Writes one field of all seeds. A list without seeds has a definition level at which nothing is defined.
fn seeds(group: &mut Group, rows: &[Insertion], field: usize) -> Result<(), ParquetError> {
    let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
    for row in rows {
        for (n, seed) in row.seeds.iter().enumerate() {
            let value = columns::seed_values(seed)[field];
            repeated.push(i16::from(n > 0));
            defined.push(if field < PLANNED {
                1
            } else {
                1 + i16::from(value.is_some())
            });
            values.extend(value);
        }
        if row.seeds.is_empty() {
            repeated.push(0);
            defined.push(0);
        }
    }
    column::<DoubleType>(group, &values, Some(&defined), Some(&repeated))
}

/// Columns come in the order of the schema.
fn column<T: DataType>(
    group: &mut Group,
    values: &[T::T],
    defined: Option<&Vec<i16>>,
    repeated: Option<&Vec<i16>>,
) -> Result<(), ParquetError> {
    let end = || ParquetError::General("the schema has fewer columns than there are values for".to_owned());
    let mut column = group.next_column()?.ok_or_else(end)?;
    let (defined, repeated) = (defined.map(Vec::as_slice), repeated.map(Vec::as_slice));
    column.typed::<T>().write_batch(values, defined, repeated)?;
    column.close()
}
