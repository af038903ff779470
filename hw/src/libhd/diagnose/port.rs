//! Checks of ports and links: parallel port of the Premium, FireWire and USB of the others.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::Surroundings;
use crate::finding::{Finding, Severity};

/// USB vendor of 3D Systems: Touch and Touch X, as in the udev rules of its driver.
const USB_VENDOR: &str = "2988";
const LINKS: [(&str, &str); 2] = [
    ("dev/phnepp", "/dev/parport0"),
    ("dev/phnepp_modes", "/proc/sys/dev/parport/parport0/modes"),
];

/// Checks the parallel port of a Premium; the findings are in the order in which to fix them.
pub fn of_parallel_port(root: &Path, here: &Surroundings) -> Vec<Finding> {
    let Ok(modes) = fs::read_to_string(root.join("proc/sys/dev/parport/parport0/modes")) else {
        return vec![Finding::new(
            Severity::Note,
            "no parallel port is known to the kernel; a Phantom Premium needs one on the mainboard",
            "for a Premium: enable the port in the BIOS, mode EPP, then sudo modprobe parport_pc; ports on add-in \
             cards are not known to work",
        )];
    };
    let mut findings = vec![mode(modes.trim())];
    findings.extend(printer(root));
    findings.push(device_file(root, "dev/parport0", "ppdev", here));
    findings.extend(LINKS.map(|(link, target)| linked(root, link, target)));
    findings
}

fn mode(modes: &str) -> Finding {
    let has = |mode: &str| modes.split([',', ' ', '\t']).any(|m| m == mode);
    match (has("EPP"), has("ECP")) {
        (true, false) => Finding::good(format!("parallel port in mode EPP ({modes})")),
        (true, true) => Finding::new(
            Severity::Warning,
            format!("parallel port in a mixed mode ({modes}); the driver asks for plain EPP"),
            "set the port's mode in the BIOS to EPP, not ECP+EPP",
        ),
        (false, _) => Finding::new(
            Severity::Problem,
            format!("parallel port without EPP ({modes})"),
            "set the port's mode in the BIOS to EPP (often EPP 1.9)",
        ),
    }
}

fn printer(root: &Path) -> Option<Finding> {
    let modules = fs::read_to_string(root.join("proc/modules")).ok()?;
    let loaded = modules.lines().any(|line| line.split_whitespace().next() == Some("lp"));
    loaded.then(|| {
        Finding::new(
            Severity::Warning,
            "the printer driver lp is loaded and may take the parallel port",
            "sudo rmmod lp; to keep it unloaded: echo 'blacklist lp' | sudo tee /etc/modprobe.d/phantom.conf",
        )
    })
}

fn linked(root: &Path, link: &str, target: &str) -> Finding {
    let make = format!(
        "sudo ln -sfn {target} /{link}; to keep it after a restart, write 'L+ /{link} - - - - {target}' into \
         /etc/tmpfiles.d/phantom.conf"
    );
    match fs::read_link(root.join(link)) {
        Ok(to) if to == Path::new(target) => Finding::good(format!("/{link} points to {target}")),
        Ok(to) => Finding::new(
            Severity::Problem,
            format!("/{link} points to {}, not to {target}", to.display()),
            make,
        ),
        Err(_) => Finding::new(Severity::Problem, format!("/{link} is missing"), make),
    }
}

/// Checks a device file that this user must be able to read and write.
fn device_file(root: &Path, path: &str, module: &str, here: &Surroundings) -> Finding {
    let Ok(found) = fs::metadata(root.join(path)) else {
        return Finding::new(
            Severity::Problem,
            format!("/{path} is missing"),
            format!(
                "sudo modprobe {module}; to load it at each start: echo {module} | sudo tee /etc/modules-load.d/phantom.conf"
            ),
        );
    };
    let mode = found.mode();
    let allowed = here.user == 0
        || (found.uid() == here.user && mode & 0o600 == 0o600)
        || (here.groups.contains(&found.gid()) && mode & 0o060 == 0o060)
        || mode & 0o006 == 0o006;
    if allowed {
        return Finding::good(format!("/{path} can be read and written"));
    }
    let group = group_name(root, found.gid());
    let cure = if mode & 0o060 == 0o060 {
        format!("sudo usermod -aG {group} $USER, then log in again")
    } else {
        format!("sudo chgrp {group} /{path} && sudo chmod g+rw /{path}, or a udev rule that does it")
    };
    Finding::new(
        Severity::Problem,
        format!(
            "/{path} (group {group}, mode {:03o}) cannot be read and written by this user",
            mode & 0o777
        ),
        cure,
    )
}

fn group_name(root: &Path, number: u32) -> String {
    let groups = fs::read_to_string(root.join("etc/group")).unwrap_or_default();
    let found = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(number)).then(|| name.to_owned())
    });
    found.unwrap_or_else(|| number.to_string())
}

/// Checks FireWire (Omni, Desktop) and USB (Touch); returns no finding where there are none.
pub fn of_other_ports(root: &Path, here: &Surroundings) -> Vec<Finding> {
    let mut names: Vec<PathBuf> = fs::read_dir(root.join("dev"))
        .map(|entries| entries.flatten().map(|e| PathBuf::from(e.file_name())).collect())
        .unwrap_or_default();
    names.sort();
    let port = |name: &str| {
        let numbered = |prefix: &str| {
            name.strip_prefix(prefix)
                .is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit()))
        };
        name == "raw1394" || numbered("fw") || numbered("ttyACM")
    };
    let names = names.iter().filter_map(|n| n.to_str()).filter(|n| port(n));
    names
        .map(|name| device_file(root, &format!("dev/{name}"), "", here))
        .chain(of_hid(root))
        .collect()
}

/// Checks the newer Touch, a HID device: its file belongs to root at first.
fn of_hid(root: &Path) -> Vec<Finding> {
    let entries = fs::read_dir(root.join("sys/class/hidraw"))
        .into_iter()
        .flatten()
        .flatten();
    let touches = entries.filter(|entry| {
        let event = fs::read_to_string(entry.path().join("device/uevent")).unwrap_or_default();
        // HID_ID=0003:00002988:00000302
        let vendor = event.lines().find_map(|l| l.strip_prefix("HID_ID=")?.split(':').nth(1));
        vendor.is_some_and(|vendor| vendor.ends_with(USB_VENDOR))
    });
    let check = |name: String| {
        // Opened, for the rule gives its right through an access list.
        match fs::File::options().read(true).write(true).open(root.join(&name)) {
            Ok(_) => Finding::good(format!("/{name} can be read and written")),
            Err(_) => Finding::new(
                Severity::Problem,
                format!("a Touch is connected as a HID device, but /{name} cannot be read and written by this user"),
                format!(
                    "echo 'SUBSYSTEM==\"hidraw\", ATTRS{{idVendor}}==\"{USB_VENDOR}\", TAG+=\"uaccess\"' | sudo tee \
                     /etc/udev/rules.d/70-stylet-haptic.rules && sudo udevadm control --reload && sudo udevadm trigger   (the package of \
                     rt-core installs this rule)"
                ),
            ),
        }
    };
    touches
        .map(|entry| check(format!("dev/{}", entry.file_name().to_string_lossy())))
        .collect()
}
