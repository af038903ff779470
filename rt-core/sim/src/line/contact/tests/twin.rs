//! Forces by sets of stations that stick are those of sweeps that go on until nothing moves.

use super::*;

/// Each tick is solved twice from the same state: as in the loop, and by sweeps alone, to a ten-thousandth of the
/// tolerance.
#[test]
fn sets_give_what_sweeps_give_in_every_tick_of_a_random_hand() {
    let deep = LineLayer {
        from_m: 17e-3,
        puncture_force_n: 2.0,
        cutting_force_n: 0.8,
        shaft_friction_n_per_m: 40.0,
        ..GLAND
    };
    let term = PronyTerm {
        strength: 0.4,
        time_s: 0.5,
    };
    let relaxes = LineSettings {
        prony: [term, PronyTerm::default()],
        ..LineSettings::default()
    };
    for (stations, layers, settings) in [
        (40, vec![GLAND], LineSettings::default()),
        (30, vec![GLAND, deep], LineSettings::default()),
        (30, vec![GLAND, deep], relaxes),
        (9, vec![GLAND], LineSettings::default()),
    ] {
        let spacing_m = 42e-3 / stations as f64;
        let settings = LineSettings {
            by_sets: true,
            ..settings
        };
        let model = made_up(stations, spacing_m, &layers, settings);
        let slow = LineSettings {
            by_sets: false,
            sweeps: 20_000,
            tolerance_m: 2e-13,
            ..settings
        };
        let twin = made_up(stations, spacing_m, &layers, slow);
        let mut state = LineState::new(&model);
        let mut random = Random(stations as u64);
        let (mut tip_m, mut to_m, mut speed) = (0.0, 0.0, 1e-4);
        let (mut force_n, mut place_m, mut by_sweeps) = (0.0_f64, 0.0_f64, 0);
        for _ in 0..4000 {
            if tip_m == to_m {
                to_m = 48e-3 * random.unit();
                speed = 3e-4 * random.unit().powi(2) + 1e-6;
            }
            tip_m += f64::clamp(to_m - tip_m, -speed, speed);
            let mut other = state.clone();
            let ours = step(&model, &mut state, &at(tip_m));
            let wanted = step(&twin, &mut other, &at(tip_m));
            place_m = place_m.max((ours.tip_material_m - wanted.tip_material_m).abs());
            let off_n = (ours.force_on_hand_n - wanted.force_on_hand_n).abs();
            force_n = force_n.max(off_n);
            if off_n > 1e-4 {
                println!("tip {tip_m:.6} m: {ours:?}\n{wanted:?}");
            }
            assert_eq!(ours.punctured, wanted.punctured);
            by_sweeps += u32::from(ours.residual_m > settings.tolerance_m || ours.sweeps > 200);
        }
        println!("{stations} stations: {force_n:.1e} N, {place_m:.1e} m; {by_sweeps} ticks not by sets");
        assert!(force_n < 1e-4 && place_m < 1e-6);
        assert!(by_sweeps < 4, "{by_sweeps}");
    }
}
