//! Number of seeds in each component, from its signal; the sum is the number of implanted seeds, if
//! known.

/// Smallest standard deviation of the signals of single seeds, as a share.
const LEAST_SPREAD: f64 = 0.1;
/// Largest deviation of a count from the signal, in seeds, to match the number implanted.
pub const MOST_OFF: f64 = 0.75;
const ROUNDS: usize = 8;

/// Seeds of each component.
#[derive(Clone, Debug, PartialEq)]
pub struct Counts {
    /// Number of seeds, by component.
    pub seeds: Vec<usize>,
    /// Signal of one seed.
    pub of_one: f64,
    signals: Vec<f64>,
    spread: f64,
}

impl Counts {
    /// Returns the signal of a component, in seeds.
    pub fn signal(&self, component: usize) -> f64 {
        self.signals[component] / self.of_one
    }

    /// Returns the probability of the count of a component, against one more and one fewer.
    pub fn probability(&self, component: usize) -> f64 {
        let (signal, count) = (self.signal(component), self.seeds[component]);
        let weight = |seeds: usize| (-0.5 * cost(signal, seeds) / self.spread.powi(2)).exp();
        let others = weight(count + 1) + if count > 0 { weight(count - 1) } else { 0.0 };
        let own = weight(count);
        if own > 0.0 { own / (own + others) } else { 0.0 }
    }

    /// Returns the squared deviation of a component's signal from this number of seeds, in
    /// variances.
    pub fn cost(&self, component: usize, seeds: usize) -> f64 {
        cost(self.signal(component), seeds) / self.spread.powi(2)
    }

    fn total_cost(&self) -> f64 {
        let each = (0..self.signals.len()).filter(|&n| self.seeds[n] > 0 || self.signal(n) < 1.0);
        each.map(|n| cost(self.signal(n), self.seeds[n])).sum::<f64>() / self.spread.powi(2)
    }
}

/// Returns the squared deviation of a signal from a count; the spread of a sum grows with the root
/// of its parts.
fn cost(signal: f64, seeds: usize) -> f64 {
    (signal - seeds as f64).powi(2) / seeds.max(1) as f64
}

/// Returns the counts that fit the signals best; a component of more than `most` seeds has none.
pub fn of(signals: &[f64], count: Option<usize>, most: f64) -> Counts {
    let middle = median(signals.to_vec());
    let in_reach: f64 = signals.iter().filter(|s| **s < most * middle).sum();
    // If most components are several seeds, the median one is not a single seed; then the number of
    // seeds shows it.
    let mut best = of_start(signals, middle, count, most);
    if let Some(seeds) = count {
        let other = of_start(signals, in_reach / seeds.max(1) as f64, count, most);
        if other.total_cost() < best.total_cost() {
            best = other;
        }
    }
    best
}

fn of_start(signals: &[f64], start: f64, count: Option<usize>, most: f64) -> Counts {
    let mut counts = Counts {
        seeds: vec![0; signals.len()],
        of_one: start.max(f64::MIN_POSITIVE),
        signals: signals.to_vec(),
        spread: LEAST_SPREAD,
    };
    for _ in 0..ROUNDS {
        for n in 0..signals.len() {
            let signal = counts.signal(n);
            counts.seeds[n] = if signal > most {
                0
            } else {
                signal.round().max(0.0) as usize
            };
        }
        let singles = (0..signals.len()).filter(|&n| counts.seeds[n] == 1);
        let of_single: Vec<f64> = singles.map(|n| signals[n]).collect();
        if of_single.len() > 2 {
            counts.of_one = median(of_single);
        }
    }
    let singles = (0..signals.len()).filter(|&n| counts.seeds[n] == 1);
    let off = singles.map(|n| (counts.signal(n) - 1.0).abs()).collect();
    counts.spread = (median(off) / 0.6745).max(LEAST_SPREAD);
    if let Some(count) = count {
        constrain(&mut counts, count, most);
    }
    counts
}

/// Adds or removes seeds one by one at the smallest cost, until there are as many as were
/// implanted; skips components that are not seeds.
fn constrain(counts: &mut Counts, count: usize, most: f64) {
    for _ in 0..counts.seeds.len() * 4 {
        let total: usize = counts.seeds.iter().sum();
        let step = |n: usize| -> Option<(f64, usize)> {
            let (signal, now) = (counts.signal(n), counts.seeds[n]);
            let to = match total.cmp(&count) {
                std::cmp::Ordering::Less => now + 1,
                std::cmp::Ordering::Greater => now.checked_sub(1)?,
                std::cmp::Ordering::Equal => return None,
            };
            let fits = signal <= most && (signal - to as f64).abs() < MOST_OFF;
            fits.then(|| (cost(signal, to) - cost(signal, now), to))
        };
        let steps = (0..counts.seeds.len()).filter_map(|n| step(n).map(|(cost, to)| (cost, n, to)));
        let Some((_, n, to)) = steps.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        counts.seeds[n] = to;
    }
}

/// Returns the upper median; 0 without values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_implanted_number_settles_doubtful_counts() {
        let signals = [1.02, 0.97, 1.0, 2.1, 0.99, 1.46, 0.1, 40.0].map(|s| s * 4000.0);
        let free = of(&signals, None, 12.0);
        assert_eq!(free.seeds, [1, 1, 1, 2, 1, 1, 0, 0]);
        assert!(
            free.probability(0) > 0.99 && free.probability(5) < 0.9,
            "{}",
            free.probability(5)
        );
        assert_eq!(of(&signals, Some(8), 12.0).seeds, [1, 1, 1, 2, 1, 2, 0, 0]);
        // Seeds beyond the signals are not invented.
        assert_eq!(of(&signals, Some(30), 12.0).seeds.iter().sum::<usize>(), 8);
    }
}
