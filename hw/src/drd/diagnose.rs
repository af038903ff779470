//! Checks of library, USB and device for Force Dimension, without a force.

use std::fs::File;
use std::path::Path;

use crate::drd::errors;
use crate::drd::ffi::Api;
use crate::drd::session::{ConnectionError, Session, sdk_version, version_text};
use crate::drd::status::{Health, health};
use crate::finding::{Finding, Severity};
use crate::library::{LoadError, LoadFailure};
use crate::usb;

/// USB vendor of Force Dimension, as in published udev rules.
const VENDOR: &str = "1451";
const INSTALL: &str = "install the vendor's SDK and run sudo ldconfig, or name the file with --libdrd";

/// Checks library and USB without a call to the device. `root` is `/`, or a folder that replaces
/// it.
pub fn diagnose(root: &Path, library: &Result<Api, LoadError>) -> Vec<Finding> {
    let mut findings = match library {
        Ok(api) => {
            let version = sdk_version(api).map_or("of an unknown version".to_owned(), version_text);
            vec![Finding::good(format!(
                "the Force Dimension SDK {version} can be loaded"
            ))]
        }
        Err(LoadError { tried, .. }) => tried
            .iter()
            .map(|(name, why)| {
                let cure = match why {
                    LoadFailure::NotTrusted => LoadFailure::CURE_OF_NOT_TRUSTED,
                    _ => INSTALL,
                };
                Finding::new(Severity::Problem, format!("{}: {why}", name.display()), cure)
            })
            .collect(),
    };
    let seen = usb::devices_of(root, VENDOR);
    if seen.is_empty() {
        let what = "no Force Dimension device is seen on USB";
        findings.push(Finding::new(Severity::Note, what, "plug it in and switch it on"));
    }
    for device in seen {
        let usable = File::options()
            .read(true)
            .write(true)
            .open(root.join(&device.file))
            .is_ok();
        let what = format!("USB {}: {}", device.place, device.product);
        findings.push(match usable {
            true => Finding::good(what),
            false => Finding::new(
                Severity::Problem,
                format!("{what}; /{} cannot be read and written by this user", device.file),
                errors::cure(4),
            ),
        });
    }
    findings
}

/// Returns the number of devices that the SDK counts.
pub fn device_count(api: &Api) -> u8 {
    // SAFETY: no preconditions.
    let count = unsafe { (api.dhdGetDeviceCount)() };
    u8::try_from(count.max(0)).unwrap_or(u8::MAX)
}

/// Opens the device, queries model and state, and closes it. Its forces stay off. Must not run
/// while `rt-core` uses the device.
pub fn of_device(api: &Api, number: u8) -> Vec<Finding> {
    let session = match Session::open(api, number) {
        Ok(session) => session,
        Err(why) => return vec![problem(&why)],
    };
    let mut findings = Vec::new();
    findings.push(match session.describe() {
        Ok(description) => Finding::good(description.to_string()),
        Err(why) => problem(&why),
    });
    findings.push(match session.status().map(|numbers| health(&numbers, false)) {
        Ok(Health::Good | Health::Off { .. }) => Finding::good("the device is ready"),
        Ok(Health::Pause(_)) => Finding::new(Severity::Warning, "the device is not calibrated", errors::cure(12)),
        Ok(Health::Lost(fault)) => Finding::new(Severity::Problem, fault.to_string(), errors::cure(2)),
        Err(why) => problem(&why),
    });
    if api.dhdSetWatchdog.is_none() {
        let what = "this SDK cannot arm the device's watchdog: a driver that hangs leaves its last force";
        findings.push(Finding::new(Severity::Warning, what, "install a newer SDK"));
    }
    session.close_untouched();
    findings
}

fn problem(why: &ConnectionError) -> Finding {
    let cure = match why {
        ConnectionError::NoDevice { code, .. } | ConnectionError::Call(_, code) => errors::cure(*code),
        ConnectionError::WrongModel { .. } => "use a device of a known model",
        _ => "",
    };
    Finding::new(Severity::Problem, why.to_string(), cure)
}
