//! One finding about a device: observation, severity and remedy.

/// Severity of a finding.
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
    /// Severity of the finding.
    pub severity: Severity,
    /// Observation.
    pub what: String,
    /// Remedy, with the command to type; empty when there is nothing to do.
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
