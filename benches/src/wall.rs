//! A virtual wall behind the gate, against the simulated Phantom in a hand: how stiff before it sings?

use nalgebra::Vector3;
use stylet_hw::{BadLink, Device, Hand, HandGoal, LinkFaults, SimulatedPhantom, SimulatedPhantomConfig, Wrench};
use stylet_sim::force::gate::{self, GateInput};
use stylet_sim::force::{GateParameters, GateState, Motion, PassivityParameters, VelocityEstimator};

#[derive(Clone, Copy, Debug)]
pub struct Wall {
    pub stiffness_n_per_m: f64,
    pub damping_n_s_per_m: f64,
    pub period_s: f64,
    pub late_ticks: usize,
    pub controlled: bool,
}

/// Faster than this half a second after it was pressed into the wall, the tip sings.
const SINGING_M_PER_S: f64 = 5e-3;

impl Wall {
    /// Presses 3 mm into it with `hand`, and waits; returns whether the wall sings.
    pub fn sings(&self, hand: Hand) -> bool {
        let faults = LinkFaults {
            late_ticks: self.late_ticks,
            ..LinkFaults::default()
        };
        let phantom = SimulatedPhantom::new(SimulatedPhantomConfig {
            hand,
            start_tip_in_world: Vector3::z() * -1e-3,
            ..SimulatedPhantomConfig::default()
        });
        let info = phantom.info();
        let mut device = BadLink::new(phantom, faults);
        device.set_hand_goal(&HandGoal {
            tip_in_world: Vector3::z() * 3e-3,
            direction: Vector3::z(),
            speed_m_per_s: 0.05,
            acceleration_m_per_s2: 2.0,
        });
        let mut parameters = GateParameters {
            force_scale: 1.0,
            ramp_in_ticks: 1,
            slew_n_per_s: 1e5,
            ..GateParameters::default()
        };
        if !self.controlled {
            parameters.passivity = PassivityParameters::OFF;
        }
        let (mut state, mut velocity) = (GateState::default(), VelocityEstimator::new(info.position_step_m));
        state.engage();
        let (mut before, mut fastest) = (Vector3::z() * -1e-3, 0.0f64);
        for tick in 0..(1.5 / self.period_s) as u64 {
            let tip = device
                .read(self.period_s)
                .expect("the simulated device answers")
                .tip_in_world;
            let velocity_m_per_s = velocity.update(&tip, self.period_s);
            let pressed_m = tip.z.max(0.0);
            let damping = if pressed_m > 0.0 { self.damping_n_s_per_m } else { 0.0 };
            let push_n = (self.stiffness_n_per_m * pressed_m + damping * velocity_m_per_s.z).max(0.0);
            let input = GateInput {
                constant_n: Vector3::zeros(),
                wanted: Wrench::from_force(Vector3::z() * -push_n),
                stored_j: 0.5 * self.stiffness_n_per_m * pressed_m * pressed_m,
                motion: Motion {
                    moved_m: tip - before,
                    velocity_m_per_s,
                    position_step_m: info.position_step_m,
                    dt_s: self.period_s,
                },
            };
            let output = gate::step(&parameters, &info, &mut state, &input);
            device.write(&output.wrench).expect("the gate gives numbers");
            before = tip;
            if tick as f64 * self.period_s > 1.0 {
                fastest = fastest.max(device.device.true_velocity_m_per_s().norm());
            }
        }
        fastest > SINGING_M_PER_S
    }

    /// Returns the largest stiffness up to which nothing sings, on a grid of a twelfth of an octave; at most `most`.
    pub fn stiffest(&self, hand: Hand, most_n_per_m: f64) -> f64 {
        let at = |n: i32| 100.0 * 2f64.powf(f64::from(n) / 12.0);
        let sings = |n: i32| {
            let wall = Wall {
                stiffness_n_per_m: at(n),
                ..*self
            };
            wall.sings(hand)
        };
        // Coarse first; what sings does so at once above its limit.
        let steps = ((most_n_per_m / 100.0).log2() * 12.0).floor() as i32;
        let coarse = (0..=steps).step_by(4).find(|&n| sings(n)).unwrap_or(steps + 1);
        let fine = ((coarse - 4).max(0)..coarse).find(|&n| sings(n)).unwrap_or(coarse);
        at((fine - 1).max(0))
    }
}
