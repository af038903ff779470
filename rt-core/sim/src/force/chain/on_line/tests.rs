//! The chain on a line: samples in, wrench out.

use super::*;
use crate::force::ForceParameters;
use crate::line::{Line, PronyTerm};
use crate::needle::NeedleParameters;

const DT_S: f64 = 1e-3;
const STATIONS: usize = 30;
const SPACING_M: f64 = 1e-3;
const SPEED_M_PER_S: f64 = 0.02;
const DEPTH_M: f64 = 0.025;
const CREEP: [PronyTerm; 2] = [
    PronyTerm {
        strength: 0.6,
        time_s: 0.5,
    },
    PronyTerm {
        strength: 1.0,
        time_s: 5.0,
    },
];

/// Returns parameters with shaft friction alone, so that the force of a station is known in closed form.
fn parameters(creep: [PronyTerm; 2]) -> ChainParameters {
    ChainParameters {
        needle: NeedleParameters::default(),
        force: ForceParameters {
            membrane_gain: 0.0,
            cutting_gain: 0.0,
            creep,
            ..ForceParameters::default()
        },
    }
}

/// Inserts to [`DEPTH_M`], then rests for 10 s; returns friction and wrench along the line in each tick.
fn insert_and_hold(creep: [PronyTerm; 2]) -> Vec<[f64; 2]> {
    let info = DeviceInfo::phantom_premium_1_5();
    let parameters = parameters(creep);
    let line = Line::new([0.0; 3], [0.0, 0.0, 1.0]).expect("a direction");
    let mut line = HandLine::uniform(1, line, STATIONS).expect("valid");
    line.set_forces(&parameters.layer_forces());
    let mut state = ChainState::new(&info);
    state.gate.engage();
    let mut ticks = Vec::new();
    let way = (DEPTH_M / (SPEED_M_PER_S * DT_S)).round() as u64;
    for tick in 0..way + 10_000 {
        let sample = Sample {
            tip_in_world: Vector3::z() * (tick.min(way) as f64 * SPEED_M_PER_S * DT_S),
            world_from_tool: nalgebra::UnitQuaternion::identity(),
            buttons: 0,
            sequence: tick,
        };
        let output = step_on_line(&parameters, &info, &mut state, &sample, &mut line, None, DT_S);
        ticks.push([-output.terms.friction_n.z, -output.wrench.force_n.z]);
    }
    ticks.split_off(way as usize)
}

/// Returns the force of one station that has slipped for `slipped_s` under a newton and then stays where it is, after
/// `held_s`: the two equations `T_i q_i' = f - q_i`, `f + sum J_i q_i` constant, by fourth-order Runge-Kutta in small
/// steps.
fn relaxed(slipped_s: f64, held_s: f64) -> f64 {
    let mut q = CREEP.map(|t| 1.0 - (-slipped_s / t.time_s).exp());
    let moved = |q: &[f64; 2]| CREEP.iter().zip(q).map(|(t, q)| t.strength * q).sum::<f64>();
    let held = 1.0 + moved(&q);
    let rate = |q: &[f64; 2]| [0, 1].map(|i| (held - moved(q) - q[i]) / CREEP[i].time_s);
    let steps = (held_s / 5e-3).ceil().max(1.0);
    let h = held_s / steps;
    for _ in 0..steps as u64 {
        let along = |k: &[f64; 2], by: f64| [0, 1].map(|i| q[i] + by * k[i]);
        let k1 = rate(&q);
        let k2 = rate(&along(&k1, 0.5 * h));
        let k3 = rate(&along(&k2, 0.5 * h));
        let k4 = rate(&along(&k3, h));
        q = [0, 1].map(|i| q[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    held - moved(&q)
}

#[test]
fn a_held_needle_relaxes_as_its_prony_chain() {
    let limit_n = ForceParameters::default()
        .layers
        .of(LayerKind::Gland)
        .shaft_friction_n_per_m
        * SPACING_M;
    let held = insert_and_hold(CREEP);
    let scale = ForceParameters::default().gate.force_scale;
    let count = (DEPTH_M / SPACING_M) as usize;
    for tick in [0, 50, 200, 1000, 3000, 9999] {
        let held_s = tick as f64 * DT_S;
        // A station slips with its full friction once all of it is in; the ends of that ramp are half a station early.
        let slipped = |n: usize| (DEPTH_M - (n as f64 + 0.5) * SPACING_M) / SPEED_M_PER_S;
        let wanted_n: f64 = (0..count).map(|n| limit_n * relaxed(slipped(n), held_s)).sum();
        let [friction_n, wrench_n] = held[tick];
        println!("{held_s} s: {friction_n:.4} N, closed form {wanted_n:.4} N, wrench {wrench_n:.4} N");
        assert!((friction_n / wanted_n - 1.0).abs() < 0.01, "{held_s} s");
        assert!(
            tick < 1000 || (wrench_n / (scale * friction_n) - 1.0).abs() < 1e-6,
            "{held_s} s"
        );
    }
    assert!(held[9999][0] < 0.6 * held[0][0]);
}

#[test]
fn without_creep_a_needle_held_at_depth_keeps_its_force() {
    let held = insert_and_hold([PronyTerm::default(); 2]);
    assert!(
        held.iter()
            .all(|[friction_n, _]| friction_n.to_bits() == held[0][0].to_bits())
    );
}
