//! The simulated operator: the path of the hand, and the insertion of a needle against resistance.

use nalgebra::Vector3;
use stylet_hw::{Device, Hand, HandGoal, HandPath, SimulatedPhantom, SimulatedPhantomConfig, Wrench};

use crate::DT_S;

fn goal(x: f64, y: f64, z: f64) -> HandGoal {
    HandGoal {
        tip_in_world: Vector3::new(x, y, z),
        direction: Vector3::z(),
        speed_m_per_s: 0.05,
        acceleration_m_per_s2: 0.5,
    }
}

fn has_arrived(path: &HandPath) -> bool {
    *path.velocity_m_per_s() == Vector3::zeros() && *path.position_m() == path.goal().tip_in_world
}

#[test]
fn a_path_from_rest_is_straight_and_trapezoidal() {
    let mut path = HandPath::at(Vector3::zeros(), Vector3::z());
    let target = goal(0.03, -0.04, 0.05);
    path.set_goal(&target);
    let axis = target.tip_in_world.normalize();
    let length = target.tip_in_world.norm();
    let (mut fastest, mut ticks) = (0.0f64, 0);
    while !has_arrived(&path) && ticks < 10_000 {
        path.step(DT_S);
        let along = axis.dot(path.position_m());
        assert!((path.position_m() - axis * along).norm() < 1e-12, "bent");
        assert!(
            along <= length + 0.1 * 0.5 * DT_S * DT_S,
            "overshoots by {} at {ticks}",
            along - length
        );
        fastest = fastest.max(path.velocity_m_per_s().norm());
        ticks += 1;
    }
    // length / v + v / a
    let expected_s = length / 0.05 + 0.05 / 0.5;
    assert!((f64::from(ticks) * DT_S - expected_s).abs() < 5e-3, "{ticks}");
    assert!((fastest - 0.05).abs() < 1e-12);
    assert_eq!(*path.position_m(), target.tip_in_world);
}

#[test]
fn a_new_goal_never_makes_the_velocity_jump() {
    let mut path = HandPath::at(Vector3::zeros(), Vector3::z());
    let mut before = Vector3::zeros();
    for tick in 0..100_000u32 {
        if tick % 137 == 0 {
            let at = |salt: u32| f64::from((tick + salt).wrapping_mul(2_654_435_761) % 1000) * 1e-4;
            path.set_goal(&goal(at(1), at(2), at(3)));
        }
        path.step(DT_S);
        let change = (path.velocity_m_per_s() - before).norm();
        assert!(change <= 0.5 * DT_S * (1.0 + 1e-9), "jumps by {change}");
        before = *path.velocity_m_per_s();
    }
    for _ in 0..10_000 {
        path.step(DT_S);
    }
    assert!(has_arrived(&path), "it must not circle its goal");
}

#[test]
fn an_invalid_goal_changes_nothing() {
    let mut path = HandPath::at(Vector3::zeros(), Vector3::z());
    for bad in [
        HandGoal {
            speed_m_per_s: 0.0,
            ..goal(1.0, 0.0, 0.0)
        },
        HandGoal {
            direction: Vector3::zeros(),
            ..goal(1.0, 0.0, 0.0)
        },
        goal(f64::NAN, 0.0, 0.0),
    ] {
        assert!(!path.set_goal(&bad));
    }
    path.step(DT_S);
    assert_eq!(*path.position_m(), Vector3::zeros());
}

#[test]
fn the_tool_turns_to_the_needle_axis() {
    for aim in [Vector3::x(), -Vector3::z(), Vector3::new(1.0, 2.0, 3.0)] {
        let mut device = SimulatedPhantom::new(SimulatedPhantomConfig::default());
        device.set_hand_goal(&HandGoal {
            direction: aim,
            ..goal(0.0, 0.0, 0.0)
        });
        let mut before = device.read(DT_S).unwrap().world_from_tool;
        for _ in 0..2000 {
            let now = device.read(DT_S).unwrap().world_from_tool;
            assert!(now.angle_to(&before) <= 2.0 * DT_S + 1e-7, "turns too fast");
            before = now;
        }
        let reached = device.read(DT_S).unwrap().direction_in_world();
        assert!((reached - aim.normalize()).norm() < 1e-6);
    }
}

/// Returns a steady resistance that opposes motion towards +z, with a membrane that is punctured at
/// 8 mm.
fn tissue(depth_m: f64, punctured: &mut bool, held_at_m: &mut f64) -> f64 {
    if depth_m <= 0.0 {
        return 0.0;
    }
    if !*punctured && depth_m < 8e-3 {
        return -5.6 * depth_m / 8e-3;
    }
    let most = 1.5 + 80.0 * depth_m;
    if !*punctured {
        *punctured = true;
        *held_at_m = depth_m - most / 700.0;
    }
    let force = (700.0 * (*held_at_m - depth_m)).clamp(-most, 80.0 * depth_m);
    *held_at_m = depth_m + force / 700.0;
    force
}

