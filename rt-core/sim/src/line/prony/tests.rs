//! Creep and relaxation of one station against their closed forms.

use super::*;
use stylet_random::Random;

const TERMS: [PronyTerm; 2] = [
    PronyTerm {
        strength: 0.5,
        time_s: 0.2,
    },
    PronyTerm {
        strength: 0.25,
        time_s: 3.0,
    },
];
const DT_S: f64 = 1e-3;

#[test]
fn a_constant_load_creeps_as_the_chain_says() {
    let rows = Rows::new(1, |_, _| 0.01);
    let mut memory = Memory::new(1);
    for tick in 1..=4000 {
        memory.begin(&rows, 0.0, &TERMS, DT_S);
        let u = memory.gain * 0.01 * 2.0 + memory.offset_m[0];
        let mut load = [2.0];
        memory.finish(&mut load, 0.0);
        assert!(
            (load[0] * 0.01 - u).abs() < 1e-15,
            "the load that is handed on moves the tissue there"
        );
        let time = f64::from(tick) * DT_S;
        let creep: f64 = TERMS
            .iter()
            .map(|t| t.strength * (1.0 - (-time / t.time_s).exp()))
            .sum();
        let wanted = 0.02 * (1.0 + creep);
        assert!((u / wanted - 1.0).abs() < 2e-3, "{tick}: {u} {wanted}");
    }
}

#[test]
fn no_terms_cost_nothing_and_change_nothing() {
    let rows = Rows::new(1, |_, _| 0.01);
    let mut memory = Memory::new(1);
    let before = memory.clone();
    memory.begin(&rows, 0.0, &[PronyTerm::default(); 2], DT_S);
    let mut load = [2.0];
    memory.finish(&mut load, 0.0);
    assert_eq!((load, memory), ([2.0], before));
}

/// Random loads: what the load does to the place is never less than what the chain then stores.
#[test]
fn the_chain_makes_no_energy() {
    let rows = Rows::new(1, |_, _| 0.01);
    let mut memory = Memory::new(1);
    let (mut random, mut before_m, mut work_j, mut least_j) = (Random(7), 0.0, 0.0, 0.0_f64);
    let mut force = 0.0_f64;
    for _ in 0..200_000 {
        force += 0.5 * random.signed() - 0.01 * force;
        memory.begin(&rows, 0.0, &TERMS, 0.01);
        let u = memory.gain * 0.01 * force + memory.offset_m[0];
        memory.finish(&mut [force], 0.0);
        work_j += force * (u - before_m);
        before_m = u;
        let stored = 0.5 * 0.01 * force * force + memory.stored_j(&rows, 0.0, &TERMS);
        least_j = least_j.min(work_j - stored);
    }
    assert!(work_j > 0.0 && least_j > -1e-12, "{least_j}");
}
