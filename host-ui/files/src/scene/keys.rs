//! Values from a TOML table by name; invalid and unknown ones are collected.

use std::path::PathBuf;
use toml::{Table, Value};

pub struct Keys<'a, 'p> {
    table: &'a Table,
    /// Place of the table, for messages.
    place: String,
    problems: &'p mut Vec<String>,
}

impl<'a, 'p> Keys<'a, 'p> {
    pub fn new(table: &'a Table, place: String, problems: &'p mut Vec<String>) -> Self {
        Self { table, place, problems }
    }

    pub fn problem(&mut self, key: &str, what: &str) {
        self.problems.push(format!("{}{key} {what}", self.place));
    }

    pub fn only(&mut self, known: &[&str]) {
        for key in self.table.keys().filter(|k| !known.contains(&k.as_str())) {
            let key = super::super::element::short(key);
            self.problems.push(format!(
                "{}{key} is not known here; there may be {}",
                self.place,
                known.join(", ")
            ));
        }
    }

    pub fn text(&mut self, key: &str) -> Option<String> {
        match self.table.get(key)? {
            Value::String(s) if !s.trim().is_empty() => Some(s.trim().to_owned()),
            _ => {
                self.problem(key, "must be a text in quotes");
                None
            }
        }
    }

    pub fn path(&mut self, key: &str) -> Option<PathBuf> {
        if !self.table.contains_key(key) {
            self.problem(key, "is missing");
        }
        self.text(key).map(PathBuf::from)
    }

    /// Returns a text, or a list of texts.
    pub fn words(&mut self, key: &str) -> Option<Vec<String>> {
        match self.table.get(key)? {
            Value::Array(list) => {
                let words: Option<Vec<String>> = list.iter().map(|v| v.as_str().map(str::to_owned)).collect();
                if words.is_none() {
                    self.problem(key, "must be a list of texts in quotes");
                }
                words
            }
            _ => self.text(key).map(|word| vec![word]),
        }
    }

    pub fn yes(&mut self, key: &str) -> Option<bool> {
        let value = self.table.get(key)?.as_bool();
        if value.is_none() {
            self.problem(key, "must be true or false");
        }
        value
    }

    pub fn number(&mut self, key: &str, least: f64, most: f64) -> Option<f64> {
        let value = number(self.table.get(key)?);
        if value.is_none_or(|v| !(least..=most).contains(&v)) {
            self.problem(key, &format!("must be a number from {least} to {most}"));
            return None;
        }
        value
    }

    pub fn numbers<const N: usize>(&mut self, key: &str, least: f64, most: f64) -> Option<[f64; N]> {
        let list = self.table.get(key)?.as_array();
        let values: Option<Vec<f64>> = list.and_then(|l| l.iter().map(number).collect());
        let values = values.filter(|v| v.iter().all(|x| (least..=most).contains(x)));
        let values = values.and_then(|v| <[f64; N]>::try_from(v).ok());
        if values.is_none() {
            self.problem(key, &format!("must be a list of {N} numbers from {least} to {most}"));
        }
        values
    }

    pub fn table<T>(&mut self, key: &str, read: impl FnOnce(&mut Keys) -> Option<T>) -> Option<T> {
        match self.table.get(key)? {
            Value::Table(table) => read(&mut Keys::new(table, format!("[{key}] "), self.problems)),
            _ => {
                self.problem(key, &format!("must be a table: [{key}]"));
                None
            }
        }
    }

    /// Returns a list of tables.
    pub fn tables<T>(&mut self, key: &str, most: usize, read: impl Fn(&mut Keys) -> Option<T>) -> Vec<T> {
        let Some(value) = self.table.get(key) else {
            return Vec::new();
        };
        let Some(list) = value.as_array().filter(|l| l.len() <= most) else {
            self.problem(key, &format!("must be a list of at most {most} tables: [[{key}]]"));
            return Vec::new();
        };
        let mut all = Vec::new();
        for (item, number) in list.iter().zip(1..) {
            match item {
                Value::Table(table) => {
                    all.extend(read(&mut Keys::new(
                        table,
                        format!("[[{key}]] {number}: "),
                        self.problems,
                    )));
                }
                _ => self.problem(key, &format!("must be a list of tables: [[{key}]]")),
            }
        }
        all
    }
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(v) if v.is_finite() => Some(*v),
        Value::Integer(v) => Some(*v as f64),
        _ => None,
    }
}
