//! Limits of each type of device, which the service does not report.

use crate::device::DeviceInfo;

/// Limits by type. No force, stiffness or encoder step of an Inverse3 was found in public text. The
/// peak is the safety limit that Isaac Lab (`isaaclab.devices.haply`, `limit_force`) gives to the
/// same device through the same service. The continuous force, half of it, and the step of 10 um
/// are our choice. So is the stiffness, that of the Phantom for which the scenes are made: with
/// less, the core refuses them.
const MODELS: &[(&str, DeviceInfo)] = &[
    ("inverse3", model("Haply Inverse3")),
    ("inverse3x", model("Haply Inverse3x")),
];

const fn model(name: &'static str) -> DeviceInfo {
    DeviceInfo {
        name,
        peak_force_n: 2.0,
        continuous_force_n: 1.0,
        peak_torque_nm: 0.0,
        max_stiffness_n_per_m: 800.0,
        position_step_m: 1e-5,
        simulated: false,
    }
}

/// Returns the figures of the type that the service reports; `None` for an unknown one.
pub fn figures(kind: &str) -> Option<DeviceInfo> {
    MODELS.iter().find(|(known, _)| *known == kind).map(|(_, info)| *info)
}

/// Returns the names of all known types, for messages.
pub fn known_types() -> String {
    MODELS.iter().map(|(kind, _)| *kind).collect::<Vec<_>>().join(", ")
}
