//! Tissue that the probe moves past needles that stay in.

use super::*;

/// Displaces all rows of a line alike.
fn alike(by_m: f64) -> Vec<f64> {
    vec![by_m; 2 * STATIONS]
}

/// Leaves a needle at 24.6 mm, drawn back a little before, so that some of it sticks.
fn left_alone() -> Box<LeftNeedles> {
    let mut needle = line(1, [0.0; 3], &[], WHOLE);
    // What is compared are ways to one place, each solved to a tolerance.
    needle.model.settings.tolerance_m = 1e-12;
    needle.model.settings.sweeps = 10_000;
    go(&mut needle, None, -1e-3, 25e-3, 1e-4);
    go(&mut needle, None, 25e-3, 24.6e-3, 1e-4);
    let mut left = LeftNeedles::with_room();
    left.leave(needle).expect("room");
    left
}

/// Far from its limits, so that where the needle's end is does not count.
#[test]
fn moving_tissue_acts_on_a_left_needle_like_drawing_it() {
    let (mut by_tissue, mut drawn) = (left_alone(), left_alone());
    let (by_m, ticks) = (40e-6, 5);
    assert!(by_tissue.displace_from_outside(1, &alike(by_m), ticks));
    assert!(!by_tissue.displace_from_outside(7, &alike(by_m), ticks));
    assert!(drawn.draw_out(1, by_m / (f64::from(ticks) * DT_S)));
    let before = drawn.forces_n().to_vec();
    for _ in 0..ticks {
        by_tissue.step_alone(DT_S);
        drawn.step_alone(DT_S);
    }
    assert!(drawn.draw_out(1, 0.0));
    for _ in 0..50 {
        by_tissue.step_alone(DT_S);
        drawn.step_alone(DT_S);
    }
    let farthest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let changed_n = farthest(&before, by_tissue.forces_n());
    let off_n = farthest(drawn.forces_n(), by_tissue.forces_n());
    assert!(changed_n > 1e-4, "{changed_n}");
    assert!(off_n < 1e-3 * changed_n, "{off_n} of {changed_n}");
}

/// Stations and tip of one needle, each moved by another way within one tick, beside the dense problem: what sticks is
/// where it was in the tissue, and what slips does so against its limit.
#[test]
fn moving_tissue_gives_the_forces_of_the_dense_problem() {
    let mut mixed = 0;
    for by_m in [0.02e-3, 0.1e-3, -0.1e-3, 0.2e-3, -0.2e-3, 0.4e-3, -0.4e-3] {
        let mut left = left_alone();
        let rests: Vec<f64> = left.rest_m[..left.count].to_vec();
        let rows_m: Vec<f64> = (0..2 * STATIONS)
            .map(|row| by_m * (0.3 + (0.25 * (row % STATIONS) as f64).sin()))
            .collect();
        left.displace_from_outside(1, &rows_m, 1);
        left.step_alone(DT_S);
        let k = left.count;
        let needle = &left.needles[0];
        let weights: Vec<(usize, f64)> = {
            let state = &needle.line.state;
            state.tip_range.clone().zip(state.tip_weights).collect()
        };
        let loads = |element: usize| -> Vec<(usize, f64, bool)> {
            if element + 1 < k {
                return vec![(element, 1.0, true)];
            }
            weights.iter().map(|(n, w)| (*n, *w, false)).collect()
        };
        let entry = |i: usize, j: usize| -> f64 {
            let (from, to) = (loads(i), loads(j));
            let pairs = from.iter().flat_map(|a| to.iter().map(move |b| (a, b)));
            pairs
                .map(|((n, w, is_shaft), (m, v, is_too))| {
                    let alone = if *is_shaft && *is_too && n == m { 0.014 } else { 0.0 };
                    let places = [*n, *m].map(|row| place(needle.line.line(), row));
                    w * v * (kernel(places[0], places[1], WHOLE) + alone)
                })
                .sum()
        };
        let dense = DMatrix::from_fn(k, k, entry);
        let found = DVector::from_column_slice(&left.force_n[..k]);
        let u = dense * &found;
        let mut slips = 0;
        for n in 0..k {
            let moved_m: f64 = loads(n)
                .iter()
                .map(|(row, w, is_shaft)| w * rows_m[row + if *is_shaft { 0 } else { STATIONS }])
                .sum();
            let beyond_m = rests[n] - moved_m - u[n];
            let [low, high] = [left.low_n[n], left.high_n[n]];
            let is_in = |f: f64| f > low + 1e-9 && f < high - 1e-9;
            if is_in(found[n]) {
                assert!(beyond_m.abs() < 1e-7, "{by_m} {n}: sticks {beyond_m} m off");
            } else {
                slips += 1;
                let pushes = if found[n] >= high - 1e-9 { beyond_m } else { -beyond_m };
                assert!(
                    pushes > -1e-7 || low == high,
                    "{by_m} {n}: slips {beyond_m} the wrong way"
                );
            }
        }
        mixed += usize::from(slips > 0 && slips < k);
    }
    assert!(mixed >= 3, "{mixed} in which some slip and some stick");
}

/// It is held as before when the tissue is back, and by the hand that takes it up meanwhile as by the template.
#[test]
fn a_needle_taken_up_in_moved_tissue_keeps_its_forces() {
    let mut left = left_alone();
    left.displace_from_outside(1, &alike(30e-6), 5);
    for _ in 0..50 {
        left.step_alone(DT_S);
    }
    let held_n = left.forces_n().to_vec();
    let mut back = left.clone();
    back.displace_from_outside(1, &alike(0.0), 5);
    for _ in 0..50 {
        back.step_alone(DT_S);
    }
    let rest = left_alone();
    // What was at its limit has slipped a little on the way.
    for (n, ((a, b), held)) in back.forces_n().iter().zip(rest.forces_n()).zip(&held_n).enumerate() {
        assert!((a - b).abs() < 1e-4, "{n}: {a} {b}, {held} meanwhile");
    }
    let changed = rest.forces_n().iter().zip(&held_n).map(|(a, b)| (a - b).abs());
    assert!(changed.fold(0.0, f64::max) > 1e-3);
    let tip_m = left.needles()[0].held_m();
    let mut again = left.take(1).expect("that one");
    for _ in 0..20 {
        again.step(tip_m, DT_S);
    }
    for (n, (a, b)) in held_n
        .iter()
        .zip(&again.state.shaft_n)
        .enumerate()
        .take(held_n.len() - 1)
    {
        assert!((a - b).abs() < 1e-5, "{n}: {a} {b}");
    }
}