#[test]
fn a_steady_operator_does_not_lunge_at_puncture() {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    device.set_hand_goal(&HandGoal {
        speed_m_per_s: 0.02,
        ..goal(0.0, 0.0, 0.04)
    });
    let (mut punctured, mut held_at) = (false, 0.0);
    let mut most_ahead = 0.0f64;
    for tick in 0..5000 {
        let depth = device.read(DT_S).unwrap().tip_in_world.z;
        let force = tissue(depth, &mut punctured, &mut held_at);
        device.write(&Wrench::from_force(Vector3::z() * force)).unwrap();
        most_ahead = most_ahead.max(depth - device.path().position_m().z);
        if tick >= 4500 {
            assert!((depth - 0.04).abs() < 3e-4, "{depth} m in tick {tick}");
        }
    }
    assert!(punctured);
    println!("furthest ahead of the path: {:.2} mm", most_ahead * 1e3);
    assert!(most_ahead < 3e-3, "lunges by {most_ahead} m");
}

#[test]
fn a_passive_hand_yields_like_its_spring() {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig {
        hand: Hand::passive(),
        coulomb_friction_n: 0.0,
        ..SimulatedPhantomConfig::default()
    });
    device.write(&Wrench::from_force(Vector3::x() * 20.0)).unwrap();
    for _ in 0..5000 {
        device.read(DT_S).unwrap();
    }
    assert!((device.true_tip_in_world().x - 8.5 / 300.0).abs() < 1e-6);
}

/// Checks that the acceleration limits the deceleration. The last step of the discrete motion may
/// overshoot by a part of `a dt^2`.
#[test]
fn a_stopped_path_never_reverses() {
    for (speed, acceleration, after_ticks) in [(0.05, 1.0, 300), (0.28, 2.0, 100), (0.05, 1.0, 20), (0.05, 1.0, 0)] {
        let mut path = HandPath::at(Vector3::zeros(), Vector3::z());
        path.set_goal(&HandGoal {
            tip_in_world: Vector3::new(0.0, 0.0, 0.2),
            direction: Vector3::z(),
            speed_m_per_s: speed,
            acceleration_m_per_s2: acceleration,
        });
        for _ in 0..after_ticks {
            path.step(DT_S);
        }
        let (from, v) = (path.position_m().z, path.velocity_m_per_s().z);
        path.stop();
        let mut last = from;
        let mut ticks = 0;
        while !has_arrived(&path) {
            path.step(DT_S);
            assert!(
                path.position_m().z >= last - acceleration * DT_S * DT_S,
                "{} after {last}",
                path.position_m().z
            );
            last = path.position_m().z;
            ticks += 1;
            assert!(ticks < 1000, "it never stops");
        }
        assert!(
            (last - from - v * v / (2.0 * acceleration)).abs() < 1e-9,
            "{last} from {from} at {v} m/s"
        );
        assert!(
            f64::from(ticks) * DT_S <= v / acceleration + 5.0 * DT_S,
            "{ticks} ticks from {v} m/s"
        );
    }
}

#[test]
fn the_push_of_an_operator_is_bounded() {
    let hand = Hand::steady();
    let mut push = Vector3::zeros();
    for _ in 0..100_000 {
        push = hand.push_n(&push, &Vector3::new(1.0, 1.0, 0.0), DT_S);
    }
    assert!((push.norm() - 12.0).abs() < 1e-9);
}

/// Checks the roll: the tool lies along the +z of its frame, and its +y follows the hand's request.
#[test]
fn a_hand_rolls_the_tool_only_on_request() {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig::default());
    let aim = Vector3::new(0.0, 0.6, 0.8);
    device.set_hand_goal(&HandGoal {
        direction: aim,
        ..goal(0.0, 0.0, 0.0)
    });
    let after = |device: &mut SimulatedPhantom, ticks: u32| {
        let mut turn = nalgebra::UnitQuaternion::identity();
        for _ in 0..ticks {
            let sample = device.read(DT_S).expect("a sample");
            assert!(
                turn == nalgebra::UnitQuaternion::identity() || turn.angle_to(&sample.world_from_tool) < 2.1 * DT_S
            );
            turn = sample.world_from_tool;
        }
        turn
    };
    let straight = after(&mut device, 2000);
    assert!((straight * Vector3::z() - aim).norm() < 1e-9);
    assert!(
        (straight * Vector3::y() - Vector3::new(0.0, 0.8, -0.6)).norm() < 1e-9,
        "no roll"
    );
    // Only the part perpendicular to the axis counts.
    device.set_hand_up(Some(Vector3::x() + aim));
    let turned = after(&mut device, 2000);
    assert!((turned * Vector3::z() - aim).norm() < 1e-9 && (turned * Vector3::y() - Vector3::x()).norm() < 1e-9);
    // A vector along the axis defines no roll, and neither does NaN.
    for up in [aim, Vector3::repeat(f64::NAN)] {
        device.set_hand_up(Some(up));
        assert!(after(&mut device, 2000).angle_to(&turned) < 1e-9);
    }
}
