//! The conformance test that every back end must pass.

use crate::device::{Device, DeviceFault, HandGoal, Wrench};
use nalgebra::Vector3;

const DT_S: f64 = 1e-3;

/// Checks the obligations of the [`Device`] trait on a device at rest. Leaves the device at zero force.
///
/// # Panics
///
/// When the device breaks an obligation.
///
/// ```
/// use stylet_hw::{SimulatedPhantom, SimulatedPhantomConfig, conformance};
/// conformance::check(&mut SimulatedPhantom::new(SimulatedPhantomConfig::default()));
/// ```
pub fn check(device: &mut dyn Device) {
    let info = device.info();
    assert!(!info.name.is_empty());
    assert!(info.peak_force_n > 0.0 && info.continuous_force_n <= info.peak_force_n);
    assert!(info.position_step_m >= 0.0 && info.max_stiffness_n_per_m > 0.0);

    let mut sequence = 0;
    for tick in 0..2000u32 {
        let sample = device.read(DT_S).expect("a device at rest gives samples");
        assert!(sample.is_finite());
        assert!((sample.direction_in_world().norm() - 1.0).abs() < 1e-9);
        assert!(sample.sequence >= sequence, "sequence goes back");
        sequence = sample.sequence;
        let push = Vector3::new(f64::from(tick).sin(), f64::from(tick).cos(), 0.3);
        assert_eq!(device.write(&Wrench::from_force(push)), Ok(()));
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let force = Wrench::from_force(Vector3::new(0.0, bad, 0.0));
        assert_eq!(device.write(&force), Err(DeviceFault::NonFiniteWrench));
        let torque = Wrench {
            torque_nm: Vector3::repeat(bad),
            ..Wrench::zero()
        };
        assert_eq!(device.write(&torque), Err(DeviceFault::NonFiniteWrench));
        assert_eq!(device.write(&Wrench::zero()), Ok(()), "zero force is always accepted");
        assert!(device.read(DT_S).is_ok());
    }
    let bad_goal = HandGoal {
        tip_in_world: Vector3::repeat(f64::NAN),
        direction: Vector3::zeros(),
        speed_m_per_s: -1.0,
        acceleration_m_per_s2: f64::INFINITY,
    };
    device.set_hand_goal(&bad_goal);
    assert_eq!(
        device.write(&Wrench::from_force(Vector3::repeat(1e300))),
        Ok(()),
        "too much is saturated, not refused"
    );
    for _ in 0..10 {
        assert!(device.read(DT_S).expect("still there").is_finite());
    }
    assert_eq!(device.write(&Wrench::zero()), Ok(()));
    assert_eq!(device.info(), info, "a device does not change what it is");
}
