//! Claims about the gate for every float: special values, denormals and random bits, in sequences of up to 64 ticks.

use super::*;
use crate::force::passivity::PassivityParameters;
use stylet_random::Random;

/// Number of sequences; the environment variable of this name sets another.
const CASES: &str = "STYLET_GATE_CASES";
const USUAL_CASES: u64 = 150_000;
const MOST_TICKS: u64 = 64;
/// Periods of a loop with a device.
const PERIODS_S: std::ops::RangeInclusive<f64> = 1e-4..=1e-2;

const SPECIAL: [f64; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    -f64::MIN_POSITIVE,
    f64::EPSILON,
    5e-324,
    -5e-324,
];
const FAULTS: [ForceFault; 6] = [
    ForceFault::NonFiniteForce,
    ForceFault::DeviceFault,
    ForceFault::StaleDevice,
    ForceFault::StaleTissue,
    ForceFault::Overrun,
    ForceFault::Stopped,
];

/// Floats of every kind: every seed gives another sequence.
struct Bits(Random);

impl Bits {
    fn below(&mut self, n: u64) -> u64 {
        self.0.draw() % n
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.unit()
    }

    fn any(&mut self) -> f64 {
        match self.below(4) {
            0 => SPECIAL[self.below(SPECIAL.len() as u64) as usize],
            1 => f64::from_bits(self.0.draw() & 0x800f_ffff_ffff_ffff),
            _ => f64::from_bits(self.0.draw()),
        }
    }

    /// Draws a number mostly of a size that the gate is built for, so that sequences get past the first tick.
    fn near(&mut self, size: f64) -> f64 {
        match self.one_in(64) {
            true => self.any(),
            false => self.within(-size, size),
        }
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.near(size))
    }

    /// Settings that pass [`GateParameters::validate`], with its ends among them.
    fn parameters(&mut self) -> GateParameters {
        let mut end = |low: f64, high: f64| match self.below(8) {
            0 => low,
            1 => high,
            _ => self.within(low, high),
        };
        let parameters = GateParameters {
            force_scale: end(0.0, 2.0),
            max_force_n: end(0.0, 40.0),
            slew_n_per_s: end(1.0, 5e3),
            torque_slew_nm_per_s: end(1e-3, 1e3),
            engage_below_n: end(0.0, 10.0),
            ramp_in_ticks: end(1.0, 40.0) as u32,
            ramp_out_ticks: end(1.0, 40.0) as u32,
            // So slow that the motors stay cold: the limit of warm ones may fall faster than the slew.
            thermal_time_s: end(100.0, 1e5),
            passivity: PassivityParameters {
                margin_j: end(0.0, 10.0),
                max_damping_n_s_per_m: end(0.0, 50.0),
            },
        };
        assert_eq!(parameters.validate(), Ok(()));
        parameters
    }

    fn input(&mut self, dt_s: f64, calm: bool) -> GateInput {
        let size = if calm { 0.1 } else { 20.0 };
        GateInput {
            wanted: Wrench {
                force_n: self.vector(size),
                torque_nm: self.vector(0.5),
            },
            constant_n: if self.one_in(4) {
                self.vector(2.0)
            } else {
                Vector3::zeros()
            },
            stored_j: self.near(0.1),
            motion: Motion {
                moved_m: self.vector(1e-3),
                velocity_m_per_s: self.vector(1.0),
                position_step_m: self.near(1e-4),
                dt_s,
            },
        }
    }
}

/// Runs one sequence; an error names the tick and the claim that does not hold.
fn sequence(seed: u64) -> Result<(), String> {
    let bits = &mut Bits(Random(seed));
    let parameters = bits.parameters();
    let device = device();
    let period_s = PERIODS_S.start() + (PERIODS_S.end() - PERIODS_S.start()) * bits.within(0.0, 1.0);
    // A loop's period is a setting; one that is none must not break more than the slew that goes by it.
    let dt_s = if bits.one_in(16) { bits.any() } else { period_s };
    let mut state = GateState::default();
    let mut before = *state.output();
    // Ticks since the fault or release that ramps out.
    let mut off_for = 0;
    state.engage();
    for tick in 0..1 + bits.below(MOST_TICKS) {
        if bits.one_in(24) {
            state.trip(FAULTS[bits.below(6) as usize]);
        } else if bits.one_in(32) {
            state.engage();
        }
        let input = bits.input(dt_s, tick < 4);
        let out = step(&parameters, &device, &mut state, &input);
        let (force_n, torque_nm) = (out.wrench.force_n, out.wrench.torque_nm);
        let fails = |claim: &str| {
            Err(format!(
                "{claim}: seed {seed}, tick {tick}, {before:?} to {:?}",
                out.wrench
            ))
        };
        let slack = 1.0 + 1e-9;
        if !out.wrench.is_finite() {
            return fails("finite");
        }
        let most_n = match state.engaged() {
            true => parameters.max_force_n.min(device.peak_force_n),
            false => device.peak_force_n,
        };
        if force_n.norm() > most_n * slack || torque_nm.norm() > device.peak_torque_nm * slack {
            return fails("within the limits");
        }
        off_for = if state.engaged() { 0 } else { off_for + 1 };
        if off_for >= parameters.ramp_out_ticks && out.wrench != Wrench::zero() {
            return fails("zero after a fault");
        }
        // The ramp out goes straight to zero, however large its steps; a result that is no number is zero at once.
        let changes = [
            (force_n, before.force_n, parameters.slew_n_per_s),
            (torque_nm, before.torque_nm, parameters.torque_slew_nm_per_s),
        ];
        for (now, was, per_s) in changes {
            let is_slewed = (now - was).norm() <= per_s * dt_s * slack + 1e-12;
            let is_less = (!state.engaged() || state.waiting()) && now.norm() <= was.norm() * slack;
            if PERIODS_S.contains(&dt_s) && !is_slewed && !is_less {
                return fails("slew");
            }
        }
        before = out.wrench;
    }
    Ok(())
}

#[test]
fn every_float_gives_a_force_within_limits() {
    let asked = std::env::var(CASES).ok().map(|cases| cases.parse());
    let cases = asked.transpose().expect("a number of sequences").unwrap_or(USUAL_CASES);
    for seed in 0..cases {
        assert_eq!(sequence(seed), Ok(()));
    }
}
