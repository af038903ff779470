//! Tables of numbers (CSV): columns by name, and every problem listed with its line.

use std::path::Path;
use stylet_base::format::printable;
use stylet_base::input;
use stylet_files::FileError;

const MAX_ROWS: usize = 1_000_000;
const MAX_BYTES: u64 = 256 << 20;
const MAX_PROBLEMS: usize = 8;
const COMMENT: u8 = b'#';
const MAX_MM: f64 = 10_000.0;
/// Characters of a field that a message repeats.
const SHOWN_CHARS: usize = 40;
/// Columns of a place.
pub const PLACE: [&str; 3] = ["x_mm", "y_mm", "z_mm"];

/// Points of a file with the columns `x_mm,y_mm,z_mm`, in m.
pub fn read_points(path: &Path) -> Result<Vec<[f64; 3]>, FileError> {
    read(path, &PLACE, |row| row.position_m())
}

/// The beginning of a field, for a message.
pub fn shown(field: &str) -> String {
    let start: String = printable(field).chars().take(SHOWN_CHARS).collect();
    if field.chars().count() > SHOWN_CHARS {
        start + "..."
    } else {
        start
    }
}

/// Why a line was refused.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LineError(String);

impl LineError {
    /// From a text that says what was found and what to do.
    pub fn new(why: impl Into<String>) -> Self {
        Self(why.into())
    }
}

/// Numbers of a line by the names of their columns; empty fields are absent.
pub struct Row<'a> {
    columns: &'a [String],
    record: &'a csv::StringRecord,
}

impl Row<'_> {
    /// The field, where there is one that is not empty.
    pub fn text(&self, column: &str) -> Option<&str> {
        let place = self.columns.iter().position(|c| c == column)?;
        self.record.get(place).filter(|text| !text.is_empty())
    }

    /// The number in the field, where there is one.
    pub fn number(&self, column: &str) -> Result<Option<f64>, LineError> {
        let Some(text) = self.text(column) else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(Some(v)),
            _ => Err(LineError::new(format!("{column} is \"{}\", not a number", shown(text)))),
        }
    }

    /// Three numbers.
    pub fn three(&self, columns: [&str; 3]) -> Result<[Option<f64>; 3], LineError> {
        let [a, b, c] = columns.map(|column| self.number(column));
        Ok([a?, b?, c?])
    }

    /// The place of the line, in m.
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

/// One value for each line; the header may have the columns `known` and must have those of a place.
pub fn read<T>(path: &Path, known: &[&str], parse: impl Fn(&Row) -> Result<T, LineError>) -> Result<Vec<T>, FileError> {
    let text = input::read(path, MAX_BYTES).map_err(|why| FileError::of(path, why.to_string()))?;
    parse_lines(&text, known, parse).map_err(|why| FileError::of(path, why.0))
}

fn parse_lines<T>(
    text: &[u8],
    known: &[&str],
    parse: impl Fn(&Row) -> Result<T, LineError>,
) -> Result<Vec<T>, LineError> {
    let lines = record_lines(text);
    let line_of = |record: usize| lines.get(record).copied().unwrap_or(1);
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(COMMENT))
        .from_reader(text);
    let columns: Vec<String> = reader
        .headers()
        .map_err(|e| LineError::new(format!("line {}: {}", line_of(0), field_count(&e))))?
        .iter()
        .map(|c| c.trim_start_matches('\u{feff}').to_ascii_lowercase())
        .collect();
    check_columns(&columns, known).map_err(|why| LineError::new(format!("line {}: {why}", line_of(0))))?;
    let (mut all, mut problems) = (Vec::new(), Vec::new());
    for (index, record) in reader.records().enumerate() {
        if index >= MAX_ROWS {
            return Err(LineError::new(format!("it has more than {MAX_ROWS} lines")));
        }
        let found = record.map_err(|e| LineError(field_count(&e))).and_then(|record| {
            parse(&Row {
                columns: &columns,
                record: &record,
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
        0 => Ok(all),
        1 => Err(LineError::new(problems.remove(0))),
        _ => Err(LineError::new(format!("\n  {}", problems.join("\n  ")))),
    }
}

/// Numbers of the lines that hold records: the crate's own count stops before the empty lines and comments that it skips.
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

fn check_columns(columns: &[String], known: &[&str]) -> Result<(), LineError> {
    let missing: Vec<&str> = PLACE.into_iter().filter(|c| !columns.iter().any(|x| x == c)).collect();
    if !missing.is_empty() {
        return Err(LineError(format!(
            "the header lacks {}; it may have {}",
            missing.join(", "),
            known.join(",")
        )));
    }
    if let Some(twice) = columns.iter().enumerate().find(|(i, c)| columns[..*i].contains(c)) {
        return Err(LineError(format!("the column {} is there twice", shown(twice.1))));
    }
    match columns.iter().find(|c| !known.contains(&c.as_str())) {
        Some(other) => Err(LineError(format!(
            "the column \"{}\" is not known; there may be {}",
            shown(other),
            known.join(",")
        ))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of 50 MB was repeated whole in the message.
    #[test]
    fn a_message_repeats_only_the_beginning_of_a_field_and_no_escape_sequence() {
        let text = format!("x_mm,y_mm,z_mm\n1,2,\u{1b}[31m{}\n", "9x".repeat(25_000_000));
        let why = parse_lines(text.as_bytes(), &PLACE, |row| row.position_m())
            .unwrap_err()
            .0;
        assert!(
            why.len() < 200 && why.starts_with("line 2: z_mm is \"[31m9x"),
            "{} characters",
            why.len()
        );
        let header = format!("x_mm,y_mm,z_mm,{}\n1,2,3,4\n", "q".repeat(1000));
        let why = parse_lines(header.as_bytes(), &PLACE, |row| row.position_m())
            .unwrap_err()
            .0;
        assert!(why.len() < 200, "{why}");
    }
}
