//! Test of excesses against the fitted Pareto distribution, after Anderson and Darling.

use super::pareto::Pareto;

/// Upper 5 % points of the statistic where scale and shape are fitted, by shape (Choulakian and Stephens 2001, table 2;
/// their k is minus the shape).
const FIVE_PERCENT: [(f64, f64); 10] = [
    (-0.5, 1.321),
    (-0.4, 1.221),
    (-0.3, 1.140),
    (-0.2, 1.074),
    (-0.1, 1.020),
    (0.0, 0.974),
    (0.1, 0.935),
    (0.2, 0.903),
    (0.5, 0.830),
    (0.9, 0.771),
];

/// Returns the point of 5 %; `None` outside the table.
pub fn five_percent_point(shape: f64) -> Option<f64> {
    let pair = FIVE_PERCENT
        .windows(2)
        .find(|pair| pair[0].0 <= shape && shape <= pair[1].0)?;
    let share = (shape - pair[0].0) / (pair[1].0 - pair[0].0);
    Some(pair[0].1 + share * (pair[1].1 - pair[0].1))
}

/// Returns the distance of the excesses from the fitted distribution, with weight on the tails.
pub fn anderson_darling(excesses: &[f64], fitted: &Pareto) -> f64 {
    let mut below: Vec<f64> = excesses
        .iter()
        .map(|y| fitted.below(*y).clamp(1e-300, 1.0 - 1e-16))
        .collect();
    below.sort_unstable_by(f64::total_cmp);
    let n = below.len();
    let term = |i: usize| (2 * i + 1) as f64 * (below[i].ln() + (-below[n - 1 - i]).ln_1p());
    -(n as f64) - (0..n).map(term).sum::<f64>() / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extreme::tests::draw;
    use stylet_random::Random;

    #[test]
    fn five_of_a_hundred_true_samples_are_refused() {
        // Oracle of the table, and of the sign of its shape: samples of known distributions.
        for shape in [-0.3, 0.0, 0.4] {
            let refused = |of: &dyn Fn(&mut Random) -> f64| {
                let is_refused = |seed: u64| {
                    let mut random = Random(seed);
                    let y: Vec<f64> = (0..200).map(|_| of(&mut random)).collect();
                    let p = Pareto::fit(&y);
                    five_percent_point(p.shape).is_none_or(|limit| anderson_darling(&y, &p) > limit)
                };
                (0..200).filter(|&seed| is_refused(500 + seed)).count()
            };
            let n = refused(&|random| draw(random, 1.0, shape));
            println!("shape {shape}: {n} of 200 refused");
            // 10 and three deviations; with 200 values the asymptotic limit is exceeded slightly more often.
            assert!((2..=20).contains(&n), "shape {shape}: {n} of 200");
        }
    }

    #[test]
    fn two_heaps_of_late_wake_ups_are_no_pareto_distribution() {
        let mut random = Random(9);
        let y: Vec<f64> = (0..400)
            .map(|i| draw(&mut random, 1.0, 0.0) + if i % 4 == 0 { 6.0 } else { 0.0 })
            .collect();
        let p = Pareto::fit(&y);
        assert!(five_percent_point(p.shape).is_none_or(|limit| anderson_darling(&y, &p) > limit));
    }

    #[test]
    fn the_table_ends_where_the_paper_does() {
        assert_eq!(five_percent_point(0.0), Some(0.974));
        assert!(five_percent_point(-0.35).is_some_and(|v| (v - 1.1805).abs() < 1e-9));
        assert!(five_percent_point(0.91).is_none() && five_percent_point(-0.51).is_none());
    }
}
