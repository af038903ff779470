//! Why a Phantom is not found, and what to do about each reason.
//!
//! Reads files through a root folder and asks for nothing else that a test could not fake.

mod driver;
mod port;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use crate::libhd::ffi::{Api, LoadError};

pub use driver::of_device;

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// As it should be.
    Good,
    /// Matters for some devices only.
    Note,
    /// Works, but not well.
    Warning,
    /// No device will be found.
    Problem,
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub severity: Severity,
    pub what: String,
    /// What to do, with the command to type; empty when there is nothing to do.
    pub cure: String,
}

impl Finding {
    fn new(severity: Severity, what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self {
            severity,
            what: what.into(),
            cure: cure.into(),
        }
    }

    fn good(what: impl Into<String>) -> Self {
        Self::new(Severity::Good, what, "")
    }
}

/// Who asks, and what the loader said; everything else is in files.
#[derive(Clone, Debug)]
pub struct Surroundings {
    pub user: u32,
    pub groups: Vec<u32>,
    pub home: Option<PathBuf>,
    /// The variable `GTDD_HOME` of the Touch drivers.
    pub gtdd_home: Option<PathBuf>,
    /// Why `libHD.so` cannot be loaded, if it cannot.
    pub library: Result<(), LoadError>,
}

impl Surroundings {
    /// Those of this process. Also gives the library, for [`of_device`].
    pub fn of_this_process(library: Option<&Path>) -> (Self, Option<Api>) {
        let loaded = Api::load(library);
        let here = Self {
            // SAFETY: no preconditions.
            user: unsafe { libc::geteuid() },
            groups: groups(),
            home: std::env::var_os("HOME").map(PathBuf::from),
            gtdd_home: std::env::var_os("GTDD_HOME").map(PathBuf::from),
            library: loaded.as_ref().map(|_| ()).map_err(Clone::clone),
        };
        (here, loaded.ok())
    }
}

fn groups() -> Vec<u32> {
    let mut found = vec![0; 256];
    // SAFETY: room for as many as are asked for.
    let count = unsafe { libc::getgroups(found.len() as libc::c_int, found.as_mut_ptr()) };
    found.truncate(usize::try_from(count).unwrap_or(0));
    // SAFETY: no preconditions.
    found.push(unsafe { libc::getegid() });
    found
}

/// Everything that can be said without touching a device. `root` is `/`, or a folder that stands for it.
pub fn diagnose(root: &Path, surroundings: &Surroundings) -> Vec<Finding> {
    let mut findings = driver::of_library(&surroundings.library);
    findings.extend(port::of_parallel_port(root, surroundings));
    findings.extend(port::of_other_ports(root, surroundings));
    findings.extend(driver::of_configuration(root, surroundings));
    findings
}
