//! The whole chain at 1 kHz, device to device: an operator inserts, holds and retracts a needle.

use nalgebra::Vector3;
use stylet_hw::{Device, HandGoal, SimulatedPhantom, SimulatedPhantomConfig};
use stylet_sim::force::chain::step;
use stylet_sim::force::{ChainParameters, ChainState, ForceParameters, LocalResponse, Touch};
use stylet_sim::needle::{LayerKind, NeedleParameters, Phase};

const DT_S: f64 = 1e-3;

struct Tick {
    depth_m: f64,
    speed_m_per_s: f64,
    force_n: Vector3<f64>,
    phase: Phase,
}

/// Goals by tick; the gland begins at the plane z = 0 and the needle points along +z.
fn insertion(goals: &[(usize, f64)], ticks: usize) -> (Vec<Tick>, ChainState) {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig {
        start_tip_in_world: Vector3::new(0.0, 0.0, -0.01),
        ..SimulatedPhantomConfig::default()
    });
    let info = device.info();
    let parameters = ChainParameters {
        needle: NeedleParameters::default(),
        force: ForceParameters::default(),
    };
    let mut state = ChainState::new(&info);
    state.gate.engage();
    let touch = Touch {
        contact_in_world: Vector3::zeros(),
        path_direction: Vector3::z(),
        layer: LayerKind::Gland,
        layer_number: 1,
        layer_in_world: Vector3::zeros(),
        local: LocalResponse::default(),
    };
    let mut log = Vec::with_capacity(ticks);
    let mut released = false;
    for tick in 0..ticks {
        for (_, z) in goals.iter().filter(|(at, _)| *at == tick) {
            device.set_hand_goal(&HandGoal {
                tip_in_world: Vector3::z() * *z,
                direction: Vector3::z(),
                speed_m_per_s: 0.02,
                acceleration_m_per_s2: 0.5,
            });
        }
        let sample = device.read(DT_S).unwrap();
        let touching = !released && sample.tip_in_world.z > 0.0 || state.path.innermost() > 0;
        let out = step(
            &parameters,
            &info,
            &mut state,
            &sample,
            touching.then_some(&touch),
            DT_S,
        );
        released |= out.left;
        device.write(&out.wrench).unwrap();
        log.push(Tick {
            depth_m: sample.tip_in_world.z,
            speed_m_per_s: device.true_velocity_m_per_s().norm(),
            force_n: out.wrench.force_n,
            phase: out.phase,
        });
    }
    (log, state)
}

#[test]
fn a_needle_goes_in_holds_still_and_comes_out() {
    let (log, state) = insertion(&[(0, 0.04), (5000, -0.01)], 10_000);
    let gate = &state.gate;
    assert_eq!((state.needle.punctures, gate.fault()), (1, None));

    let peak = log.iter().map(|t| -t.force_n.z).take(1500).fold(0.0, f64::max);
    println!("peak {peak:.2} N, {:?}", gate.counts());
    // 0.9 of 5.6 N and of the damping.
    assert!((4.9..5.4).contains(&peak), "membrane peak {peak} N");
    assert_eq!(
        gate.counts().passivity,
        0,
        "an insertion by a calm hand needs no damping"
    );

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
        let (log, _) = insertion(&[(0, 0.02), (1500, 0.0)], 3000);
        log.iter().map(|t| t.force_n.z.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(), bits());
}

/// Hosts need it to show the distance of a membrane from its puncture.
#[test]
fn the_output_has_the_puncture_depth_of_the_membrane_in_front() {
    let mut device = SimulatedPhantom::new(SimulatedPhantomConfig {
        start_tip_in_world: Vector3::new(0.0, 0.0, 0.001),
        ..SimulatedPhantomConfig::default()
    });
    let info = device.info();
    let parameters = ChainParameters {
        needle: NeedleParameters::default(),
        force: ForceParameters::default(),
    };
    let sample = device.read(DT_S).unwrap();
    for (layer, puncture_depth_m) in [
        (LayerKind::Gland, 8e-3),
        (LayerKind::Perineum, 12e-3),
        (LayerKind::Surroundings, 0.0),
        (LayerKind::Wall, 4e-3),
    ] {
        let touch = Touch {
            contact_in_world: Vector3::zeros(),
            path_direction: Vector3::z(),
            layer,
            layer_number: 1,
            layer_in_world: Vector3::zeros(),
            local: LocalResponse::default(),
        };
        let mut state = ChainState::new(&info);
        let out = step(&parameters, &info, &mut state, &sample, Some(&touch), DT_S);
        assert_eq!(out.puncture_depth_m, puncture_depth_m, "{layer:?}");
        let outside = step(&parameters, &info, &mut ChainState::new(&info), &sample, None, DT_S);
        assert_eq!(outside.puncture_depth_m, 0.0);
    }
}
