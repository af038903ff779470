//! The first messages of a connection: identify the device, check its limits and its frame.

use core::fmt;
use core::time::Duration;
use std::convert::Infallible;
use std::str::FromStr;
use std::time::Instant;

use crate::device::DeviceInfo;
use crate::driver_thread::arm::ArmError;
use crate::driver_thread::served::Described;
use crate::haply::message::{self, Frame, Inverse};
use crate::haply::model;
use crate::haply::wire::{Wire, WireError};

/// Time limit of the service for its list of devices, and for its answer to the first message.
const ANSWER_LIMIT: Duration = Duration::from_secs(2);

/// Choice among the service's devices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Wanted {
    /// The first one.
    #[default]
    First,
    /// Device at this place of the service's list, from 0.
    Number(usize),
    /// Device with this name in the service.
    Id(String),
}

impl FromStr for Wanted {
    type Err = Infallible;

    /// Reads one or two digits as a place in the list, anything else as the service's name of a
    /// device.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        let number = (text.len() < 3).then(|| text.parse().ok()).flatten();
        Ok(number.map_or_else(|| Self::Id(text.to_owned()), Self::Number))
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => f.write_str("no Inverse3"),
            Self::Number(number) => write!(f, "no Inverse3 with the number {number}"),
            Self::Id(id) => write!(f, "no Inverse3 \"{}\"", id.escape_default()),
        }
    }
}

/// Reason why there is no connection; the text says what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConnectionError {
    /// Nothing answers at the address.
    #[error(
        "no Inverse service answers at {address} ({why}): start Haply Hub or sudo systemctl start haply-inverse-service, or name it \
         with --haply-url"
    )]
    NoService {
        /// Address that was tried.
        address: String,
        /// Message of the system.
        why: String,
    },
    /// Another user's program, or another machine's.
    #[error(
        "{0}: end that program and start the service as this user, or with sudo systemctl start haply-inverse-service"
    )]
    NotTrusted(String),
    /// The service speaks another version of the interface.
    #[error("the Inverse service is of version {0}; 3.5 or a newer 3 is needed: update it with Haply Hub")]
    OtherVersion(String),
    /// The program at the address does not follow the service's protocol.
    #[error("what answers there does not send {0}: another program, or another version of the Inverse service")]
    OtherProgram(&'static str),
    /// The connection ended in its first messages.
    #[error("{0}: it is reconnected automatically")]
    Wire(#[from] WireError),
    /// The requested device is missing.
    #[error(
        "the service has {wanted}, only {}: plug it in and switch it on; rt-core devices lists the present ones",
        listed(found)
    )]
    NoDevice {
        /// Requested device.
        wanted: Wanted,
        /// Devices in the service.
        found: Vec<String>,
    },
    /// No limits are known for this type.
    #[error("the device {id} is a \"{kind}\", of which no limits are known; known are: {known}", known = model::known_types())]
    WrongModel {
        /// Name in the service.
        id: String,
        /// Its type.
        kind: String,
    },
    /// Another program has it.
    #[error("the device {0} is in use by another program: close it")]
    InUse(String),
    /// Another device answers after a reconnection.
    #[error("the device {was} is not there and {is} is in its place: plug {was} in, or restart rt-core")]
    OtherDevice {
        /// The device of the first connection.
        was: String,
        /// Device that answers now.
        is: String,
    },
    /// The service refused the requested axes.
    #[error("the service gives positions in another frame ({0}): a force would point elsewhere; restart the service")]
    OtherAxes(String),
    /// The servo thread was not granted the rights that it needs.
    #[error("the servo thread is not real-time: {0}")]
    NotArmed(#[source] ArmError),
    /// The servo thread did not start, or has not come back.
    #[error("the servo thread does not run: restart rt-core")]
    NoServo,
}

fn listed(found: &[String]) -> String {
    if found.is_empty() {
        "none at all".to_owned()
    } else {
        found.join(", ")
    }
}

/// Properties of a device as the service reports them.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Limits.
    pub info: DeviceInfo,
    /// Name in the service.
    pub id: String,
    /// Firmware, if the service reports it.
    pub firmware: Option<(u32, u32)>,
    /// Version of the service, if it reports one.
    pub service: Option<String>,
    /// Number of the handle that gives the orientation; without one the needle is held straight.
    pub grip: Option<String>,
}

impl Described for Description {
    fn info(&self) -> DeviceInfo {
        self.info
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.info.name, self.id)?;
        if let Some((major, minor)) = self.firmware {
            write!(f, ", firmware {major}.{minor}")?;
        }
        let service = self.service.as_deref().unwrap_or("of an unknown version");
        write!(f, ", Inverse service {service}, ")?;
        match &self.grip {
            Some(grip) => write!(f, "orientation from the VerseGrip {grip}"),
            None => f.write_str("no VerseGrip: the needle is held straight"),
        }
    }
}

/// Returns whether this version of the interface is supported.
pub fn is_supported(version: &str) -> bool {
    let mut parts = version.split('.').map(|part| part.parse::<u32>().ok());
    matches!((parts.next().flatten(), parts.next().flatten()), (Some(3), Some(minor)) if minor >= 5)
}

