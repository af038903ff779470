//! USB devices of a maker, as the kernel lists them.

use std::fs;
use std::path::Path;

/// A device on USB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbDevice {
    /// Kernel's name of its place, such as `1-2`.
    pub place: String,
    /// Product name, or empty.
    pub product: String,
    /// File through which a driver accesses it, below `/`.
    pub file: String,
}

/// Returns the devices whose vendor has this number in hexadecimal, as the kernel writes it. `root`
/// is `/`, or a folder that replaces it.
pub fn devices_of(root: &Path, vendor: &str) -> Vec<UsbDevice> {
    let folder = root.join("sys/bus/usb/devices");
    let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
    let mut found: Vec<_> = entries
        .filter_map(|entry| {
            let text = |name: &str| fs::read_to_string(entry.path().join(name)).map(|t| t.trim().to_owned());
            (text("idVendor").ok()? == vendor).then_some(())?;
            let number = |name: &str| text(name).ok().and_then(|t| t.parse::<u32>().ok()).unwrap_or(0);
            Some(UsbDevice {
                place: entry.file_name().to_string_lossy().into_owned(),
                product: text("product").unwrap_or_default(),
                file: format!("dev/bus/usb/{:03}/{:03}", number("busnum"), number("devnum")),
            })
        })
        .collect();
    found.sort_by(|a, b| a.place.cmp(&b.place));
    found
}
