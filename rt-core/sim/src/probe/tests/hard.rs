//! Hard cases of a hand with a probe, in which the contact must not stick, sink in, pull, or fail to end.

use super::{displace, small};
use crate::probe::BodyProbe;
use crate::probe::{ProbePose, ProbeState, Wrench, step};
use nalgebra::Vector3;
use stylet_heap as heap;

/// Deepest point in the probe, or under a force and off it, that a tick may leave, m.
const OPEN_M: f64 = 1e-6;

fn pose(tip_m: [f64; 3], axis: [f64; 3]) -> ProbePose {
    ProbePose::new(tip_m, axis).expect("a pose")
}

#[test]
fn a_probe_that_is_withdrawn_leaves_tissue_bit_identical_to_rest() {
    let fixture = small();
    let mut state = ProbeState::new(&fixture.probe);
    let pressed = fixture.go_in_and_press(&mut state, 8e-3, 20e-3);
    assert!(
        pressed.contacts > 5 && pressed.wrench.force_n()[1] < -0.5,
        "{pressed:?}"
    );
    displace(&fixture.probe, &mut state);
    assert!(state.share.0[1].iter().any(|u| *u > 1e-3));
    // Lifted at once, then out.
    step(&fixture.probe, &mut state, &fixture.pose(0.0, 20e-3), &[]);
    let out = step(&fixture.probe, &mut state, &fixture.pose(0.0, -0.2), &[]);
    assert_eq!((out.contacts, out.wrench), (0, Wrench::default()));
    displace(&fixture.probe, &mut state);
    assert!(state.share.0.iter().flatten().all(|u| u.to_bits() == 0));
    assert!(state.pressed().all(|(force_n, _)| force_n == 0.0));
    assert!(state.moved_m.iter().flatten().all(|m| *m == 0.0));
}

#[test]
fn where_the_probe_is_decides_and_not_how_it_came_there() {
    let fixture = small();
    let there = fixture.pose(6e-3, 20e-3);
    let mut slowly = ProbeState::new(&fixture.probe);
    let slow = fixture.go_in_and_press(&mut slowly, 6e-3, 20e-3);
    // Farther, and back; and slid along the wall.
    let mut otherwise = ProbeState::new(&fixture.probe);
    fixture.go_in_and_press(&mut otherwise, 9e-3, 8e-3);
    let back = step(&fixture.probe, &mut otherwise, &there, &[]);
    for c in 0..6 {
        assert!((slow.wrench.0[c] - back.wrench.0[c]).abs() < 1e-4, "{slow:?} {back:?}");
    }
    for (a, b) in slowly.moved_m.iter().flatten().zip(otherwise.moved_m.iter().flatten()) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}

#[test]
fn nothing_sinks_in_or_pulls_whatever_the_hand_does() {
    let fixture = small();
    let mut state = ProbeState::new(&fixture.probe);
    let middle = fixture.pose(0.0, 20e-3).tip_m;
    let (mut worst_m, mut passes) = (0.0_f64, Vec::new());
    // A hand that presses obliquely, slides, jumps by 5 mm in a tick, lifts and comes back: drawn by a fixed rule.
    let mut random = stylet_random::Random(1);
    let mut at = Vector3::from(middle);
    let mut axis = Vector3::new(0.0, 0.0, 1.0);
    for tick in 0..1500 {
        let size_m = if tick % 50 == 0 { 5e-3 } else { 0.5e-3 };
        at += Vector3::new(random.signed(), random.signed(), random.signed()) * size_m;
        at.x = at.x.clamp(middle[0] - 4e-3, middle[0] + 4e-3);
        at.y = at.y.clamp(middle[1] - 4e-3, middle[1] + 9e-3);
        at.z = at.z.clamp(middle[2] - 30e-3, middle[2] + 10e-3);
        axis = Vector3::new(
            (axis.x + 0.02 * random.signed()).clamp(-0.25, 0.25),
            (axis.y + 0.02 * random.signed()).clamp(-0.25, 0.25),
            1.0,
        );
        let calls = heap::calls_of_this_thread();
        let response = step(&fixture.probe, &mut state, &pose(at.into(), axis.into()), &[]);
        assert_eq!(heap::calls_of_this_thread(), calls, "tick {tick} touched the heap");
        displace(&fixture.probe, &mut state);
        let report = state.report();
        worst_m = worst_m.max(report.open_m);
        passes.push(report.passes);
        assert!(response.wrench.0.iter().all(|c| c.is_finite()));
        assert!(report.open_m < OPEN_M, "tick {tick}: {report:?}");
        // Nothing pulls: each force pushes its point out of the hollow, or along it.
        for (point, (force_n, to)) in fixture.probe.wall.points.iter().zip(state.pressed()) {
            let push: f64 = (0..3).map(|c| to[c] * point.outward[c]).sum();
            assert!(
                force_n >= 0.0 && (force_n == 0.0 || push <= 0.6),
                "{push} with {force_n}"
            );
        }
        // The stiffness has no energy to give.
        for row in 0..6 {
            assert!(response.stiffness[row][row] <= 0.0);
        }
    }
    passes.sort_unstable();
    println!(
        "deepest at a point after a tick: {:.4} um; passes p50 {}, p99 {}, most {}",
        1e6 * worst_m,
        passes[750],
        passes[1485],
        passes[1499]
    );
}

