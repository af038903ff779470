//! Haptic devices: what is connected, and whether their driver would find it.

use super::{Finding, FindingLevel};
use crate::machine::Machine;
use stylet_hw::libhd::diagnose::{self, Surroundings};

/// USB vendor of 3D Systems: Touch and Touch X, as in the udev rules of its driver.
const USB_VENDOR: &str = "2988";
/// IEEE 1394 vendor of SensAble, the maker of the Phantoms, as registered (OUI 00-0B-99).
const FIREWIRE_VENDOR: &str = "0x000b99";

/// Devices on buses that report their vendor; a Premium on a parallel port does not.
fn connected(machine: &Machine) -> Vec<String> {
    let mut found = Vec::new();
    for (bus, file, vendor, name_of_bus) in [
        ("firewire", "vendor", FIREWIRE_VENDOR, "FireWire"),
        ("usb", "idVendor", USB_VENDOR, "USB"),
    ] {
        let folder = format!("sys/bus/{bus}/devices");
        for name in machine.names(&folder) {
            if machine.text(&format!("{folder}/{name}/{file}")).as_deref() == Some(vendor) {
                found.push(format!("{name_of_bus} {name}"));
            }
        }
    }
    found
}

pub fn haptic(machine: &Machine) -> Finding {
    let found = connected(machine);
    if found.is_empty() {
        return Finding::new(
            "devices",
            FindingLevel::Note,
            "no haptic device is seen on FireWire or USB; without a Premium on a parallel port the simulated one is there",
            "",
        );
    }
    Finding::good("devices", found.join(", "))
}

/// What stands between a Phantom and `--device phantom`. It matters less where no device is connected.
pub fn driver(machine: &Machine, here: &Surroundings) -> Vec<Finding> {
    let worst = if connected(machine).is_empty() {
        FindingLevel::Note
    } else {
        FindingLevel::Warning
    };
    let findings = diagnose::diagnose(&machine.path(""), here).into_iter();
    findings
        .map(|f| {
            let severity = match f.severity {
                diagnose::Severity::Good => FindingLevel::Good,
                diagnose::Severity::Note => FindingLevel::Note,
                diagnose::Severity::Warning | diagnose::Severity::Problem => worst,
            };
            Finding::new(PHANTOM, severity, f.what, f.cure)
        })
        .collect()
}

/// All findings about the driver have this name.
pub const PHANTOM: &str = "phantom";
