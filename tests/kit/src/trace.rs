//! A coarse trace beside a digest: the digest tells that a result changed, the trace tells what and from when on.

use crate::repository;

/// Compares a table with the kept one, to six digits; returns the first difference. `UPDATE_TRACES=1` writes it anew.
///
/// The first line of the table names its columns.
///
/// # Panics
/// If the file cannot be read or written.
pub fn first_difference(path: &str, columns: &[&str], rows: &[Vec<f64>]) -> Option<String> {
    let line = |row: &Vec<f64>| {
        row.iter()
            .map(|value| format!("{value:.5e}"))
            .collect::<Vec<_>>()
            .join(",")
    };
    let lines: Vec<String> = [columns.join(",")].into_iter().chain(rows.iter().map(line)).collect();
    let path = repository(path);
    if std::env::var_os("UPDATE_TRACES").is_some() {
        std::fs::write(&path, lines.join("\n") + "\n").expect("the trace can be written");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    let kept: Vec<&str> = kept.lines().collect();
    let row = (0..kept.len().max(lines.len())).find(|&n| kept.get(n).copied() != lines.get(n).map(String::as_str))?;
    let cells = |line: Option<&str>| {
        line.unwrap_or_default()
            .split(',')
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let (was, is) = (cells(kept.get(row).copied()), cells(lines.get(row).map(String::as_str)));
    let differs = |(name, (was, is)): (&&str, (&String, &String))| (was != is).then(|| format!("{name} {was} -> {is}"));
    let changes: Vec<String> = columns.iter().zip(was.iter().zip(&is)).filter_map(differs).collect();
    Some(format!(
        "row {row} of {} ({}): {}",
        path.display(),
        is.join(","),
        changes.join(", ")
    ))
}
