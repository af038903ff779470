//! Limits of each type of device, which the SDK does not report.

use core::ffi::c_int;

use crate::device::DeviceInfo;

/// Types, forces, torques and stiffness as in CHAI3D 3.3. Public text gives no continuous force, so
/// half of the peak is our choice. It gives no encoder step either: 10 um is assumed, and 1/400
/// inch for the Falcon.
const MODELS: &[(&[c_int], DeviceInfo)] = &[
    (&[33], model("Force Dimension omega.3", 12.0, 0.0, 5000.0)),
    (&[34, 36], model("Force Dimension omega.6", 12.0, 0.0, 5000.0)),
    (&[35, 37], model("Force Dimension omega.7", 12.0, 0.0, 5000.0)),
    (&[63], model("Force Dimension delta.3", 20.0, 0.0, 5000.0)),
    (&[64], model("Force Dimension delta.6", 20.0, 0.2, 5000.0)),
    (&[104, 105], model("Force Dimension sigma.7", 12.0, 0.2, 4000.0)),
    (
        &[60],
        DeviceInfo {
            position_step_m: 0.0254 / 400.0,
            ..model("Novint Falcon", 8.0, 0.0, 3000.0)
        },
    ),
];

const fn model(name: &'static str, peak_n: f64, peak_torque_nm: f64, stiffness_n_per_m: f64) -> DeviceInfo {
    DeviceInfo {
        name,
        peak_force_n: peak_n,
        continuous_force_n: peak_n / 2.0,
        peak_torque_nm,
        max_stiffness_n_per_m: stiffness_n_per_m,
        position_step_m: 1e-5,
        simulated: false,
    }
}

/// Returns the figures of the type that the SDK reports; `None` for an unknown one. Without an
/// active wrist there are no torques.
pub fn figures(system_type: c_int, active_wrist: bool) -> Option<DeviceInfo> {
    let (_, info) = MODELS.iter().find(|(types, _)| types.contains(&system_type))?;
    let peak_torque_nm = if active_wrist { info.peak_torque_nm } else { 0.0 };
    Some(DeviceInfo {
        peak_torque_nm,
        ..*info
    })
}

/// Returns the names of all known models, for messages.
pub fn known_models() -> String {
    MODELS.iter().map(|(_, m)| m.name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrist_without_motors_has_no_torque() {
        let types: Vec<_> = MODELS.iter().flat_map(|(types, _)| types.iter()).collect();
        for (i, kind) in types.iter().enumerate() {
            assert!(!types[i + 1..].contains(kind), "{kind}");
        }
        assert_eq!(figures(104, true).unwrap().peak_torque_nm, 0.2);
        assert_eq!(figures(104, false).unwrap().peak_torque_nm, 0.0);
        assert_eq!(figures(37, true).unwrap().name, "Force Dimension omega.7");
        assert!(figures(0, true).is_none());
    }
}
