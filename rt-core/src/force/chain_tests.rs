//! The whole chain at 1 kHz, device to device: an operator inserts, holds and retracts a needle.

use nalgebra::Vector3;
use stylet_hw::{Device, HandGoal, SimulatedPhantom, SimulatedPhantomConfig, Wrench};

use super::{
    ForceInput, ForceParameters, ForceState, GateState, PassivityParameters, PassivityState, VelocityEstimator, force,
    gate, passivity,
};
use crate::needle::{self, NeedleInput, NeedleParameters, NeedleState, Phase};

const DT_S: f64 = 1e-3;

struct Tick {
    depth_m: f64,
    speed_m_per_s: f64,
    force_n: Vector3<f64>,
    phase: Phase,
}

/// Goals by tick; the membrane is the plane z = 0 and the needle points along +z.
fn insertion(goals: &[(usize, f64)], ticks: usize) -> (Vec<Tick>, NeedleState, GateState, u64) {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig {
        start_tip_in_world: Vector3::new(0.0, 0.0, -0.01),
        ..SimulatedPhantomConfig::default()
    });
    let info = device.info();
    let (parameters, needle) = (ForceParameters::default(), NeedleParameters::default());
    let mut velocity = VelocityEstimator::new(info.position_step_m);
    let (mut state, mut law) = (NeedleState::default(), ForceState::default());
    let (mut watch, mut gate_state) = (PassivityState::default(), GateState::default());
    let mut before = device.read(DT_S).unwrap().tip_in_world;
    gate_state.engage();
    let mut log = Vec::with_capacity(ticks);
    for tick in 0..ticks {
        for (_, z) in goals.iter().filter(|(at, _)| *at == tick) {
            device.set_hand_goal(&HandGoal {
                tip_in_world: Vector3::z() * *z,
                direction: Vector3::z(),
                speed_m_per_s: 0.02,
                acceleration_m_per_s2: 0.5,
            });
        }
        let tip = device.read(DT_S).unwrap().tip_in_world;
        let v = velocity.update(&tip, DT_S);
        let step = tip - before;
        let out = needle::step(
            &needle,
            &mut state,
            &NeedleInput {
                depth_m: tip.z,
                speed_along_m_per_s: v.z,
                speed_m_per_s: v.norm(),
                tip_step_m: step,
            },
        );
        let input = ForceInput {
            tip_in_world: tip,
            velocity_m_per_s: v,
            path_origin_in_world: Vector3::zeros(),
            path_direction: Vector3::z(),
            depth_m: tip.z,
            puncture_depth_m: needle.puncture_depth_m,
            phase: out.phase,
            punctured: state.punctured,
        };
        let wanted = force(&parameters, &mut law, &input).total_n;
        let applied = *gate_state.output_n();
        let limits = PassivityParameters::default();
        let asked = passivity::step(&limits, &mut watch, &applied, &step, DT_S, &wanted);
        let given = gate::step(&parameters.gate, &info, &mut gate_state, &asked, DT_S);
        device.write(&Wrench::from_force(given.force_n)).unwrap();
        before = tip;
        log.push(Tick {
            depth_m: tip.z,
            speed_m_per_s: device.true_velocity_m_per_s().norm(),
            force_n: given.force_n,
            phase: out.phase,
        });
    }
    (log, state, gate_state, watch.interventions)
}

#[test]
fn a_needle_goes_in_holds_still_and_comes_out() {
    let (log, state, gate, interventions) = insertion(&[(0, 0.04), (5000, -0.01)], 10_000);
    assert_eq!((state.punctures, gate.fault()), (1, None));

    let peak = log.iter().map(|t| -t.force_n.z).take(1500).fold(0.0, f64::max);
    println!(
        "peak {peak:.2} N, {interventions} passivity interventions, {:?}",
        gate.counts()
    );
    assert!((5.4..6.0).contains(&peak), "membrane peak {peak} N");

    let hold: Vec<_> = log.get(4500..5000).unwrap().iter().collect();
    let low = hold.iter().map(|t| t.force_n.z).fold(f64::MAX, f64::min);
    let high = hold.iter().map(|t| t.force_n.z).fold(f64::MIN, f64::max);
    assert!(high - low < 0.2, "the force at rest moves by {} N", high - low);
    for tick in hold {
        assert!((tick.depth_m - 0.04).abs() < 3e-4, "{} m", tick.depth_m);
        assert!(tick.speed_m_per_s < 1e-3, "{} m/s at rest", tick.speed_m_per_s);
        assert_eq!(tick.phase, Phase::Hold);
    }
    let last = log.last().unwrap();
    assert!((last.depth_m + 0.01).abs() < 3e-4 && last.phase == Phase::Outside);
    assert!(last.force_n.norm() < 1e-9);
}

#[test]
fn the_same_session_gives_the_same_bytes() {
    let bits = || {
        let (log, ..) = insertion(&[(0, 0.02), (1500, 0.0)], 3000);
        log.iter().map(|t| t.force_n.z.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(), bits());
}
