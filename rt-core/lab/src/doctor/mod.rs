//! `rt-core doctor`: checks whether this PC is fit for a 1 kHz force loop, and lists the commands that improve it.
//!
//! Each check is a function of a `Machine` and the core of the force loop; all of them read below a root path, so that
//! tests can present any machine to them.

mod cores;
mod display;
mod kernel;
mod mend;
mod rights;
mod shared;
#[cfg(test)]
mod tests;
mod tunable;

pub use mend::{DoctorArgs, MendError, run};

use crate::machine::Machine;
use serde::Serialize;

/// Severity of a finding, least first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FindingLevel {
    /// Nothing to do.
    Good,
    /// Worth knowing; nothing to do.
    Note,
    /// The tail will be worse than it could be.
    Warning,
    /// The force loop cannot run properly, or its figures prove nothing.
    Blocker,
}

impl FindingLevel {
    fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Blocker => "BLOCKER",
        }
    }
}

/// One line of the doctor.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Stable name of the check.
    pub check: &'static str,
    /// Severity.
    pub severity: FindingLevel,
    /// Finding, for people.
    pub what: String,
    /// Command or action that cures it; empty when nothing is wrong.
    pub cure: String,
}

impl Finding {
    fn new(check: &'static str, severity: FindingLevel, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            check,
            severity,
            what: what.into(),
            cure: cure.into(),
        }
    }

    fn note(check: &'static str, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::new(check, FindingLevel::Note, what, cure)
    }

    fn warning(check: &'static str, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::new(check, FindingLevel::Warning, what, cure)
    }

    fn blocker(check: &'static str, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self::new(check, FindingLevel::Blocker, what, cure)
    }

    fn good(check: &'static str, what: impl Into<String>) -> Self {
        Self::new(check, FindingLevel::Good, what, "")
    }
}

/// Returns all findings, in the order of their remedies.
pub fn examine(machine: &Machine, haptic_core: usize) -> Vec<Finding> {
    let mut findings = vec![
        kernel::hypervisor(machine),
        kernel::preemption(machine),
        rights::priority(machine),
        rights::memory_lock(machine),
        kernel::throttling(machine),
        kernel::groups(machine),
        kernel::time_source(machine),
        cores::count(machine),
        cores::isolation(machine, haptic_core),
        cores::interrupts(machine, haptic_core),
        display::servers(machine, haptic_core),
        cores::siblings(machine, haptic_core),
        cores::sleep_states(machine, haptic_core),
        shared::swap(machine),
        shared::space(machine, shared::free_bytes),
        shared::stale_services(machine),
        tunable::turbo(machine),
        tunable::tuned(machine),
    ];
    findings.extend(tunable::findings(machine, haptic_core));
    findings
}

/// Returns the summary of all findings.
fn verdict(findings: &[Finding]) -> &'static str {
    match findings.iter().map(|f| f.severity).max() {
        Some(FindingLevel::Blocker) => "not fit: fix the blockers first",
        Some(FindingLevel::Warning) => "usable; expect a longer tail until the warnings are fixed",
        _ => "fit",
    }
}

/// Examines this PC and prints the findings; returns 1 if there is a blocker.
fn print(json: bool, core: usize) -> u8 {
    let findings = examine(&Machine::this(), core);
    if json {
        let all = serde_json::json!({ "haptic_core": core, "verdict": verdict(&findings), "findings": findings });
        println!("{all:#}");
    } else {
        print!("{}", text(&findings, core));
    }
    u8::from(findings.iter().any(|f| f.severity == FindingLevel::Blocker))
}

fn text(findings: &[Finding], core: usize) -> String {
    let mut out = format!("Is this PC fit for a force loop of 1 kHz on core {core}?\n\n");
    for f in findings {
        out += &format!("{:<8} {:<16} {}\n", f.severity.word(), f.check, f.what);
        for line in f.cure.lines() {
            out += &format!("{:<25} -> {line}\n", "");
        }
    }
    out + &format!("\n{}\n", verdict(findings))
}
