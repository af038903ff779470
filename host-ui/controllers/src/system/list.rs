//! The command `host-ui controllers`: each device, its access and its functions.

use super::error::{ListError, OpenError};
use super::found::{Found, Places, find};
use super::hub::{DeviceSource, OpenDevice};
use super::reader::System;
use crate::kind::Kind;

/// Prints the devices; returns `Err` with the remedy if one cannot be read.
pub fn list() -> Result<(), ListError> {
    let found = find(&Places::default());
    if found.is_empty() {
        println!("n/a: no gamepad and no 3D mouse is plugged in");
        return Ok(());
    }
    let mut troubles = Vec::new();
    for device in &found {
        println!("{} ({}, {})", device.name, device.kind.name(), device.path.display());
        if let Err(why) = try_one(device) {
            troubles.push(why);
        }
    }
    for kind in [Kind::Gamepad, Kind::Mouse3d] {
        if found.iter().any(|f| f.kind == kind) {
            println!("\n{}:", kind.name());
            for (what, does) in kind.uses() {
                println!("  {what:26}{does}");
            }
        }
    }
    if troubles.is_empty() {
        Ok(())
    } else {
        Err(ListError(troubles))
    }
}

fn try_one(found: &Found) -> Result<(), OpenError> {
    let opened = System::default().open(found);
    opened
        .and_then(|o| o.state())
        .map(|_| ())
        .map_err(|e| OpenError::of(found, e))
}
