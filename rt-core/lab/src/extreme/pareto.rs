//! The generalised Pareto distribution: fit by maximum likelihood, levels by profile likelihood.

/// Half of the 95 % point of chi-square with one degree of freedom.
const HALF_CHI_SQUARE: f64 = 1.920_729;
/// Shapes that are examined.
const SHAPES: (f64, f64) = (-0.95, 2.0);

/// A fitted distribution of excesses over a threshold.
#[derive(Clone, Debug)]
pub struct Pareto {
    pub scale: f64,
    pub shape: f64,
    /// Excesses that it was fitted to.
    pub excesses: Vec<f64>,
}

impl Pareto {
    /// Fits by maximum likelihood (Grimshaw 1993): for each shape / scale the best shape has a closed form.
    pub fn fit(excesses: &[f64]) -> Self {
        let (mean, most) = (mean(excesses), largest(excesses));
        let shape_at = |rate: f64| excesses.iter().map(|y| (rate * y).ln_1p()).sum::<f64>() / excesses.len() as f64;
        let cost = |rate: f64| {
            let shape = shape_at(rate);
            if rate.abs() * mean < 1e-9 {
                mean.ln() + 1.0
            } else {
                (shape / rate).ln() + shape + 1.0
            }
        };
        // From the end of the support at the largest excess to a very heavy tail; coarse, then fine.
        let (low, high) = (-1.0 / most * (1.0 - 1e-6), 20.0 / mean);
        let place = |t: f64| low + (high - low) * t * t;
        let coarse = 100;
        // Below that shape the likelihood has no maximum.
        let best = (0..=coarse)
            .map(|i| f64::from(i) / f64::from(coarse))
            .filter(|t| *t > 0.0 && shape_at(place(*t)) > SHAPES.0)
            .min_by(|a, b| cost(place(*a)).total_cmp(&cost(place(*b))))
            .unwrap_or(0.5);
        let step = 1.0 / f64::from(coarse);
        let t = lowest((best - step).max(1e-9), (best + step).min(1.0), |t| cost(place(t)));
        let rate = place(t);
        let shape = shape_at(rate);
        let scale = if rate.abs() * mean < 1e-9 { mean } else { shape / rate };
        Self {
            scale,
            shape,
            excesses: excesses.to_vec(),
        }
    }

    /// Returns the probability of an excess of at most `y`.
    pub fn below(&self, y: f64) -> f64 {
        if self.shape.abs() < 1e-9 {
            return -(-y / self.scale).exp_m1();
        }
        let base = (self.shape * y / self.scale).max(-1.0);
        -(-base.ln_1p() / self.shape).exp_m1()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Returns the logarithm of the likelihood.
fn ln_likelihood(excesses: &[f64], scale: f64, shape: f64) -> f64 {
    let n = excesses.len() as f64;
    if scale <= 0.0 {
        return f64::NEG_INFINITY;
    }
    if shape.abs() < 1e-9 {
        return -n * scale.ln() - excesses.iter().sum::<f64>() / scale;
    }
    if 1.0 + shape * largest(excesses) / scale <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let sum: f64 = excesses.iter().map(|y| (shape * y / scale).ln_1p()).sum();
    -n * scale.ln() - (1.0 + 1.0 / shape) * sum
}

/// Returns the excess that one in `m` passes, for a scale of one.
fn reach(shape: f64, m: f64) -> f64 {
    if shape.abs() < 1e-9 {
        m.ln()
    } else {
        (shape * m.ln()).exp_m1() / shape
    }
}

/// Returns the excess that one in `m` passes, with its 95 % interval; `None` where the interval has no upper end.
///
/// The rate of exceedances counts as known: over hundreds of clusters its share of the uncertainty is small against
/// that of the shape (Coles 2001, section 4.3.3).
pub fn interval(fitted: &Pareto, m: f64) -> Option<(f64, f64, f64)> {
    let y = &fitted.excesses;
    let at = fitted.scale * reach(fitted.shape, m);
    let best = ln_likelihood(y, fitted.scale, fitted.shape);
    // The best likelihood of all distributions that have this level.
    let profile = |level: f64| {
        let cost = |shape: f64| -ln_likelihood(y, level / reach(shape, m), shape);
        let coarse = 24;
        let shape_of = |i: f64| SHAPES.0 + (SHAPES.1 - SHAPES.0) * i / f64::from(coarse);
        let i = (0..=coarse).min_by(|a, b| cost(shape_of(f64::from(*a))).total_cmp(&cost(shape_of(f64::from(*b)))));
        let i = f64::from(i.unwrap_or(0));
        let shape = lowest(
            shape_of((i - 1.0).max(0.0)),
            shape_of((i + 1.0).min(f64::from(coarse))),
            cost,
        );
        -cost(shape)
    };
    let inside = |level: f64| best - profile(level) <= HALF_CHI_SQUARE;
    let edge = |mut inner: f64, mut outer: f64| {
        while (outer / inner - 1.0).abs() > 1e-4 {
            let middle = (inner * outer).sqrt();
            if inside(middle) { inner = middle } else { outer = middle }
        }
        outer
    };
    let farther = |factor: f64| (1..=24).map(|i| at * factor.powi(i)).find(|level| !inside(*level));
    let (below, above) = (farther(0.8)?, farther(1.25)?);
    Some((at, edge(at, below), edge(at, above)))
}

/// Minimises by golden section search.
fn lowest(mut a: f64, mut b: f64, cost: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let (mut c, mut d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut at_c, mut at_d) = (cost(c), cost(d));
    for _ in 0..24 {
        if at_c < at_d {
            (b, d, at_d) = (d, c, at_c);
            c = b - GOLDEN * (b - a);
            at_c = cost(c);
        } else {
            (a, c, at_c) = (c, d, at_d);
            d = a + GOLDEN * (b - a);
            at_d = cost(d);
        }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extreme::tests::draw;
    use stylet_random::Random;

    fn drawn(seed: u64, shape: f64, n: usize) -> Vec<f64> {
        let mut random = Random(seed);
        (0..n).map(|_| draw(&mut random, 3e4, shape)).collect()
    }

    #[test]
    fn the_fit_is_where_the_likelihood_is_highest() {
        for (seed, shape) in [(1, -0.3), (2, 0.0), (3, 0.2), (4, 0.4)] {
            let y = drawn(seed, shape, 400);
            let p = Pareto::fit(&y);
            let best = ln_likelihood(&y, p.scale, p.shape);
            // Oracle: a grid of both parameters around the true ones.
            for i in 0..=60 {
                for k in 0..=60 {
                    let (scale, shape) = (3e4 * (0.6 + 0.014 * f64::from(i)), shape - 0.3 + 0.01 * f64::from(k));
                    let other = ln_likelihood(&y, scale, shape);
                    assert!(
                        best >= other - 1e-3,
                        "{seed}: {best} at {p:.3?}, {other} at {scale} {shape}"
                    );
                }
            }
            assert!((p.shape - shape).abs() < 0.2, "{seed}: {}", p.shape);
        }
    }

    #[test]
    fn levels_are_quantiles_of_the_distribution() {
        for shape in [-0.3, 0.0, 1e-7, 0.3] {
            let p = Pareto {
                scale: 5.0,
                shape,
                excesses: Vec::new(),
            };
            let level = 5.0 * reach(shape, 200.0);
            assert!((p.below(level) - 0.995).abs() < 1e-7, "{shape}");
        }
    }
}
