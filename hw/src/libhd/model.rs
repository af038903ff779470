//! Limits and encoder steps of each model name, which the driver does not report.

use crate::device::DeviceInfo;

/// Forces, stiffness and torque as in CHAI3D 3.3; continuous force and position step from the
/// vendor's data sheets. A smaller force that the driver reports replaces the figure here.
const MODELS: &[DeviceInfo] = &[
    DeviceInfo::phantom_premium_1_5(),
    DeviceInfo {
        name: "Phantom Premium 1.5",
        peak_torque_nm: 0.0,
        ..DeviceInfo::phantom_premium_1_5()
    },
    DeviceInfo {
        name: "Phantom Premium 3.0 6DOF",
        peak_force_n: 22.0,
        continuous_force_n: 3.0,
        max_stiffness_n_per_m: 1000.0,
        position_step_m: 2e-5,
        ..DeviceInfo::phantom_premium_1_5()
    },
    small("Phantom Desktop", 7.9, 1.75, 1000.0, 2.3e-5),
    small("Phantom Omni", 3.3, 0.88, 700.0, 5.5e-5),
    small("Touch", 3.3, 0.88, 400.0, 5.5e-5),
];

const fn small(name: &'static str, peak_n: f64, continuous_n: f64, stiffness_n_per_m: f64, step_m: f64) -> DeviceInfo {
    DeviceInfo {
        name,
        peak_force_n: peak_n,
        continuous_force_n: continuous_n,
        peak_torque_nm: 0.0,
        max_stiffness_n_per_m: stiffness_n_per_m,
        position_step_m: step_m,
        simulated: false,
    }
}

/// Largest torque of each gimbal joint, N m: turn, lift, roll (the vendor's example for torques).
pub const GIMBAL_TORQUE_LIMITS_NM: [f64; 3] = [0.188, 0.188, 0.048];

/// Returns the figures of the model that the driver names, in upper or lower case; `None` for an
/// unknown model.
pub fn figures(model: &str) -> Option<DeviceInfo> {
    MODELS
        .iter()
        .find(|m| m.name.eq_ignore_ascii_case(model.trim()))
        .copied()
}

/// Returns the names of all known models, for messages.
pub fn known_models() -> String {
    MODELS.iter().map(|m| m.name).collect::<Vec<_>>().join(", ")
}

/// Returns the smaller of figure and report; a report that is not a positive number is ignored.
pub fn with_reported(mut info: DeviceInfo, peak_n: f64, continuous_n: f64, output_dof: i32) -> DeviceInfo {
    let smaller = |figure: f64, reported: f64| if reported > 0.0 { figure.min(reported) } else { figure };
    info.peak_force_n = smaller(info.peak_force_n, peak_n);
    info.continuous_force_n = smaller(info.continuous_force_n, continuous_n).min(info.peak_force_n);
    if output_dof < 6 {
        info.peak_torque_nm = 0.0;
    }
    info
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_found_by_its_exact_name() {
        assert_eq!(figures("PHANTOM Premium 1.5 6DOF").unwrap().peak_torque_nm, 0.188);
        assert_eq!(figures("PHANTOM Premium 1.5").unwrap().peak_torque_nm, 0.0);
        assert!(figures("PHANTOM Premium").is_none());
    }

    #[test]
    fn a_report_can_only_lower_a_limit() {
        let info = DeviceInfo::phantom_premium_1_5();
        let lower = with_reported(info, 6.0, 1.0, 3);
        assert_eq!(
            (lower.peak_force_n, lower.continuous_force_n, lower.peak_torque_nm),
            (6.0, 1.0, 0.0)
        );
        for useless in [f64::NAN, 0.0, -1.0, 100.0] {
            assert_eq!(with_reported(info, useless, useless, 6), info);
        }
    }
}