#[test]
fn a_pose_that_is_no_number_changes_nothing() {
    let fixture = small();
    let mut state = ProbeState::new(&fixture.probe);
    let before = fixture.go_in_and_press(&mut state, 4e-3, 20e-3);
    let broken = ProbePose {
        tip_m: [f64::NAN, 0.0, 0.0],
        axis: [0.0, 0.0, 1.0],
    };
    let after = step(&fixture.probe, &mut state, &broken, &[]);
    assert_eq!(after.pose, before.pose);
    for c in 0..6 {
        assert!((after.wrench.0[c] - before.wrench.0[c]).abs() < 1e-4);
    }
    // The first pose of all.
    let mut fresh = ProbeState::new(&fixture.probe);
    assert_eq!(step(&fixture.probe, &mut fresh, &broken, &[]).contacts, 0);
}

#[test]
fn the_stiffness_is_that_of_a_small_motion() {
    let fixture = small();
    let mut state = ProbeState::new(&fixture.probe);
    let pressed_m = 6e-3;
    let response = fixture.go_in_and_press(&mut state, pressed_m, 20e-3);
    let here = fixture.pose(pressed_m, 20e-3);
    let up = ProbePose {
        tip_m: [here.tip_m[0], here.tip_m[1] + 1e-4, here.tip_m[2]],
        ..here
    };
    let motion = here.motion_to(&up);
    let extrapolated = [0, 1, 2].map(|c| {
        let row = response.stiffness[c].iter().zip(motion);
        response.wrench.0[c] + row.map(|(k, m)| k * m).sum::<f64>()
    });
    let answered = step(&fixture.probe, &mut state, &up, &[]);
    let change = Vector3::from(answered.wrench.force_n()) - Vector3::from(response.wrench.force_n());
    let off = Vector3::from(answered.wrench.force_n()) - Vector3::from(extrapolated);
    println!(
        "0.1 mm on: force changes by {:.4} N, extrapolated to {:.4} N of it",
        change.norm(),
        off.norm()
    );
    assert!(off.norm() < 0.1 * change.norm(), "{off:?} of {change:?}");
}

#[test]
fn what_moves_the_wall_besides_changes_the_contact() {
    let fixture = small();
    let mut state = ProbeState::new(&fixture.probe);
    let pads = fixture.probe.wall.pads.len();
    let alone = fixture.go_in_and_press(&mut state, 4e-3, 20e-3);
    // Others lift the wall by 1 mm: as if the probe pressed 1 mm less.
    let beside: Vec<f64> = (0..3 * pads).map(|n| if n % 3 == 1 { 1e-3 } else { 0.0 }).collect();
    let beside_it = step(&fixture.probe, &mut state, &fixture.pose(4e-3, 20e-3), &beside);
    let mut less = ProbeState::new(&fixture.probe);
    let lower = fixture.go_in_and_press(&mut less, 3e-3, 20e-3);
    assert!(beside_it.wrench.force_n()[1] > alone.wrench.force_n()[1] + 0.05);
    assert!((beside_it.wrench.force_n()[1] - lower.wrench.force_n()[1]).abs() < 1e-4);
}

#[test]
fn the_probe_displaces_the_body_by_its_loads_and_releases_it() {
    let fixture = small();
    let mut body = BodyProbe::new(fixture.probe.clone());
    let mut state = ProbeState::new(&fixture.probe);
    for beyond_m in [-0.1, -0.02, 20e-3] {
        let pose = fixture.pose(3e-3, beyond_m);
        let mut is_shown = false;
        for tick in 0..4 {
            is_shown = body.follow(&pose);
            step(&fixture.probe, &mut state, &pose, &[]);
            if tick == 0 {
                // What is begun is added up to its end, over ticks that may have others.
                displace(&fixture.probe, &mut state);
            }
            if is_shown {
                break;
            }
        }
        assert_eq!(is_shown, beyond_m > -0.05);
    }
    assert!(body.displaces() && body.share() == &state.share);
    assert!(!body.follow(&fixture.pose(3e-3, 20e-3)) || body.report().passes > 0);
    for _ in 0..6 {
        body.follow(&fixture.pose(3e-3, -0.1));
    }
    assert!(!body.displaces() && body.share().0.iter().flatten().all(|u| *u == 0.0));
}
