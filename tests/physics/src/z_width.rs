//! Stiffest wall that the loop renders stably, against Colgate's bound.

use stylet_benches::wall::Wall;
use stylet_hw::Hand;

/// The hand that damps least.
const LIGHT: Hand = Hand {
    mass_kg: 0.1,
    damping_n_s_per_m: 2.0,
    stiffness_n_per_m: 220.0,
    effort: None,
};

#[test]
fn below_the_bound_no_wall_sings_at_any_rate_and_well_above_it_does() {
    for rate_hz in [1000.0, 2000.0, 5000.0] {
        let wall = |stiffness_n_per_m: f64, late_ticks| Wall {
            stiffness_n_per_m,
            damping_n_s_per_m: 0.0,
            period_s: 1.0 / rate_hz,
            late_ticks,
            controlled: false,
        };
        // K (T / 2 + d T) < b
        for late_ticks in 0..=3 {
            let bound = LIGHT.damping_n_s_per_m * rate_hz / (0.5 + late_ticks as f64);
            for share in [0.1, 0.5, 0.95] {
                let sings = wall(share * bound, late_ticks).sings(LIGHT);
                assert!(!sings, "{rate_hz} Hz, {late_ticks} late: sings at {share} of the bound");
            }
            let sings = wall(6.0 * bound, late_ticks).sings(LIGHT);
            assert!(
                sings,
                "{rate_hz} Hz, {late_ticks} late: holds six times the bound, so the test shows nothing"
            );
        }
    }
}
