//! Haptic devices that a driver could find.

use super::{Finding, Severity};
use crate::lab::machine::Machine;

/// USB vendor of 3D Systems: Touch and Touch X, as in the udev rules of its driver.
const USB_VENDOR: &str = "2988";
/// IEEE 1394 vendor of SensAble, the maker of the Phantoms, as registered (OUI 00-0B-99).
const FIREWIRE_VENDOR: &str = "0x000b99";

pub fn haptic(machine: &Machine) -> Finding {
    let mut found = Vec::new();
    for name in machine.names("sys/bus/firewire/devices") {
        let read = |what: &str| machine.text(&format!("sys/bus/firewire/devices/{name}/{what}"));
        if read("vendor").as_deref() == Some(FIREWIRE_VENDOR) {
            found.push((format!("FireWire {name}"), format!("dev/{name}")));
        }
    }
    for name in machine.names("sys/bus/usb/devices") {
        let vendor = machine.text(&format!("sys/bus/usb/devices/{name}/idVendor"));
        if vendor.as_deref() == Some(USB_VENDOR) {
            found.push((format!("USB {name}"), String::new()));
        }
    }
    if let (Some(modes), true) = (machine.text("proc/sys/dev/parport/parport0/modes"), found.is_empty()) {
        return parallel_port(machine, &modes);
    }
    if found.is_empty() {
        return Finding::new(
            "devices",
            Severity::Note,
            "no haptic device is seen on FireWire, USB or a parallel port; the simulated one will be used",
            "",
        );
    }
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    let driver = [
        "usr/lib64/libHD.so",
        "usr/lib/libHD.so",
        "usr/lib/x86_64-linux-gnu/libHD.so",
    ];
    if driver.iter().any(|path| machine.exists(path)) {
        Finding::good("devices", format!("{}, and its driver libHD", names.join(", ")))
    } else {
        Finding::new(
            "devices",
            Severity::Warning,
            format!(
                "{} is connected, but its driver libHD is not installed",
                names.join(", ")
            ),
            "install OpenHaptics and the device driver of 3D Systems",
        )
    }
}

/// A Phantom Premium 1.5 talks EPP to a parallel port on the board; whether one is connected cannot be told from here.
fn parallel_port(machine: &Machine, modes: &str) -> Finding {
    if !modes.split(',').any(|m| m.trim() == "EPP") {
        return Finding::new(
            "devices",
            Severity::Warning,
            format!("the parallel port does not offer EPP (it has {modes}); a Phantom Premium needs it"),
            "set the port to EPP, not to ECP+EPP, in the firmware set-up (BIOS)",
        );
    }
    if machine.exists("dev/phnepp") {
        return Finding::good(
            "devices",
            "a parallel port with EPP, linked as /dev/phnepp for a Phantom Premium",
        );
    }
    Finding::new(
        "devices",
        Severity::Note,
        "a parallel port with EPP, but no link to it for a Phantom Premium",
        "sudo ln -s /dev/parport0 /dev/phnepp && sudo ln -s /proc/sys/dev/parport/parport0/modes /dev/phnepp_modes",
    )
}
