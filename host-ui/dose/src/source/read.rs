//! Values from a TOML table; all problems are reported together.

use crate::error::DoseError;
use toml::{Table, Value};

/// Every table and key that a source file may have.
const KNOWN: [(&str, &[&str]); 4] = [
    (
        "source",
        &[
            "model",
            "nuclide",
            "half_life_days",
            "dose_rate_constant",
            "active_length_cm",
            "physical_length_cm",
            "physical_diameter_cm",
            "r0_cm",
            "theta0_deg",
            "strength_per_activity_u_per_mci",
            "prescription_gy",
        ],
    ),
    ("radial", &["r_cm", "g_line", "g_point"]),
    ("anisotropy_1d", &["r_cm", "phi_an"]),
    ("anisotropy_2d", &["r_cm", "theta_deg", "F"]),
];
const MAX_ENTRIES: usize = 1000;
/// Rounding allowed for g(1 cm) and F(90 deg), 1 by definition.
const ROUNDING: f64 = 0.005;

pub struct Reader<'a> {
    root: &'a Table,
    problems: Vec<String>,
}

impl<'a> Reader<'a> {
    pub fn new(root: &'a Table) -> Self {
        let mut problems = Vec::new();
        for (name, value) in root {
            let Some((_, keys)) = KNOWN.iter().find(|(table, _)| table == name) else {
                problems.push(format!("{name} is not known here"));
                continue;
            };
            let inner = value.as_table().into_iter().flatten();
            problems.extend(
                inner
                    .filter(|(key, _)| !keys.contains(&key.as_str()))
                    .map(|(key, _)| format!("[{name}] {key} is not known here")),
            );
        }
        Self { root, problems }
    }

    /// Fails with one message that lists all problems, if there are any.
    pub fn finish(self) -> Result<(), DoseError> {
        match self.problems.as_slice() {
            [] => Ok(()),
            [one] => Err(DoseError::Source(one.clone())),
            many => Err(DoseError::Source(format!(
                "{} problems\n  {}",
                many.len(),
                many.join("\n  ")
            ))),
        }
    }

    pub fn problem(&mut self, what: String) {
        self.problems.push(what);
    }

    pub fn has_table(&self, table: &str) -> bool {
        self.root.contains_key(table)
    }

    pub fn has(&self, table: &str, key: &str) -> bool {
        self.value(table, key).is_some()
    }

    fn value(&self, table: &str, key: &str) -> Option<&'a Value> {
        self.root.get(table)?.get(key)
    }

    pub fn text(&mut self, table: &str, key: &str) -> String {
        match self.value(table, key) {
            Some(Value::String(s)) if !s.trim().is_empty() => return s.clone(),
            Some(_) => self.problem(format!("[{table}] {key} must be a name in quotes")),
            None => self.problem(format!("[{table}] {key} is missing")),
        }
        String::new()
    }

    /// Reads a number; returns 1 for an invalid one, so that the rest can still be checked.
    pub fn number(&mut self, table: &str, key: &str, least: f64, most: f64) -> f64 {
        if !self.has(table, key) {
            self.problem(format!("[{table}] {key} is missing"));
        }
        self.optional(table, key, least, most).unwrap_or(1.0)
    }

    pub fn optional(&mut self, table: &str, key: &str, least: f64, most: f64) -> Option<f64> {
        let name = format!("[{table}] {key}");
        self.value(table, key).and_then(|v| self.checked(&name, v, least, most))
    }

    pub fn fixed(&mut self, table: &str, key: &str, expected: f64) {
        let name = format!("[{table}] {key}");
        if let Some(value) = self.value(table, key)
            && number(value) != Some(expected)
        {
            self.problem(format!("{name} = {value}; TG-43 has {expected}"));
        }
    }

    fn checked(&mut self, name: &str, value: &Value, least: f64, most: f64) -> Option<f64> {
        match number(value) {
            Some(v) if (least..=most).contains(&v) => return Some(v),
            Some(v) => self.problem(format!("{name} = {v}; allowed are {least} to {most}")),
            None => self.problem(format!("{name} must be a number")),
        }
        None
    }

    fn list(&mut self, name: &str, value: Option<&Value>, least: f64, most: f64) -> Vec<f64> {
        let Some(Value::Array(items)) = value else {
            self.problem(format!("{name} must be a list of numbers"));
            return Vec::new();
        };
        if items.is_empty() || items.len() > MAX_ENTRIES {
            self.problem(format!(
                "{name} has {} entries; allowed are 1 to {MAX_ENTRIES}",
                items.len()
            ));
            return Vec::new();
        }
        let entry = |i: usize| format!("{name}, entry {}", i + 1);
        (0..items.len())
            .filter_map(|i| self.checked(&entry(i), &items[i], least, most))
            .collect()
    }

    /// Reads a list in which each entry exceeds the one before it.
    pub fn rising(&mut self, table: &str, key: &str, least: f64, most: f64) -> Vec<f64> {
        let name = format!("[{table}] {key}");
        let list = self.list(&name, self.value(table, key), least, most);
        if let Some(i) = list.windows(2).position(|w| w[0] >= w[1]) {
            self.problem(format!("{name} must rise; {} is followed by {}", list[i], list[i + 1]));
        }
        list
    }

    /// Reads a list with one entry for each radius.
    pub fn column(&mut self, table: &str, key: &str, entries: usize, least: f64, most: f64) -> Vec<f64> {
        let name = format!("[{table}] {key}");
        let list = self.list(&name, self.value(table, key), least, most);
        if !list.is_empty() && list.len() != entries {
            self.problem(format!("{name} has {} good entries and r_cm {entries}", list.len()));
        }
        list
    }

    /// Reads a matrix row by row.
    pub fn matrix(&mut self, table: &str, key: &str, rows: usize, columns: usize, least: f64, most: f64) -> Vec<f64> {
        let name = format!("[{table}] {key}");
        let Some(Value::Array(items)) = self.value(table, key) else {
            self.problem(format!("{name} must be a list of rows"));
            return Vec::new();
        };
        if items.len() != rows {
            self.problem(format!("{name} has {} rows and r_cm {rows} entries", items.len()));
        }
        let mut all = Vec::with_capacity(rows * columns);
        for (i, row) in items.iter().enumerate().take(MAX_ENTRIES) {
            let row_name = format!("{name}, row {}", i + 1);
            let list = self.list(&row_name, Some(row), least, most);
            if !list.is_empty() && list.len() != columns {
                self.problem(format!(
                    "{row_name} has {} good entries and theta_deg {columns}",
                    list.len()
                ));
            }
            all.extend(list);
        }
        all
    }

    pub fn must_be_one(&mut self, what: &str, place: &str, value: Option<f64>) {
        if let Some(v) = value
            && (v - 1.0).abs() > ROUNDING
        {
            self.problem(format!("{what} is {v:.4} at {place}, where it is 1 by definition"));
        }
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(v) if v.is_finite() => Some(*v),
        Value::Integer(v) => Some(*v as f64),
        _ => None,
    }
}
