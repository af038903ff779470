//! Seeds and points from CSV; every problem is told with its line.

use super::seed::Seed;
use std::path::Path;
use stylet_files::dicom::plan::PlanSeed;

const MAX_ROWS: usize = 1_000_000;
const MAX_BYTES: u64 = 256 << 20;
const MAX_PROBLEMS: usize = 8;
const COMMENT: u8 = b'#';
const MAX_MM: f64 = 10_000.0;
const MAX_U: f64 = 1e5;
const PLACE: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const AXIS: [&str; 3] = ["axis_x", "axis_y", "axis_z"];

/// What to believe of seeds whose file does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeedDefaults {
    pub strength_u: Option<f64>,
    /// For a column `activity_mci`.
    pub strength_per_activity_u_per_mci: Option<f64>,
}

/// A seed, and the needle that it belongs to where the file says so.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedRow {
    pub seed: Seed,
    /// From 1.
    pub needle: Option<u32>,
    /// Of the template, as it is written.
    pub hole: Option<String>,
}

/// As [`read_seed_rows`], the seeds alone.
pub fn read_seeds(path: &Path, defaults: SeedDefaults) -> Result<Vec<Seed>, String> {
    let rows = read_seed_rows(path, defaults)?;
    Ok(rows.into_iter().map(|row| row.seed).collect())
}

/// Seeds of a file with the columns `x_mm,y_mm,z_mm[,axis_x,axis_y,axis_z][,strength_u|activity_mci][,needle][,hole]`.
///
/// Or those of a DICOM RT Plan, which says their strength itself.
pub fn read_seed_rows(path: &Path, defaults: SeedDefaults) -> Result<Vec<SeedRow>, String> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dcm")) {
        let plan = stylet_files::dicom::plan::open(path)?;
        let seed = |s: PlanSeed| SeedRow {
            seed: Seed {
                position_m: s.position_m,
                axis: s.axis,
                strength_u: s.strength_u,
            },
            needle: None,
            hole: None,
        };
        return Ok(plan.seeds.into_iter().map(seed).collect());
    }
    let known = [
        PLACE.as_slice(),
        &AXIS,
        &["strength_u", "activity_mci", "needle", "hole"],
    ]
    .concat();
    read(path, &known, |row| {
        Ok(SeedRow {
            seed: Seed {
                position_m: position_m(row)?,
                axis: axis(row)?,
                strength_u: strength_u(row, defaults)?,
            },
            needle: needle(row)?,
            hole: row.text("hole").map(str::to_owned),
        })
    })
}

/// Points of a file with the columns `x_mm,y_mm,z_mm`.
pub fn read_points(path: &Path) -> Result<Vec<[f64; 3]>, String> {
    read(path, &PLACE, position_m)
}

/// Doses on a grid; x runs fastest, places in RAS.
pub struct Dosed {
    pub dims: [usize; 3],
    pub origin_m: [f64; 3],
    pub spacing_m: [f64; 3],
    pub dose_gy: Vec<f64>,
}

/// A dose grid as `host-ui dose` writes it: every place of a regular grid, x fastest.
pub fn read_dose(path: &Path) -> Result<Dosed, String> {
    let rows = read(path, &[PLACE.as_slice(), &["dose_gy"]].concat(), |row| {
        let dose = row.number("dose_gy")?.ok_or("dose_gy is empty")?;
        Ok((position_m(row)?, dose))
    })?;
    grid_of(&rows).ok_or_else(|| {
        format!(
            "{}: its places are no grid with x running fastest, as dose_grid.csv has them",
            path.display()
        )
    })
}

fn grid_of(rows: &[([f64; 3], f64)]) -> Option<Dosed> {
    let origin_m = rows.first()?.0;
    let near = |a: f64, b: f64| (a - b).abs() < 2e-7;
    let first_off = |from: usize, axis: usize| (from..rows.len()).find(|&r| !near(rows[r].0[axis], origin_m[axis]));
    let stride_y = first_off(0, 1).unwrap_or(rows.len());
    let stride_z = first_off(0, 2).unwrap_or(rows.len());
    if stride_y > stride_z || !stride_z.is_multiple_of(stride_y) || !rows.len().is_multiple_of(stride_z) {
        return None;
    }
    let dims = [stride_y, stride_z / stride_y, rows.len() / stride_z];
    let last = rows.last()?.0;
    let spacing_m = [0, 1, 2].map(|a| match dims[a] {
        // One layer has no distance to tell; it is as thick as the grid is fine.
        1 => (last[0] - origin_m[0]) / (dims[0].max(2) - 1) as f64,
        n => (last[a] - origin_m[a]) / (n - 1) as f64,
    });
    let fits = |(r, (place, _)): (usize, &([f64; 3], f64))| {
        let at = [r % stride_y, r / stride_y % dims[1], r / stride_z];
        (0..3).all(|a| near(place[a], origin_m[a] + at[a] as f64 * spacing_m[a]))
    };
    let is_grid = spacing_m.iter().all(|s| *s > 0.0) && rows.iter().enumerate().all(fits);
    is_grid.then(|| Dosed {
        dims,
        origin_m,
        spacing_m,
        dose_gy: rows.iter().map(|r| r.1).collect(),
    })
}

/// Numbers of a line by the names of their columns; empty fields are absent.
struct Row<'a> {
    columns: &'a [String],
    record: &'a csv::StringRecord,
}

