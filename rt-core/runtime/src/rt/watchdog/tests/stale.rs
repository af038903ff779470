//! Input that grows stale, at any clock reading: the force is zero once the ramp is over.

use super::*;
use stylet_hw::{DeviceInfo, Wrench};
use stylet_random::Random;
use stylet_sim::force::gate::{self, GateInput, GateParameters, GateState};
use stylet_sim::force::passivity::Motion;

const CASES: u64 = 20_000;

fn force_n(gate: &mut GateState, wanted_n: f64) -> f64 {
    let parameters = GateParameters {
        ramp_in_ticks: 1,
        ..GateParameters::default()
    };
    let input = GateInput {
        wanted: Wrench::from_force(Vector3::new(0.0, wanted_n, 0.0)),
        constant_n: Vector3::zeros(),
        stored_j: 0.0,
        motion: Motion {
            moved_m: Vector3::zeros(),
            velocity_m_per_s: Vector3::zeros(),
            position_step_m: 3e-5,
            dt_s: 1e-3,
        },
    };
    let device = DeviceInfo::phantom_premium_1_5();
    gate::step(&parameters, &device, gate, &input).wrench.force_n.norm()
}

#[test]
fn the_force_is_zero_once_device_or_tissue_is_stale() {
    for case in 0..CASES {
        let mut random = Random(case);
        let (mut watchdog, mut gate) = (Watchdog::default(), GateState::default());
        gate.engage();
        let begins = 3 + random.draw() % 20;
        let is_device = random.draw().is_multiple_of(2);
        let (after, off_at) = match is_device {
            true => (
                u64::from(SILENT_SAMPLES),
                begins + u64::from(SILENT_SAMPLES + RAMP_OUT_TICKS) - 2,
            ),
            false => (1, begins + u64::from(RAMP_OUT_TICKS)),
        };
        let mut largest_n: f64 = 0.0;
        for tick in 0..=off_at + 4 {
            let is_stale = tick >= begins;
            // At any clock reading, and at any age of the tissue's answer.
            let tissue_ns = random.draw() >> (1 + random.draw() % 62);
            let fresh_ns = tissue_ns.saturating_add(random.draw() % STALE_TISSUE_NS);
            let stale_ns = tissue_ns + STALE_TISSUE_NS + 1 + (random.draw() >> 2);
            let woke_ns = if is_stale && !is_device { stale_ns } else { fresh_ns };
            let of_device = watchdog.sample(is_stale && is_device);
            let of_tissue = watchdog.tick(&Watched {
                woke_ns,
                missed: 0,
                tissue_ns,
                tissue_unsolved: false,
                engaged: gate.engaged(),
            });
            for fault in [of_device, of_tissue].into_iter().flatten() {
                gate.trip(at_gate(fault));
                watchdog.raise(fault);
            }
            let wanted_n = if tick == 0 { 0.0 } else { 3.0 };
            let now_n = force_n(&mut gate, wanted_n);
            largest_n = largest_n.max(now_n);
            assert!(
                tick < off_at || now_n == 0.0,
                "case {case}, tick {tick}: {now_n} N, stale from {begins} + {after}"
            );
        }
        assert!(largest_n > 0.0, "case {case}: there was no force to take away");
    }
}
