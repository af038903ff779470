//! One line about a device: what was found, how much it matters, and what to do.

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Nothing to do.
    Good,
    /// Matters for some devices only.
    Note,
    /// Works, but not well.
    Warning,
    /// No device will be found.
    Problem,
}

/// Result of one check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// What was found.
    pub what: String,
    /// What to do, with the command to type; empty when there is nothing to do.
    pub cure: String,
}

impl Finding {
    pub(crate) fn new(severity: Severity, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            severity,
            what: what.into(),
            cure: cure.into(),
        }
    }

    pub(crate) fn good(what: impl Into<String>) -> Self {
        Self::new(Severity::Good, what, "")
    }
}
