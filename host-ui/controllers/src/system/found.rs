//! Finds gamepads and 3D mice through sysfs, without opening a device and without rights.

use super::abilities::{Abilities, Bits};
use crate::kind::Kind;
use std::path::{Path, PathBuf};

/// Longest name that is shown whole.
const LONGEST_NAME: usize = 60;

/// Folders in which the kernel lists devices and opens them.
#[derive(Clone, Debug)]
pub struct Places {
    /// Folder in which sysfs lists input devices.
    pub class: PathBuf,
    /// Folder of the device nodes.
    pub nodes: PathBuf,
}

impl Default for Places {
    fn default() -> Self {
        Self {
            class: "/sys/class/input".into(),
            nodes: "/dev/input".into(),
        }
    }
}

/// Device that can hold the needle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Its device node.
    pub path: PathBuf,
    /// Display name.
    pub name: String,
    /// Kind of the device.
    pub kind: Kind,
}

/// Returns the devices in the order in which they were plugged in.
pub fn find(places: &Places) -> Vec<Found> {
    let Ok(entries) = std::fs::read_dir(&places.class) else {
        return Vec::new();
    };
    let names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
    let mut events: Vec<(u32, String)> = names
        .filter_map(|name| Some((name.strip_prefix("event")?.parse().ok()?, name)))
        .collect();
    events.sort();
    events
        .into_iter()
        .filter_map(|(_, event)| look(places, &event))
        .collect()
}

fn look(places: &Places, event: &str) -> Option<Found> {
    let device = places.class.join(event).join("device");
    let text = |name: &str| read(&device, name);
    let vendor = u16::from_str_radix(text("id/vendor").trim(), 16).unwrap_or(0);
    let kind = Kind::of(&Abilities {
        keys: Bits::read(&text("capabilities/key")),
        absolute: Bits::read(&text("capabilities/abs")),
        relative: Bits::read(&text("capabilities/rel")),
        properties: Bits::read(&text("properties")),
        vendor,
    })?;
    // A device may report any name.
    let name: String = text("name")
        .trim()
        .chars()
        .filter(|c| !c.is_control())
        .take(LONGEST_NAME)
        .collect();
    Some(Found {
        path: places.nodes.join(event),
        name: if name.is_empty() { kind.name().to_owned() } else { name },
        kind,
    })
}

/// Reads a file; returns an empty text if it cannot be read, because a device may disappear at any
/// moment.
fn read(device: &Path, name: &str) -> String {
    std::fs::read(device.join(name)).map_or_else(|_| String::new(), |b| String::from_utf8_lossy(&b).into_owned())
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Writes a device as sysfs shows it, below `class`.
    pub fn lay_down(class: &Path, event: &str, name: &str, files: [&str; 4]) {
        let device = class.join(event).join("device");
        std::fs::create_dir_all(device.join("capabilities")).unwrap();
        std::fs::create_dir_all(device.join("id")).unwrap();
        let [vendor, key, abs, rel] = files;
        let attributes = [
            ("name", name),
            ("id/vendor", vendor),
            ("capabilities/key", key),
            ("capabilities/abs", abs),
        ];
        for (file, text) in attributes
            .into_iter()
            .chain([("capabilities/rel", rel), ("properties", "0")])
        {
            std::fs::write(device.join(file), format!("{text}\n")).unwrap();
        }
    }

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("stylet-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn devices_are_found_among_others_in_their_order() {
        let class = folder("found");
        lay_down(
            &class,
            "event10",
            "3Dconnexion SpaceMouse",
            ["256f", "3 0 0 0 0", "3f", "0"],
        );
        lay_down(
            &class,
            "event2",
            "Pad\u{7}",
            ["045e", "7cdb000000000000 0 0 0 0", "3003f", "0"],
        );
        lay_down(&class, "event3", "Mouse", ["046d", "1f0000 0 0 0 0", "0", "903"]);
        lay_down(&class, "js0", "Pad", ["045e", "7cdb000000000000 0 0 0 0", "3003f", "0"]);
        std::fs::create_dir_all(class.join("event4")).unwrap();
        let places = Places {
            class: class.clone(),
            nodes: "/nodes".into(),
        };
        let found = find(&places);
        let listed: Vec<_> = found
            .iter()
            .map(|f| (f.path.to_str().unwrap(), f.name.as_str(), f.kind))
            .collect();
        assert_eq!(
            listed,
            [
                ("/nodes/event2", "Pad", Kind::Gamepad),
                ("/nodes/event10", "3Dconnexion SpaceMouse", Kind::Mouse3d)
            ]
        );
        std::fs::remove_dir_all(&class).unwrap();
        assert_eq!(find(&places), []);
    }
}