/// Exchanges the first messages: finds the device, sets the axes and verifies them. After an
/// earlier connection, `known`, the device must be the same.
pub fn open(
    wire: &mut dyn Wire,
    wanted: &Wanted,
    known: Option<&Description>,
    service: Option<String>,
) -> Result<Description, ConnectionError> {
    if let Some(version) = service.as_ref().filter(|version| !is_supported(version)) {
        return Err(ConnectionError::OtherVersion(version.clone()));
    }
    let mut text = String::new();
    let list = next(wire, &mut text, "a list of devices")?;
    let device = match known {
        Some(known) => same(&list, known)?,
        None => choose(&list, wanted)?,
    };
    let mut description = describe(device, known)?;
    description.service = service;
    description.grip = list.grip().map(|grip| grip.device_id.chars().take(32).collect());
    wire.send(&message::hello(&description.id))?;
    let answer = next(wire, &mut text, "a state")?;
    axes(&answer, &description.id)?;
    Ok(description)
}

/// Receives the next frame.
pub fn next<'a>(wire: &mut dyn Wire, text: &'a mut String, what: &'static str) -> Result<Frame<'a>, ConnectionError> {
    if !wire.receive(Instant::now() + ANSWER_LIMIT, text)? {
        return Err(ConnectionError::OtherProgram(what));
    }
    Frame::of(text).ok_or(ConnectionError::OtherProgram(what))
}

fn choose<'f, 'a>(list: &'f Frame<'a>, wanted: &Wanted) -> Result<&'f Inverse<'a>, ConnectionError> {
    let found = match wanted {
        Wanted::First => list.inverse3.first(),
        Wanted::Number(number) => list.inverse3.get(*number),
        Wanted::Id(id) => list.device(id),
    };
    found.ok_or_else(|| ConnectionError::NoDevice {
        wanted: wanted.clone(),
        found: ids(list),
    })
}

fn same<'f, 'a>(list: &'f Frame<'a>, known: &Description) -> Result<&'f Inverse<'a>, ConnectionError> {
    list.device(&known.id).ok_or_else(|| match ids(list).first() {
        Some(other) => ConnectionError::OtherDevice {
            was: known.id.clone(),
            is: other.clone(),
        },
        None => ConnectionError::NoDevice {
            wanted: Wanted::Id(known.id.clone()),
            found: Vec::new(),
        },
    })
}

/// Returns the service's names of its devices, ready to print.
fn ids(list: &Frame<'_>) -> Vec<String> {
    let printable = |id: &str| id.chars().take(64).flat_map(char::escape_default).collect();
    list.inverse3.iter().take(16).map(|d| printable(&d.device_id)).collect()
}

/// Returns the service's description of the device without a query; refuses a device of unknown
/// limits.
pub fn describe(device: &Inverse<'_>, known: Option<&Description>) -> Result<Description, ConnectionError> {
    let config = device.config.as_ref();
    let kind = config.and_then(|c| c.kind.as_deref()).unwrap_or("unknown");
    let id: String = device.device_id.chars().take(64).collect();
    let wrong = |kind: &str| ConnectionError::WrongModel {
        id: id.escape_default().to_string(),
        kind: kind.chars().take(32).flat_map(char::escape_default).collect(),
    };
    let info = model::figures(kind).ok_or_else(|| wrong(kind))?;
    if !message::is_plain(&device.device_id) || known.is_some_and(|known| known.info != info) {
        return Err(wrong(kind));
    }
    if device.status.in_use == Some(true) {
        return Err(ConnectionError::InUse(id));
    }
    let versions = config.and_then(|c| c.device_info);
    Ok(Description {
        info,
        id,
        firmware: versions.and_then(|v| Some((v.major_version?, v.minor_version?))),
        service: None,
        grip: None,
    })
}

/// Refuses a frame other than the requested one; a field that the service omits counts as granted.
fn axes(answer: &Frame<'_>, id: &str) -> Result<(), ConnectionError> {
    let device = answer.device(id).ok_or(ConnectionError::OtherProgram("a state"))?;
    let config = device.config.as_ref();
    let basis = config.and_then(|c| c.basis.as_ref());
    if let Some(basis) = basis.filter(|b| b.permutation.replace('+', "") != "XYZ") {
        return Err(ConnectionError::OtherAxes(basis.permutation.chars().take(16).collect()));
    }
    let scaled = config
        .and_then(|c| c.mount.as_ref())
        .is_some_and(|m| !m.keeps_lengths());
    if scaled || device.state.transform.as_ref().is_some_and(|t| !t.keeps_axes()) {
        return Err(ConnectionError::OtherAxes("a transform".to_owned()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_are_list_places_and_versions_from_3_5_are_supported() {
        assert_eq!("1".parse(), Ok(Wanted::Number(1)));
        assert_eq!("12".parse(), Ok(Wanted::Number(12)));
        assert_eq!("0490".parse(), Ok(Wanted::Id("0490".to_owned())));
        assert_eq!("A1".parse(), Ok(Wanted::Id("A1".to_owned())));
        for (version, supported) in [
            ("3.5.0.0", true),
            ("3.12", true),
            ("3.4.9", false),
            ("4.0.0", false),
            ("", false),
        ] {
            assert_eq!(is_supported(version), supported, "{version}");
        }
    }
}
