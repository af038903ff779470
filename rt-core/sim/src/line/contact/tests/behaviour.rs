//! Claims about membrane, track, rates and hostile input.

use super::*;

/// At 5 mm/s, in, half back and in again: where the shaft sticks, the tip carries most of the tissue along.
#[test]
fn a_tip_that_cuts_is_where_the_world_has_it() {
    let model = narrow();
    let mut state = LineState::new(&model);
    let (mut ticks, mut open, mut worst_m) = (0, 0, 0.0_f64);
    let mut tip_m = -1e-3;
    for end_m in [20e-3, 10e-3, 25e-3] {
        while tip_m != end_m {
            tip_m += f64::clamp(end_m - tip_m, -5e-6, 5e-6);
            let output = step(&model, &mut state, &at(tip_m));
            if output.tip_n > 0.0 && output.held_by.is_none() {
                let gap_m = (tip_m - state.tip.material_m - state.tip_u_m).abs();
                ticks += 1;
                open += u32::from(gap_m > CLOSED_M);
                worst_m = worst_m.max(gap_m);
            }
        }
    }
    println!("{open} of {ticks} ticks end with a gap, at most {worst_m:.1e} m");
    assert!(ticks > 3_000 && open < ticks / 100, "{open} of {ticks}");
}

#[test]
fn a_membrane_gives_way_once_and_its_track_stays_open() {
    let layers = [LineLayer {
        puncture_force_n: 3.0,
        puncture_depth_m: f64::INFINITY,
        ..GLAND
    }];
    let model = made_up(30, 1.364e-3, &layers, LineSettings::default());
    let mut state = LineState::new(&model);
    let (mut largest_n, mut snapped) = (0.0_f64, None);
    for n in 0..400 {
        let before = state.tip().material_m;
        let output = step(&model, &mut state, &at(1e-4 * f64::from(n)));
        assert!(output.tip_n >= 0.0, "the tip never pulls");
        if output.punctured.is_some() {
            assert!(snapped.is_none(), "once");
            snapped = Some((output.tip_n, output.tip_material_m - before));
        } else if snapped.is_none() {
            largest_n = largest_n.max(output.tip_n);
            assert!(output.tip_material_m <= 0.0);
        }
    }
    let (after_n, by_m) = snapped.expect("a puncture");
    println!(
        "held {largest_n:.3} N, then {after_n:.3} N and {:.2} mm further into the tissue in one tick",
        1e3 * by_m
    );
    assert!((2.9..=3.0).contains(&largest_n) && after_n <= 1.5 && by_m > 1e-3);
    let first = go(&model, &mut LineState::new(&model), &[25e-3], 1e-4)[0];
    go(&model, &mut state, &[25e-3, -2e-3], 1e-4);
    let mut second = step(&model, &mut state, &at(-2e-3));
    assert_eq!(second.force_on_hand_n, 0.0, "out of the tissue");
    for n in 0..=270 {
        second = step(&model, &mut state, &at(-2e-3 + 1e-4 * f64::from(n)));
        assert!(second.punctured.is_none() && second.tip_n <= 0.2 * 1.5 + 1e-9);
    }
    println!(
        "at 25 mm: first pass {:.2} N, second {:.2} N",
        first.force_on_hand_n, second.force_on_hand_n
    );
    assert!(second.force_on_hand_n.abs() < first.force_on_hand_n.abs() - 0.7);
}

#[test]
fn rate_terms_are_off_and_separate() {
    let settings = LineSettings {
        viscous_n_s_per_m2: 100.0,
        ..LineSettings::default()
    };
    let layers = [LineLayer {
        puncture_force_n: 0.0,
        ..GLAND
    }];
    let [plain, viscous] = [LineSettings::default(), settings].map(|s| made_up(30, 1.364e-3, &layers, s));
    let run = |model: &LineModel, speed: f64| {
        go(model, &mut LineState::new(model), &[30e-3], speed * DT_S)[0].force_on_hand_n
    };
    for speed in [10e-3, 100e-3] {
        let more_n = run(&plain, speed) - run(&viscous, speed);
        let depth_m = go(&plain, &mut LineState::new(&plain), &[30e-3], speed * DT_S)[0].tip_material_m;
        println!(
            "{speed} m/s: {more_n:.4} N more, {:.4} N for all of the shaft",
            100.0 * depth_m * speed
        );
        assert!(more_n > 0.6 * 100.0 * depth_m * speed && more_n < 1.1 * 100.0 * depth_m * speed);
    }
}

