//! Problems of settings: each is listed with key, value and limit.

use core::fmt;

/// One setting that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{key} = {value}: must be {limit}{}", Advice(.advice))]
pub struct Problem {
    /// Name of the setting.
    pub key: &'static str,
    /// Its value, in the unit that the key names.
    pub value: f64,
    /// Values that would be accepted, in words.
    pub limit: String,
    /// Remedy, or meaning of the limit; may be empty.
    pub advice: &'static str,
}

/// Written behind a problem, in parentheses; nothing where there is none.
struct Advice<'a>(&'a str);

impl fmt::Display for Advice<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            "" => Ok(()),
            advice => write!(f, " ({advice})"),
        }
    }
}

/// Collects problems. Start-up only: it allocates.
#[derive(Debug, Default)]
pub(crate) struct Problems(Vec<Problem>);

impl Problems {
    /// Reports `value` unless it is finite and within `low..=high`.
    pub fn range(&mut self, key: &'static str, value: f64, low: f64, high: f64) {
        let is_inside = (low..=high).contains(&value);
        self.unless(is_inside, key, value, &format!("within {low} to {high}"), "");
    }

    /// Reports a problem with `key`, unless `holds`.
    pub fn unless(&mut self, holds: bool, key: &'static str, value: f64, limit: &str, advice: &'static str) {
        if !holds {
            self.0.push(Problem {
                key,
                value,
                limit: limit.to_owned(),
                advice,
            });
        }
    }

    pub fn extend(&mut self, other: Result<(), Vec<Problem>>) {
        self.0.extend(other.err().into_iter().flatten());
    }

    pub fn finish(self) -> Result<(), Vec<Problem>> {
        if self.0.is_empty() { Ok(()) } else { Err(self.0) }
    }
}
