//! What is wrong with a setting: every problem is listed with key, value and limit.

use core::fmt;

/// One setting that cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub key: &'static str,
    pub value: f64,
    /// What would be accepted, in words.
    pub limit: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: must be {}", self.key, self.value, self.limit)
    }
}

/// Collects problems. Start-up only: it allocates.
#[derive(Debug, Default)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// `value` must be finite and within `low..=high`.
    pub fn range(&mut self, key: &'static str, value: f64, low: f64, high: f64) {
        if !(low..=high).contains(&value) {
            self.add(key, value, format!("within {low} to {high}"));
        }
    }

    pub fn add(&mut self, key: &'static str, value: f64, limit: String) {
        self.0.push(Problem { key, value, limit });
    }

    pub fn extend(&mut self, other: Result<(), Vec<Problem>>) {
        self.0.extend(other.err().into_iter().flatten());
    }

    pub fn finish(self) -> Result<(), Vec<Problem>> {
        if self.0.is_empty() { Ok(()) } else { Err(self.0) }
    }
}
