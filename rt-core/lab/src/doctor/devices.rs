//! Haptic devices: those connected, and whether their driver would find them.

use super::{Finding, FindingLevel};
use crate::machine::Machine;
use std::path::Path;
use stylet_hw::Severity;
use stylet_hw::libhd::diagnose::{self, Surroundings};

/// USB vendor of 3D Systems: Touch and Touch X, as in the udev rules of its driver.
const USB_VENDOR: &str = "2988";
/// USB vendor of Force Dimension, as in the udev rules that its users publish.
const FORCE_DIMENSION_VENDOR: &str = "1451";
/// IEEE 1394 vendor of SensAble, the maker of the Phantoms, as registered (OUI 00-0B-99).
const FIREWIRE_VENDOR: &str = "0x000b99";

/// Devices on buses that report their vendor; a Premium on a parallel port does not.
fn connected(machine: &Machine) -> Vec<String> {
    let mut found = Vec::new();
    for (bus, file, vendor, name_of_bus) in [
        ("firewire", "vendor", FIREWIRE_VENDOR, "FireWire"),
        ("usb", "idVendor", USB_VENDOR, "USB"),
        ("usb", "idVendor", FORCE_DIMENSION_VENDOR, "USB"),
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

/// Returns whether this process may read and write a device file.
pub fn may_use(path: &Path) -> bool {
    std::fs::File::options().read(true).write(true).open(path).is_ok()
}

/// Examines the newer Touch, a HID device: the driver accesses it through `/dev/hidraw*`, which belongs to root at
/// first.
pub fn hidraw(machine: &Machine, usable: impl Fn(&Path) -> bool) -> Finding {
    let folder = "sys/class/hidraw";
    let is_ours = |name: &&String| {
        let event = machine
            .text(&format!("{folder}/{name}/device/uevent"))
            .unwrap_or_default();
        // HID_ID=0003:00002988:00000302
        let vendor = event.lines().find_map(|l| l.strip_prefix("HID_ID=")?.split(':').nth(1));
        vendor.is_some_and(|v| v.to_lowercase().ends_with(USB_VENDOR))
    };
    let names = machine.names(folder);
    let ours: Vec<&String> = names.iter().filter(is_ours).collect();
    if ours.is_empty() {
        return Finding::good("hidraw", "no haptic device is connected as a HID device");
    }
    let refused: Vec<String> = ours
        .iter()
        .map(|name| format!("dev/{name}"))
        .filter(|path| !usable(&machine.path(path)))
        .collect();
    if refused.is_empty() {
        return Finding::good(
            "hidraw",
            format!("haptic devices on hidraw that may be used: {}", ours.len()),
        );
    }
    Finding::warning(
        "hidraw",
        format!(
            "a Touch is connected as a HID device, but may not be used: /{}",
            refused.join(", /")
        ),
        format!(
            "echo 'SUBSYSTEM==\"hidraw\", ATTRS{{idVendor}}==\"{USB_VENDOR}\", TAG+=\"uaccess\"' | sudo tee \
             /etc/udev/rules.d/70-stylet-haptic.rules && sudo udevadm control --reload && sudo udevadm trigger   (the package of \
             rt-core installs this rule)"
        ),
    )
}

pub fn haptic(machine: &Machine) -> Finding {
    let found = connected(machine);
    if found.is_empty() {
        return Finding::note(
            "devices",
            "no haptic device is seen on FireWire or USB; without a Premium on a parallel port the simulated one is there",
            "",
        );
    }
    Finding::good("devices", found.join(", "))
}

/// Returns the obstacles between a Phantom and `--device phantom`. They matter less where no device is connected.
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
                Severity::Good => FindingLevel::Good,
                Severity::Note => FindingLevel::Note,
                Severity::Warning | Severity::Problem => worst,
            };
            Finding::new(PHANTOM, severity, f.what, f.cure)
        })
        .collect()
}

/// All findings about the driver have this name.
pub const PHANTOM: &str = "phantom";