#[test]
fn force_relaxes_at_rest_only_where_it_is_asked_for() {
    let term = PronyTerm {
        strength: 0.4,
        time_s: 0.5,
    };
    let settings = LineSettings {
        prony: [term, PronyTerm::default()],
        ..LineSettings::default()
    };
    for (settings, relaxes) in [(LineSettings::default(), false), (settings, true)] {
        // A membrane with a depth is a separate spring, which does not relax.
        let gland = LineLayer {
            puncture_depth_m: f64::INFINITY,
            ..GLAND
        };
        let model = made_up(30, 1.364e-3, &[gland], settings);
        let mut state = LineState::new(&model);
        let first = go(&model, &mut state, &[5e-3], 1e-4)[0];
        let mut last = first;
        (0..5000).for_each(|_| last = step(&model, &mut state, &at(5e-3)));
        println!(
            "{:.4} N, after 5 s {:.4} N",
            first.force_on_hand_n, last.force_on_hand_n
        );
        let ratio = last.force_on_hand_n / first.force_on_hand_n;
        // Pushed slowly, part of it relaxes on the way.
        assert!(if relaxes {
            (1.0 / 1.4..0.85).contains(&ratio)
        } else {
            (ratio - 1.0).abs() < 1e-6
        });
    }
}

#[test]
fn every_finite_input_gives_finite_forces_and_no_heap_call() {
    let model = made_up(30, 1.364e-3, &[GLAND], LineSettings::default());
    let mut state = LineState::new(&model);
    let mut random = Random(5);
    let extremes = [
        0.0,
        -0.0,
        1e-300,
        1e300,
        -1e300,
        f64::MAX,
        f64::NAN,
        f64::INFINITY,
        0.04,
        -1e-3,
    ];
    let before = heap::calls_of_this_thread();
    for n in 0..20_000 {
        let tip_m = if n % 5 == 0 {
            extremes[n / 5 % extremes.len()]
        } else {
            0.06 * random.unit() - 5e-3
        };
        let dt_s = if n % 7 == 0 {
            extremes[n / 7 % extremes.len()]
        } else {
            DT_S
        };
        let output = step(&model, &mut state, &LineInput { tip_m, dt_s });
        let numbers = [
            output.force_on_hand_n,
            output.tip_n,
            output.shaft_n,
            output.least_stretch,
        ];
        assert!(numbers.iter().all(|v| v.is_finite()), "{tip_m} {output:?}");
        assert!(state.loads_n().iter().all(|v| v.is_finite()));
        assert!(output.tip_n >= 0.0 && output.shaft_n.abs() <= 80.0 * 0.042);
        let is_usable = tip_m.is_finite() && dt_s.is_finite() && dt_s > 0.0;
        assert_eq!(output.is_refused, !is_usable);
    }
    assert_eq!(heap::calls_of_this_thread(), before);
}

/// `cargo test --profile quick -p rt-core --lib times_of_a_tick -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn times_of_a_tick() {
    let model = made_up(40, 1.0e-3, &[GLAND], LineSettings::default());
    let mut best: Vec<f64> = Vec::new();
    let mut sweeps = Vec::new();
    for round in 0..12 {
        let mut state = LineState::new(&model);
        let mut random = Random(3);
        let (mut tip_m, mut to_m, mut speed) = (0.0, 0.0, 1e-4);
        for n in 0..20_000 {
            if tip_m == to_m {
                to_m = 46e-3 * random.unit();
                speed = 2e-4 * random.unit() + 1e-6;
            }
            tip_m += f64::clamp(to_m - tip_m, -speed, speed);
            let start = Instant::now();
            let output = step(&model, &mut state, &at(tip_m));
            let us = start.elapsed().as_secs_f64() * 1e6;
            match best.get_mut(n) {
                Some(least) if round > 0 => *least = least.min(us),
                _ => {
                    best.push(us);
                    sweeps.push(f64::from(output.sweeps));
                }
            }
        }
    }
    for (name, mut values) in [("us", best), ("sweeps", sweeps)] {
        values.sort_by(f64::total_cmp);
        let part = |p: f64| values[((values.len() - 1) as f64 * p) as usize];
        println!(
            "{name}: p50 {:.2}, p99 {:.2}, p99.9 {:.2}, max {:.2}",
            part(0.5),
            part(0.99),
            part(0.999),
            part(1.0)
        );
    }
}
