//! Published measurements in patients and phantoms, for comparison.

use serde::Deserialize;
use std::sync::LazyLock;

/// One published value; `published.toml` explains the fields.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Distribution of the page in which it is drawn; if empty, it is in the table only.
    #[serde(default)]
    pub shown_in: String,
    /// Measured quantity.
    pub what: String,
    /// Mean or median, as `how` states.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Statistic, range and sample.
    pub how: String,
    /// Source.
    pub source: String,
    /// Use of the value.
    pub used: Use,
    /// Reason why it is comparable or not.
    pub note: String,
}

/// Relation of a published value to the parameters.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Use {
    /// A parameter was fitted to it or set by it, so agreement proves nothing.
    Fitted,
    /// No parameter was fitted to it, so it is a check.
    Check,
    /// Related to the simulation: another organ, needle, or cause.
    Context,
}

impl Use {
    /// Returns the display name.
    pub fn name(self) -> &'static str {
        match self {
            Use::Fitted => "fitted",
            Use::Check => "check",
            Use::Context => "context",
        }
    }
}

#[derive(Deserialize)]
struct File {
    published: Vec<Published>,
}

/// Values with their sources. Those marked as unverified were not compared with the publication.
pub static PUBLISHED: LazyLock<Vec<Published>> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("published.toml")).expect("a test reads it");
    file.published
});

/// Returns the values that are drawn in one distribution.
pub fn published_in(name: &str) -> impl Iterator<Item = &'static Published> {
    PUBLISHED.iter().filter(move |p| p.shown_in == name)
}
