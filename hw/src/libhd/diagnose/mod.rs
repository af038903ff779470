//! Why a Phantom is not found, and what to do about each reason.
//!
//! Reads files through a root folder and takes everything else as an argument, so that a test can fake all of it.

mod driver;
mod port;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use crate::finding::Finding;
use crate::libhd::ffi::Api;
use crate::library::LoadError;

pub use driver::of_device;

/// The user and the result of loading the library; everything else is in files.
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
    /// Why `libHD.so` cannot be loaded, if it cannot.
    pub library: Result<(), LoadError>,
}

impl Surroundings {
    /// Surroundings of this process. Also returns the library, for [`of_device`].
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

/// Every check that needs no device. `root` is `/`, or a folder that stands for it.
pub fn diagnose(root: &Path, surroundings: &Surroundings) -> Vec<Finding> {
    let mut findings = driver::of_library(&surroundings.library);
    findings.extend(port::of_parallel_port(root, surroundings));
    findings.extend(port::of_other_ports(root, surroundings));
    findings.extend(driver::of_configuration(root, surroundings));
    findings
}
