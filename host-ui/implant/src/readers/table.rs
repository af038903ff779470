//! Tables of numbers (CSV): columns by name; every problem is listed with its line.

use super::columns::{self, Column, Mapped};
use std::path::Path;
use stylet_base::format::printable;
use stylet_base::input;
use stylet_files::FileError;

const MAX_ROWS: usize = 1_000_000;
const MAX_BYTES: u64 = 256 << 20;
const MAX_PROBLEMS: usize = 8;
const COMMENT: u8 = b'#';
const MAX_MM: f64 = 10_000.0;
/// Most characters of a field that a message repeats.
const SHOWN_CHARS: usize = 40;
/// Columns of a place.
pub const PLACE: [&str; 3] = ["x_mm", "y_mm", "z_mm"];

/// Reads points from the columns `x_mm,y_mm,z_mm`, in m.
pub fn read_points(path: &Path) -> Result<Vec<[f64; 3]>, FileError> {
    Ok(read(path, &PLACE, &[], |row| row.position_m())?.0)
}

/// Returns the beginning of a field, for a message.
pub fn shown(field: &str) -> String {
    let start: String = printable(field).chars().take(SHOWN_CHARS).collect();
    if field.chars().count() > SHOWN_CHARS {
        start + "..."
    } else {
        start
    }
}

/// Reason why a line was refused.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LineError(String);

impl LineError {
    /// Creates an error from a text that says what was found and what to do.
    pub fn new(why: impl Into<String>) -> Self {
        Self(why.into())
    }
}

/// Numbers of a line by the names of their columns; empty fields are absent.
pub struct Row<'a> {
    columns: &'a [Column],
    record: &'a csv::StringRecord,
    /// Decimal separator of the numbers.
    point: char,
}

impl Row<'_> {
    /// Returns the field, unless it is empty.
    pub fn text(&self, column: &str) -> Option<&str> {
        self.field(column).map(|(text, _)| text)
    }

    /// Returns the field with the factor of its numbers.
    fn field(&self, column: &str) -> Option<(&str, f64)> {
        let place = self.columns.iter().position(|c| c.name == column)?;
        let text = self.record.get(place).filter(|text| !text.is_empty())?;
        Some((text, self.columns[place].factor))
    }

    /// Returns the number in the field, if there is one.
    pub fn number(&self, column: &str) -> Result<Option<f64>, LineError> {
        let Some((text, factor)) = self.field(column) else {
            return Ok(None);
        };
        let parsed = match self.point {
            '.' => text.parse::<f64>(),
            point => text.replacen(point, ".", 1).parse::<f64>(),
        };
        match parsed {
            Ok(v) if v.is_finite() => Ok(Some(v * factor)),
            _ => Err(LineError::new(format!("{column} is \"{}\", not a number", shown(text)))),
        }
    }

    /// Returns three numbers.
    pub fn three(&self, columns: [&str; 3]) -> Result<[Option<f64>; 3], LineError> {
        let [a, b, c] = columns.map(|column| self.number(column));
        Ok([a?, b?, c?])
    }

    /// Returns the place of the line, in m.
    pub fn position_m(&self) -> Result<[f64; 3], LineError> {
        let [Some(x), Some(y), Some(z)] = self.three(PLACE)? else {
            return Err(LineError::new("x_mm, y_mm or z_mm is empty"));
        };
        let mm = [x, y, z];
        if let Some(far) = mm.iter().find(|v| v.abs() > MAX_MM) {
            return Err(LineError::new(format!(
                "{far} mm is farther than {MAX_MM} mm from the origin"
            )));
        }
        Ok(mm.map(|v| v * 1e-3))
    }
}

/// Reads one value for each line, with remarks on the columns. Without a mapping the header may
/// have the columns `known`, or columns that state their quantity and unit, and must have those of
/// a place.
pub fn read<T>(
    path: &Path,
    known: &[&str],
    mapped: &[Mapped],
    parse: impl Fn(&Row) -> Result<T, LineError>,
) -> Result<(Vec<T>, Vec<String>), FileError> {
    let text = input::read(path, MAX_BYTES).map_err(|why| FileError::of(path, why.to_string()))?;
    parse_lines(&text, known, mapped, parse).map_err(|why| FileError::of(path, why.0))
}

/// Returns the separator of the fields, by the header: a comma, a semicolon or a tab.
fn delimiter(text: &[u8]) -> u8 {
    let mut lines = text.split(|&b| b == b'\n');
    let header = lines.find(|line| !matches!(line.first(), None | Some(&b'\r' | &COMMENT)));
    let count = |delimiter: u8| header.unwrap_or_default().iter().filter(|&&b| b == delimiter).count();
    let others = [b';', b'\t'].into_iter().find(|&d| count(d) > count(b','));
    others.unwrap_or(b',')
}

