//! Reasons why a Phantom is not found, each with its remedy.
//!
//! Reads files through a root folder and takes everything else as an argument, so that a test can
//! fake all of it.

mod driver;
mod port;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use crate::finding::Finding;
use crate::libhd::ffi::Api;
use crate::library::LoadError;

pub use driver::of_device;

/// User, and result of loading the library; everything else is in files.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// Effective user.
    pub user: u32,
    /// Effective and supplementary groups.
    pub groups: Vec<u32>,
    /// The user's home folder.
    pub home: Option<PathBuf>,
    /// The variable `GTDD_HOME` of the Touch drivers.
    pub gtdd_home: Option<PathBuf>,
    /// Result of loading `libHD.so`.
    pub library: Result<(), LoadError>,
}

impl Surroundings {
    /// Returns the surroundings of this process, and the library for [`of_device`].
    pub fn of_this_process(library: Option<&Path>) -> (Self, Option<Api>) {
        let loaded = Api::load(library);
        let here = Self {
            user: rustix::process::geteuid().as_raw(),
            groups: groups(),
            home: std::env::var_os("HOME").map(PathBuf::from),
            gtdd_home: std::env::var_os("GTDD_HOME").map(PathBuf::from),
            library: loaded.as_ref().map(|_| ()).map_err(Clone::clone),
        };
        (here, loaded.ok())
    }
}

fn groups() -> Vec<u32> {
    let supplementary = rustix::process::getgroups().unwrap_or_default();
    let effective = rustix::process::getegid();
    supplementary
        .into_iter()
        .chain([effective])
        .map(|group| group.as_raw())
        .collect()
}

/// Runs every check that needs no device. `root` is `/`, or a folder that replaces it.
pub fn diagnose(root: &Path, surroundings: &Surroundings) -> Vec<Finding> {
    let mut findings = driver::of_library(&surroundings.library);
    findings.extend(port::of_parallel_port(root, surroundings));
    findings.extend(port::of_other_ports(root, surroundings));
    findings.extend(driver::of_configuration(root, surroundings));
    findings
}
