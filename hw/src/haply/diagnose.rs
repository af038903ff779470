//! Checks of service and device for an Inverse3. The service is asked for its list; the device
//! receives nothing.

use crate::finding::{Finding, Severity};
use crate::haply::message::Inverse;
use crate::haply::session::{self, ConnectionError, is_supported};
use crate::haply::socket::{NoSocket, Service};
use crate::haply::wire::Wire;

/// Asks the service for its version and its devices.
pub fn diagnose(service: &Service) -> Vec<Finding> {
    let mut socket = match service.connect() {
        Ok(socket) => socket,
        Err(why @ NoSocket::NotTrusted(_)) => {
            let cure = "end that program and start the service as this user, or with sudo systemctl start haply-inverse-service";
            return vec![Finding::new(Severity::Problem, why.to_string(), cure)];
        }
        Err(why) => {
            let what = format!("no Inverse service answers at {service} ({why})");
            let cure = "install Haply Hub and start it, or sudo systemctl start haply-inverse-service, or name it with --haply-url";
            return vec![Finding::new(Severity::Problem, what, cure)];
        }
    };
    let mut findings = vec![of_version(service.version().as_deref())];
    let mut text = String::new();
    match session::next(&mut socket, &mut text, "a list of devices") {
        Ok(list) => {
            findings.extend(list.inverse3.iter().take(16).map(of_device));
            if list.inverse3.is_empty() {
                let what = "the service has no Inverse3";
                findings.push(Finding::new(Severity::Problem, what, "plug it in and switch it on"));
            }
            if list.grip().is_none() {
                let what = "no VerseGrip: the needle is held straight";
                findings.push(Finding::new(
                    Severity::Note,
                    what,
                    "connect a VerseGrip in Haply Hub to turn the needle",
                ));
            }
        }
        Err(why) => findings.push(Finding::new(
            Severity::Problem,
            why.to_string(),
            "update the service with Haply Hub",
        )),
    }
    socket.close();
    findings
}

fn of_version(version: Option<&str>) -> Finding {
    let update = "update it with Haply Hub";
    match version {
        Some(version) if is_supported(version) => Finding::good(format!("the Inverse service {version} answers")),
        Some(version) => {
            let what = format!("the Inverse service is of version {version}; 3.5 or a newer 3 is needed");
            Finding::new(Severity::Problem, what, update)
        }
        None => Finding::new(
            Severity::Warning,
            "the Inverse service does not say its version",
            update,
        ),
    }
}

fn of_device(device: &Inverse<'_>) -> Finding {
    let description = match session::describe(device, None) {
        Ok(description) => description,
        Err(why) => {
            let cure = match why {
                ConnectionError::InUse(_) => "close the other program",
                _ => "use a device of a known type",
            };
            return Finding::new(Severity::Problem, why.to_string(), cure);
        }
    };
    let name = format!("{} {}", description.info.name, description.id);
    let status = device.status;
    if status.power_supply == Some(false) {
        Finding::new(
            Severity::Problem,
            format!("{name}: no power"),
            "connect its power supply",
        )
    } else if status.calibrated == Some(false) {
        Finding::new(
            Severity::Warning,
            format!("{name} is not calibrated"),
            "calibrate it as its manual says",
        )
    } else if status.ready == Some(false) {
        Finding::new(
            Severity::Warning,
            format!("{name} is not ready"),
            "switch it off and on",
        )
    } else {
        Finding::good(format!("{name}: ready"))
    }
}