impl Row<'_> {
    fn text(&self, column: &str) -> Option<&str> {
        let place = self.columns.iter().position(|c| c == column)?;
        self.record.get(place).filter(|text| !text.is_empty())
    }

    fn number(&self, column: &str) -> Result<Option<f64>, String> {
        let Some(text) = self.text(column) else {
            return Ok(None);
        };
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(Some(v)),
            _ => Err(format!("{column} is \"{text}\", not a number")),
        }
    }

    fn three(&self, columns: [&str; 3]) -> Result<[Option<f64>; 3], String> {
        let [a, b, c] = columns.map(|column| self.number(column));
        Ok([a?, b?, c?])
    }
}

fn position_m(row: &Row) -> Result<[f64; 3], String> {
    let [Some(x), Some(y), Some(z)] = row.three(PLACE)? else {
        return Err("x_mm, y_mm or z_mm is empty".to_owned());
    };
    let mm = [x, y, z];
    if let Some(far) = mm.iter().find(|v| v.abs() > MAX_MM) {
        return Err(format!("{far} mm is farther than {MAX_MM} mm from the origin"));
    }
    Ok(mm.map(|v| v * 1e-3))
}

fn axis(row: &Row) -> Result<Option<[f64; 3]>, String> {
    match row.three(AXIS)? {
        [None, None, None] => Ok(None),
        [Some(x), Some(y), Some(z)] => {
            let length = (x * x + y * y + z * z).sqrt();
            if !(1e-6..1e6).contains(&length) {
                return Err(format!(
                    "the axis has the length {length}; give a direction, or leave it empty"
                ));
            }
            Ok(Some([x, y, z].map(|v| v / length)))
        }
        _ => Err("the axis is not complete; give axis_x, axis_y and axis_z, or none of them".to_owned()),
    }
}

fn needle(row: &Row) -> Result<Option<u32>, String> {
    let number = row.text("needle").map(|text| match text.parse() {
        Ok(number @ 1..) => Ok(number),
        _ => Err(format!("needle is \"{text}\", not a whole number from 1")),
    });
    number.transpose()
}

fn strength_u(row: &Row, defaults: SeedDefaults) -> Result<f64, String> {
    let strength = match (row.number("strength_u")?, row.number("activity_mci")?) {
        (Some(_), Some(_)) => return Err("both strength_u and activity_mci are given".to_owned()),
        (Some(u), None) => Some(u),
        (None, Some(mci)) => {
            let per_mci = defaults
                .strength_per_activity_u_per_mci
                .ok_or("activity_mci needs strength_per_activity_u_per_mci in the source file; or give strength_u")?;
            Some(mci * per_mci)
        }
        (None, None) => defaults.strength_u,
    };
    match strength {
        Some(u) if (0.0..=MAX_U).contains(&u) => Ok(u),
        Some(u) => Err(format!("a strength of {u} U; allowed are 0 to {MAX_U}")),
        None => Err("no strength: add a column strength_u or activity_mci, or give --strength-u".to_owned()),
    }
}

fn read<T>(path: &Path, known: &[&str], parse: impl Fn(&Row) -> Result<T, String>) -> Result<Vec<T>, String> {
    let told = |why: String| format!("{}: {why}", path.display());
    let opened = |e: std::io::Error| told(format!("it cannot be opened ({e}); check the path"));
    let size = std::fs::metadata(path).map_err(opened)?.len();
    if size > MAX_BYTES {
        return Err(told(format!("it has {size} bytes, more than {MAX_BYTES}")));
    }
    let text = std::fs::read(path).map_err(opened)?;
    let lines = record_lines(&text);
    let line_of = |record: usize| lines.get(record).copied().unwrap_or(1);
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(COMMENT))
        .from_reader(text.as_slice());
    let columns: Vec<String> = reader
        .headers()
        .map_err(|e| told(format!("line {}: {}", line_of(0), field_count(&e))))?
        .iter()
        .map(|c| c.trim_start_matches('\u{feff}').to_ascii_lowercase())
        .collect();
    check_columns(&columns, known).map_err(|why| told(format!("line {}: {why}", line_of(0))))?;
    let (mut all, mut problems) = (Vec::new(), Vec::new());
    for (index, record) in reader.records().enumerate() {
        if index >= MAX_ROWS {
            return Err(told(format!("it has more than {MAX_ROWS} lines")));
        }
        let found = record.map_err(|e| field_count(&e)).and_then(|record| {
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
        0 if all.is_empty() => Err(told("it has no line beside its header".to_owned())),
        0 => Ok(all),
        1 => Err(told(problems.remove(0))),
        _ => Err(told(format!("\n  {}", problems.join("\n  ")))),
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

fn check_columns(columns: &[String], known: &[&str]) -> Result<(), String> {
    let missing: Vec<&str> = PLACE.into_iter().filter(|c| !columns.iter().any(|x| x == c)).collect();
    if !missing.is_empty() {
        return Err(format!(
            "the header lacks {}; it may have {}",
            missing.join(", "),
            known.join(",")
        ));
    }
    if let Some(twice) = columns.iter().enumerate().find(|(i, c)| columns[..*i].contains(c)) {
        return Err(format!("the column {} is there twice", twice.1));
    }
    match columns.iter().find(|c| !known.contains(&c.as_str())) {
        Some(other) => Err(format!(
            "the column \"{other}\" is not known; there may be {}",
            known.join(",")
        )),
        None => Ok(()),
    }
}
