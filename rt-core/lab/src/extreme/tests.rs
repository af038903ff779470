//! Levels are correct where the data permit them, and refused elsewhere.

use super::*;
use crate::bound::binomial_cdf;
use stylet_random::Random;

const SCALE_NS: f64 = 2e4;
const SHAPE: f64 = 0.1;
const TICKS: u64 = 20_000;

/// Draws a value of a generalised Pareto distribution.
pub fn draw(random: &mut Random, scale: f64, shape: f64) -> f64 {
    let left = 1.0 - random.unit();
    if shape == 0.0 {
        -left.ln() * scale
    } else {
        (left.powf(-shape) - 1.0) / shape * scale
    }
}

/// Wake-ups of a run; `scale`: of each tick, for a scale of one.
fn run(seed: u64, scale: impl Fn(u64) -> f64) -> Sample {
    let mut random = Random(seed);
    let mut sample = Sample::new(TICKS);
    for i in 0..TICKS {
        sample.take(i, (5_000.0 + draw(&mut random, SCALE_NS, SHAPE) * scale(i)) as u64);
    }
    sample
}

#[test]
fn the_true_level_lies_inside_its_interval_in_95_of_100_runs() {
    const RUNS: u64 = 200;
    let (mut given, mut refused, mut inside, mut seed) = (0, 0, 0, 0);
    while given < RUNS {
        seed += 1;
        let found = examine(&run(seed, |_| 1.0), 1_000.0);
        // Ten runs: one in 200,000 passes the level.
        let true_us = 5.0 + SCALE_NS / 1e3 * ((10.0 * TICKS as f64).powf(SHAPE) - 1.0) / SHAPE;
        match found.levels.first() {
            Some(level) => {
                assert_eq!(level.every_s, 200.0);
                given += 1;
                let [low, high] = level.interval_us;
                inside += u64::from(low <= true_us && true_us <= high);
            }
            None => refused += 1,
        }
        // Five tests, four at 1 % and one at 5 %.
        assert!(
            refused <= 40,
            "{refused} refused, {given} given: {:?}",
            found.not_applicable_because
        );
    }
    println!("{inside} of {given} intervals hold the true level; {refused} runs refused");
    // What a binomial of 95 % allows in 99 of 100 such tests: 181 to 197.
    let accepted = |k: u64| (0.005..=0.995).contains(&binomial_cdf(k, RUNS, 0.95));
    assert!(accepted(inside), "{inside} of {given}");
}

#[test]
fn runs_that_change_are_refused_with_the_figure() {
    // The measured power: the second half is later by this factor.
    for (factor, least) in [(1.2, 38), (1.5, 40), (3.0, 40)] {
        let scale = |i: u64| if i < TICKS / 2 { 1.0 } else { factor };
        let found: Vec<Extremes> = (0..40).map(|seed| examine(&run(900 + seed, scale), 1_000.0)).collect();
        let n = found.iter().filter(|f| f.levels.is_empty()).count();
        println!("scale {factor}: {n} of 40 refused");
        assert!(n >= least, "scale {factor}: {n} of 40");
        let why = found.iter().flat_map(|f| &f.not_applicable_because);
        assert!(
            why.into_iter()
                .any(|w| w.contains("first half against second half: distance"))
        );
    }
}

#[test]
fn a_tail_that_changes_under_a_body_that_does_not_is_refused() {
    // Only one in a hundred is late at all, and in the second half three times as late: the body shows nothing of it.
    let refused = |seed: u64| {
        let mut random = Random(seed);
        let mut sample = Sample::new(TICKS);
        for i in 0..TICKS {
            let body = 5_000.0 + 1_000.0 * random.unit();
            let late = if random.unit() < 0.02 {
                draw(&mut random, SCALE_NS, 0.0)
            } else {
                0.0
            };
            let factor = if i < TICKS / 2 { 1.0 } else { 3.0 };
            sample.take(i, (body + late * factor) as u64);
        }
        let found = examine(&sample, 1_000.0);
        found.levels.is_empty() && found.not_applicable_because.iter().any(|w| w.contains("late wake-ups"))
    };
    let n = (0..20).filter(|&seed| refused(seed)).count();
    assert!(n >= 19, "{n} of 20");
}

#[test]
fn short_runs_and_bursts_are_refused_with_their_numbers() {
    let mut random = Random(1);
    let mut short = Sample::new(3_000);
    for i in 0..3_000 {
        short.take(i, (1e4 * (1.0 + random.unit())) as u64);
    }
    let found = examine(&short, 1_000.0);
    assert!(found.levels.is_empty());
    assert!(
        found.not_applicable_because[0].starts_with("60 wake-ups over a threshold"),
        "{found:?}"
    );
    // Ten bursts of forty late ticks are ten events, not four hundred.
    let mut bursts = Sample::new(TICKS);
    for i in 0..TICKS {
        let late = if i % 2_000 < 40 { 1e5 } else { 0.0 };
        bursts.take(i, (late + 1e4 * (1.0 + random.unit())) as u64);
    }
    let why = examine(&bursts, 1_000.0).not_applicable_because.join("; ");
    assert!(why.contains("clusters (extremal index"), "{why}");
}
