//! Checks of library, licence and configuration of the vendor's software, and of the device through
//! them.

use std::fs;
use std::path::Path;

use super::Surroundings;
use crate::finding::{Finding, Severity};
use crate::libhd::calibrate::{self, Calibration};
use crate::libhd::errors;
use crate::libhd::ffi::Api;
use crate::libhd::session::{ConnectionError, Session};
use crate::library::{LoadError, LoadFailure};

/// Libraries that `libHD.so` needs: part of the name, and how to install it.
const NEEDED: &[(&str, &str)] = &[
    (
        "libPHANToMIO",
        "install the vendor's PHANTOM Device Drivers 4.3, then sudo ldconfig",
    ),
    (
        "libPhantomIOLib42",
        "install the vendor's Touch Device Driver, then sudo ldconfig",
    ),
    (
        "libncurses.so.5",
        "sudo apt install libncurses5; where the distribution has dropped it, take the package of its last release \
         that had it",
    ),
    ("libtinfo.so.5", "sudo apt install libtinfo5"),
    (
        "libraw1394",
        "sudo apt install libraw1394-11; drivers that ask for libraw1394.so.8 are the vendor's older build: take the \
         build for the newer FireWire stack",
    ),
    ("libblkid", "sudo apt install libblkid1"),
    ("libuuid", "sudo apt install libuuid1"),
    (
        "libHD.so",
        "install OpenHaptics (the Academic Edition 3.0 for a Premium, 3.4 for a Touch), then sudo ldconfig; or name the \
         file with --libhd",
    ),
];

pub fn of_library(library: &Result<(), LoadError>) -> Vec<Finding> {
    let Err(LoadError { tried, .. }) = library else {
        return vec![Finding::good("OpenHaptics (libHD.so) can be loaded")];
    };
    let findings = tried.iter().map(|(name, why)| {
        Finding::new(
            Severity::Problem,
            format!("{}: {why}", name.display()),
            library_cure(why),
        )
    });
    findings.collect()
}

fn library_cure(why: &LoadFailure) -> &'static str {
    let why = match why {
        LoadFailure::Loader(why) => why,
        LoadFailure::NotTrusted => return LoadFailure::CURE_OF_NOT_TRUSTED,
        LoadFailure::Incomplete(_) => {
            return "another library has this name, or a part of it is missing: install OpenHaptics again";
        }
    };
    if why.contains("wrong ELF class") {
        return "this is a library for another processor: install the 64 bit one";
    }
    if why.contains("cannot open shared object file: Permission denied") {
        return "make the file readable: sudo chmod a+rx on it and its folder";
    }
    let found = NEEDED.iter().find(|(part, _)| why.contains(part));
    found.map_or("install what the message names, then sudo ldconfig", |(_, cure)| cure)
}

/// Checks the folder of the Touch drivers for paired devices; a Premium needs none.
pub fn of_configuration(root: &Path, here: &Surroundings) -> Vec<Finding> {
    let inside = |path: &Path| root.join(path.strip_prefix("/").unwrap_or(path));
    let touch_driver = ["usr/lib", "usr/lib64", "lib"]
        .iter()
        .any(|folder| root.join(folder).join("libPhantomIOLib42.so").exists());
    let folder = here.gtdd_home.clone().or_else(|| {
        let home = here.home.as_ref()?.join(".3dsystems");
        inside(&home).is_dir().then_some(home)
    });
    let Some(folder) = folder else {
        return touch_driver
            .then(|| {
                Finding::new(
                    Severity::Problem,
                    "GTDD_HOME is not set and ~/.3dsystems does not exist: the Touch driver finds no configuration",
                    "echo 'GTDD_HOME=/usr/share/3DSystems' | sudo tee -a /etc/environment, log in again, run Touch_Setup",
                )
            })
            .into_iter()
            .collect();
    };
    let config = folder.join("config");
    let paired = fs::read_dir(inside(&config)).is_ok_and(|entries| {
        let mut names = entries.flatten().map(|e| e.file_name());
        names.any(|name| Path::new(&name).extension().is_some_and(|e| e == "config"))
    });
    vec![if paired {
        Finding::good(format!("{} holds the configuration of a device", config.display()))
    } else {
        Finding::new(
            Severity::Warning,
            format!("{} holds no configuration of a device", config.display()),
            "plug in the Touch and run Touch_Setup; remove what an older driver left there first",
        )
    }]
}

/// Checks the device itself: initialises it and releases it again. Must not run while `rt-core`
/// uses the device.
pub fn of_device(api: &Api, name: Option<&str>) -> Vec<Finding> {
    let session = match Session::open(api, name) {
        Ok(session) => session,
        Err(why) => return vec![problem(&why)],
    };
    let mut findings = Vec::new();
    match session.describe() {
        Ok(description) => {
            findings.push(Finding::good(description.to_string()));
            if description.output_dof < 6 {
                findings.push(Finding::new(
                    Severity::Note,
                    "the device gives forces but no torques",
                    "",
                ));
            }
            findings.push(match calibrate::step(api, session.handle) {
                Ok(Calibration::Done | Calibration::Updated) => Finding::good("the device is calibrated"),
                Ok(Calibration::NeedsOperator(what_to_do)) => {
                    Finding::new(Severity::Warning, "the device is not calibrated", what_to_do)
                }
                Err(why) => problem(&why),
            });
        }
        Err(why) => findings.push(problem(&why)),
    }
    session.close();
    findings
}

fn problem(why: &ConnectionError) -> Finding {
    let cure = match why {
        ConnectionError::NoDevice(tried) => tried.first().map_or("", |(_, code)| errors::cure(*code)),
        ConnectionError::Call(_, code) => errors::cure(*code),
        ConnectionError::WrongModel(_) => "use a device of a known model",
        _ => "",
    };
    let what = why.to_string();
    Finding::new(Severity::Problem, what, cure)
}
