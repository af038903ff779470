//! Percentiles against sorted lists, and how often their intervals hold the true value.

use super::*;
use crate::sample::{Batched, PARTS, histogram};
use stylet_random::Random;

#[test]
fn percentiles_agree_with_a_sorted_list_and_need_ten_samples_beyond() {
    let mut h = histogram();
    let mut all = Vec::new();
    for i in 0..10_000_u64 {
        let ns = 1_000 + i * i * 7919 % 100_003;
        h.record(ns).expect("in range");
        all.push(ns);
    }
    all.sort_unstable();
    let s = summary("x", &h, &[], 1_000.0);
    for (name, q) in [("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("p99.9", 0.999)] {
        let exact_us = all[(q * 10_000.0) as usize - 1] as f64 / 1e3;
        let us = s.quantile(name).and_then(|q| q.us).expect("enough samples");
        assert!((us / exact_us - 1.0).abs() < 2e-3, "{name}: {us} against {exact_us}");
    }
    let last = s.quantile("p99.99").expect("in the list");
    assert_eq!((last.us, last.needs_s), (None, Some(100.0)));
    assert_eq!(s.count, 10_000);
}

/// Returns a normal number of mean 0 and deviation 1, after Box and Muller.
fn normal(random: &mut Random) -> f64 {
    (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (std::f64::consts::TAU * random.unit()).cos()
}

/// Takes `n` values of exp(a normal series whose neighbours correlate by `by`), scaled to 100 us.
fn correlated(seed: u64, n: usize, by: f64) -> Batched {
    let mut random = Random(seed);
    let mut all = Batched::default();
    let mut x = normal(&mut random);
    for i in 0..n {
        all.take(i * PARTS / n, (x.exp() * 1e5) as u64);
        x = by * x + (1.0 - by * by).sqrt() * normal(&mut random);
    }
    all
}

#[test]
fn intervals_hold_the_value_of_correlated_series_in_95_of_100() {
    // Oracle: the percentiles of the normal distribution (tables), of which the series is an increasing function.
    const RUNS: u64 = 1_000;
    let mut off = Vec::new();
    for (by, n, q, z) in [
        (0.0, 8_000, 0.5, 0.0),
        (0.9, 8_000, 0.5, 0.0),
        (0.9, 8_000, 0.9, 1.281_552),
        (0.9, 10_000, 0.99, 2.326_348),
        (0.98, 16_000, 0.9, 1.281_552),
        (0.9, 40_000, 0.999, 3.090_232),
    ] {
        let truth_us = f64::exp(z) * 100.0;
        let given: Vec<[f64; 2]> = (0..RUNS)
            .filter_map(|seed| {
                let all = correlated(seed, n, by);
                interval_us(&all, &all.parts, q)
            })
            .collect();
        let held = given
            .iter()
            .filter(|[low, high]| (*low..=*high).contains(&truth_us))
            .count();
        let share = held as f64 / given.len() as f64;
        println!("correlation {by}, {n} values, {q}: {held} of {} given", given.len());
        off.extend((!(0.93..=0.97).contains(&share) || given.len() < 900).then_some((by, q, held)));
    }
    assert!(off.is_empty(), "correlation, percentile, held: {off:?}");
}

#[test]
fn the_points_of_student_are_those_of_the_tables() {
    for (freedom, point) in [(3.0, 3.182), (7.0, 2.365), (15.0, 2.131), (1e6, 1.960)] {
        assert!(
            (student_975(freedom) - point).abs() < 0.03,
            "{freedom}: {}",
            student_975(freedom)
        );
    }
}

#[test]
fn an_interval_without_parts_or_without_samples_beyond_it_is_not_given() {
    let all = correlated(1, 8_000, 0.0);
    assert_eq!(interval_us(&all, &all.parts[..3], 0.5), None);
    assert_eq!(interval_us(&all, &all.parts, 0.999_9), None);
}

#[test]
fn nothing_measured_has_no_numbers() {
    let s = summary("x", &histogram(), &[], 200.0);
    assert!(s.min_us.is_none() && s.max_us.is_none());
    assert_eq!(s.quantile("p50").and_then(|q| q.needs_s), Some(0.1));
}