fn parse_lines<T>(
    text: &[u8],
    known: &[&str],
    mapped: &[Mapped],
    parse: impl Fn(&Row) -> Result<T, LineError>,
) -> Result<(Vec<T>, Vec<String>), LineError> {
    let lines = record_lines(text);
    let line_of = |record: usize| lines.get(record).copied().unwrap_or(1);
    let delimiter = delimiter(text);
    // With semicolons numbers may have decimal commas; a table that also has points uses points in
    // its numbers.
    let point = if delimiter == b';' && !text.contains(&b'.') {
        ','
    } else {
        '.'
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(COMMENT))
        .delimiter(delimiter)
        .from_reader(text);
    let headers: Vec<String> = reader
        .headers()
        .map_err(|e| LineError::new(format!("line {}: {}", line_of(0), field_count(&e))))?
        .iter()
        .map(|c| c.trim_start_matches('\u{feff}').to_lowercase())
        .collect();
    let in_header = |why: String| LineError::new(format!("line {}: {why}", line_of(0)));
    let (columns, passed_over) = columns::of_header(&headers, known, mapped).map_err(|why| in_header(why.0))?;
    check_place(&columns, known).map_err(in_header)?;
    let (mut all, mut problems) = (Vec::new(), Vec::new());
    for (index, record) in reader.records().enumerate() {
        if index >= MAX_ROWS {
            return Err(LineError::new(format!("it has more than {MAX_ROWS} lines")));
        }
        let found = record.map_err(|e| LineError(field_count(&e))).and_then(|record| {
            parse(&Row {
                columns: &columns,
                record: &record,
                point,
            })
        });
        match found {
            Ok(value) => all.push(value),
            Err(why) => problems.push(format!("line {}: {why}", line_of(index + 1))),
        }
        if problems.len() == MAX_PROBLEMS {
            problems.push("and perhaps more".to_owned());
            break;
        }
    }
    match problems.len() {
        0 if all.is_empty() => Err(LineError::new("it has no line beside its header".to_owned())),
        0 => Ok((all, notes(&headers, &columns, &passed_over))),
        1 => Err(LineError::new(problems.remove(0))),
        _ => Err(LineError::new(format!("\n  {}", problems.join("\n  ")))),
    }
}

/// Returns the numbers of the lines that hold records: the crate does not count the empty lines and
/// comments that it skips.
fn record_lines(text: &[u8]) -> Vec<usize> {
    let lines = text.split(|&b| b == b'\n').zip(1..);
    let records = lines.filter(|(line, _)| !matches!(line.first(), None | Some(&b'\r' | &COMMENT)));
    records.map(|(_, number)| number).collect()
}

fn field_count(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("it has {len} fields and the header {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "it is not text (UTF-8)".to_owned(),
        other => format!("it cannot be read ({other:?})"),
    }
}

fn check_place(columns: &[Column], known: &[&str]) -> Result<(), String> {
    let missing: Vec<&str> = PLACE
        .into_iter()
        .filter(|name| !columns.iter().any(|column| column.name == *name))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(format!(
        "the header lacks {}; it may have {}, or say which columns they are with --column",
        missing.join(", "),
        known.join(",")
    ))
}

/// Reports columns with other names, and skipped ones.
fn notes(headers: &[String], columns: &[Column], passed_over: &[String]) -> Vec<String> {
    let renamed = headers.iter().zip(columns);
    let renamed: Vec<String> = renamed
        .filter(|(header, column)| !column.name.is_empty() && **header != column.name)
        .map(|(header, column)| match column.factor {
            1.0 => format!("\"{}\" as {}", shown(header), column.name),
            factor => format!("\"{}\" times {factor} as {}", shown(header), column.name),
        })
        .collect();
    let mut notes = Vec::new();
    if !renamed.is_empty() {
        notes.push(format!("columns are taken: {}", renamed.join(", ")));
    }
    if !passed_over.is_empty() {
        notes.push(format!("columns are skipped: {}", passed_over.join(", ")));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against a message that repeated a field of 50 MB.
    #[test]
    fn messages_shorten_fields_and_drop_escape_sequences() {
        let text = format!("x_mm,y_mm,z_mm\n1,2,\u{1b}[31m{}\n", "9x".repeat(25_000_000));
        let why = parse_lines(text.as_bytes(), &PLACE, &[], |row| row.position_m())
            .unwrap_err()
            .0;
        assert!(
            why.len() < 200 && why.starts_with("line 2: z_mm is \"[31m9x"),
            "{} characters",
            why.len()
        );
        let header = format!("x_mm,y_mm,z_mm,{}\n1,2,3,4\n", "q".repeat(1000));
        let why = parse_lines(header.as_bytes(), &PLACE, &[], |row| row.position_m())
            .unwrap_err()
            .0;
        assert!(why.len() < 200, "{why}");
    }

    /// Guards against the refusal of a table of another program whose columns state their units.
    #[test]
    fn tables_of_other_programs_are_read_with_their_units() {
        let comma = "# exported\nNeedle #;X (cm);Y (cm);Z (cm)\n1;-0,35;2,5;1e1\n";
        let tabs = "needle\tx_mm\ty_cm\tSeed Z (m)\n1\t-3.5\t2.5\t0.1\n";
        for text in [comma, tabs] {
            let known = [PLACE.as_slice(), &["needle"]].concat();
            let (places, notes) = parse_lines(text.as_bytes(), &known, &[], |row| row.position_m()).unwrap();
            let expected = [-3.5e-3, 25e-3, 100e-3];
            assert!((0..3).all(|a| (places[0][a] - expected[a]).abs() < 1e-12), "{places:?}");
            assert!(notes[0].starts_with("columns are taken: "), "{notes:?}");
        }
    }
}
