//! Instructor-injected faults in the force loop.

use super::*;

/// A device taken away by the instructor causes every force and fault of an unplugged one.
#[test]
fn a_device_that_counts_as_lost_is_felt_as_one_that_is() {
    let felt = |record: &TickRecord| {
        (
            record.force_on_hand_n.map(f64::to_bits),
            record.fault,
            record.flags & flags::ENGAGED,
        )
    };
    let mut runs = [Rig::new(), Rig::new()].map(|mut rig| {
        rig.press();
        rig
    });
    let set = |runs: &mut [Rig; 2], lost: bool| {
        runs[0].set(if lost { Cause::Lost } else { Cause::Nothing });
        runs[1].order(HapticOrder::LoseDevice(lost));
    };
    set(&mut runs, true);
    let [real, exercise] = runs.each_mut().map(|rig| rig.run(400));
    assert_eq!(real[0].fault, Fault::DeviceLost as u32);
    let differs = real.iter().zip(&exercise).position(|(a, b)| felt(a) != felt(b));
    assert_eq!(differs, None, "the first tick that differs");
    let zero = exercise.iter().position(|r| force_n(r) == 0.0).expect("zero at last");
    assert!(zero <= RAMP_OUT_TICKS as usize, "{zero} ticks to zero");
    // Re-armed while lost, it is lost again.
    for rig in &mut runs {
        rig.order(HapticOrder::Engage);
        let last = *rig.run(50).last().expect("ticks");
        assert_eq!((last.fault, last.flags & flags::ENGAGED), (Fault::DeviceLost as u32, 0));
    }
    set(&mut runs, false);
    for rig in &mut runs {
        assert_ne!(rig.run(50).last().expect("ticks").fault, 0, "kept until re-armed");
        rig.order(HapticOrder::Engage);
        assert_eq!(rig.run(50).last().expect("ticks").fault, 0);
    }
}

/// The device and its motion stay in place; the needle moves within the body at a patient's pace.
#[test]
fn a_body_shift_moves_the_needle_in_the_body_but_not_hand_or_goal() {
    let mut rig = Rig::new();
    rig.order(to_depth(-0.01));
    let before = *rig.run(1500).last().expect("ticks");
    assert_ne!(before.flags & flags::AT_GOAL, 0);
    rig.order(HapticOrder::MoveBody([0.003, 0.0, -0.004]));
    let mut in_body_m = Vector3::from(before.tip_in_scene_m);
    for _ in 0..1100 {
        let record = rig.tick();
        let pose = *rig.tissue_ports.pose.read();
        assert!((pose.tip_in_scene - in_body_m).norm() <= 5e-6 + 1e-12, "a jump");
        in_body_m = pose.tip_in_scene;
        for a in 0..3 {
            let moved_m = record.tip_in_scene_m[a] - before.tip_in_scene_m[a];
            assert!(moved_m.abs() < 1e-5, "the hand has moved by {moved_m}");
        }
    }
    let off_m = Vector3::from(rig.tick().tip_in_scene_m) - in_body_m;
    assert!((off_m - Vector3::new(0.003, 0.0, -0.004)).norm() < 1e-9, "{off_m}");
    assert_ne!(rig.tick().flags & flags::AT_GOAL, 0);
    rig.order(HapticOrder::Reset);
    let record = rig.tick();
    let pose = *rig.tissue_ports.pose.read();
    assert_eq!(record.tip_in_scene_m, <[f64; 3]>::from(pose.tip_in_scene));
    assert_eq!(pose.body_moved_m, Vector3::zeros());
}
