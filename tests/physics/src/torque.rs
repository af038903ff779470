//! The torque that keeps a needle on its path, against many wrists over a delayed link.

use crate::rows::{Row, keep};
use nalgebra::{UnitQuaternion, Vector3};
use stylet_hw::{DeviceInfo, Sample};
use stylet_sim::force::ForceParameters;
use stylet_sim::force::chain::{ChainParameters, ChainState, step_on_line};
use stylet_sim::line::{HandLine, Line};
use stylet_sim::needle::NeedleParameters;

/// A wrist that holds the handle, about one axis.
#[derive(Clone, Copy)]
struct Wrist {
    inertia_kg_m2: f64,
    damping_nm_s_per_rad: f64,
    stiffness_nm_per_rad: f64,
}

/// Corners and the centre of each axis. Assumed: a pen grip at the soft end, a wrist with a fist at the stiff one.
fn wrists() -> impl Iterator<Item = Wrist> {
    let (inertias, dampings, stiffnesses) = ([2e-4, 8e-4, 3e-3], [5e-3, 1.6e-2, 5e-2], [0.1, 0.45, 2.0]);
    inertias.into_iter().flat_map(move |inertia_kg_m2| {
        dampings.into_iter().flat_map(move |damping_nm_s_per_rad| {
            stiffnesses.into_iter().map(move |stiffness_nm_per_rad| Wrist {
                inertia_kg_m2,
                damping_nm_s_per_rad,
                stiffness_nm_per_rad,
            })
        })
    })
}

const TICK_S: f64 = 1e-3;
/// Steps of the wrist's own motion in a tick.
const STEPS: usize = 50;
/// Step of a rotary encoder of a Phantom's gimbal; more than half of it is an oscillation.
const SEEN_RAD: f64 = 2e-3;

/// Turns the handle by 10 degrees with the tip 45 mm deep; returns the swing in the first and the last half second of
/// eight, and the largest torque.
fn turn(wrist: Wrist, late_ticks: usize, gain: f64) -> (f64, f64, f64) {
    let info = DeviceInfo::phantom_premium_1_5();
    let force = ForceParameters {
        guide_torque_nm_per_rad: gain * ForceParameters::default().guide_torque_nm_per_rad,
        ..ForceParameters::default()
    };
    let parameters = ChainParameters {
        needle: NeedleParameters::default(),
        force,
    };
    let line = Line::new([0.0; 3], [0.0, 0.0, 1.0]).expect("a direction");
    let mut line = HandLine::uniform(1, line, 60).expect("a line");
    let mut chain = ChainState::new(&info);
    chain.gate.engage();
    let (mut angle, mut speed) = (0.0_f64, 0.0_f64);
    let mut torques = vec![0.0; late_ticks + 1];
    let (mut angles, mut most_nm) = (Vec::new(), 0.0_f64);
    for tick in 0..8600_usize {
        let aim = if tick < 600 { 0.0 } else { 10.0_f64.to_radians() };
        let torque = torques[late_ticks];
        let (m, b, k) = (
            wrist.inertia_kg_m2,
            wrist.damping_nm_s_per_rad,
            wrist.stiffness_nm_per_rad,
        );
        let h = TICK_S / STEPS as f64;
        for _ in 0..STEPS {
            speed = (speed * m + h * (torque + k * (aim - angle))) / (m + h * b + h * h * k);
            angle += h * speed;
        }
        let deep_m = 45e-3 * (tick as f64 / 400.0).min(1.0);
        let sample = Sample {
            tip_in_world: Vector3::z() * deep_m,
            world_from_tool: UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle),
            buttons: 0,
            sequence: tick as u64,
        };
        let output = step_on_line(&parameters, &info, &mut chain, &sample, &mut line, None, TICK_S);
        torques.rotate_right(1);
        torques[0] = output.wrench.torque_nm.x;
        most_nm = most_nm.max(torques[0].abs());
        if tick >= 600 {
            angles.push(angle);
        }
    }
    let swing = |part: &[f64]| {
        let (low, high) = part
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), a| (l.min(*a), h.max(*a)));
        high - low - (part[part.len() - 1] - part[0]).abs()
    };
    (swing(&angles[..500]), swing(&angles[angles.len() - 500..]), most_nm)
}

#[test]
fn no_wrist_sings_that_turns_a_deep_needle() {
    let mut widest: [f64; 4] = [0.0; 4];
    let (mut singing, mut most_nm) = ([0; 4], 0.0_f64);
    for late_ticks in 0..=3 {
        for wrist in wrists() {
            let (_, late_rad, torque_nm) = turn(wrist, late_ticks, 1.0);
            widest[late_ticks] = widest[late_ticks].max(late_rad);
            singing[late_ticks] += usize::from(late_rad > SEEN_RAD);
            most_nm = most_nm.max(torque_nm);
        }
    }
    keep(&Row {
        number: 41,
        case: "handle turned by 10 degrees, 45 mm deep, 27 wrists, 0 to 3 ticks late",
        model: "needle line",
        should: "none oscillates",
        happened: format!(
            "{singing:?} of 27 by lateness; widest swing {:.2} mrad; at most {most_nm:.3} Nm",
            widest.iter().copied().fold(0.0, f64::max) * 1e3
        ),
        met: singing == [0; 4],
        warning: "",
    });
    assert!(most_nm > 0.03, "the torque loop has nothing to do: {most_nm} Nm");
}

/// Shows that the test above can fail: a guide ten times as stiff over the same links.
#[test]
fn a_torque_ten_times_as_stiff_sings_over_a_late_link() {
    let singing = wrists().filter(|&wrist| turn(wrist, 3, 10.0).1 > SEEN_RAD).count();
    println!("ten times the guide's torque, 3 ticks late: {singing} of 27 sing");
    assert!(singing > 0);
}
