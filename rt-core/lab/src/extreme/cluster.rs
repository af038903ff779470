//! Clusters of late wake-ups: the intervals estimator of Ferro and Segers (2003).

/// Returns the latest of each cluster, in the order of time, and the extremal index; `over`: (grid point, value), in
/// the order of time.
pub fn decluster(over: &[(u64, u64)]) -> (Vec<(u64, u64)>, f64) {
    let gaps: Vec<u64> = over.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let index = extremal_index(&gaps);
    // This many of the longest gaps lie between clusters; gaps as long as the next one do not.
    let mut sorted = gaps.clone();
    sorted.sort_unstable_by(|a, b| b.cmp(a));
    let between = ((index * over.len() as f64).floor() as usize).saturating_sub(1);
    let longest_within = sorted.get(between).copied().unwrap_or(0);
    let mut clusters: Vec<(u64, u64)> = Vec::new();
    for (i, &tick) in over.iter().enumerate() {
        match clusters.last_mut() {
            Some(latest) if gaps[i - 1] <= longest_within => {
                if tick.1 > latest.1 {
                    *latest = tick;
                }
            }
            _ => clusters.push(tick),
        }
    }
    (clusters, index)
}

/// Computes equations 5 and 6 of the paper; one if there is no data.
fn extremal_index(gaps: &[u64]) -> f64 {
    let n = gaps.len() as f64;
    let sum = |of: &dyn Fn(f64) -> f64| gaps.iter().map(|&t| of(t as f64)).sum::<f64>();
    let (above, below) = if gaps.iter().all(|&t| t <= 2) {
        (sum(&|t| t).powi(2), n * sum(&|t| t * t))
    } else {
        (sum(&|t| t - 1.0).powi(2), n * sum(&|t| (t - 1.0) * (t - 2.0)))
    };
    if below > 0.0 {
        (2.0 * above / below).min(1.0)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stylet_random::Random;

    /// Returns ticks over a threshold that one in 50 passes; each raises the next few.
    fn over(length: u64, seed: u64) -> Vec<(u64, u64)> {
        let mut random = Random(seed);
        let n = 60_000;
        let chance = 0.02 / length as f64;
        let mut all = Vec::new();
        let mut place = 0;
        while place < n {
            if random.unit() < chance {
                let size = 1 + random.draw() % 1_000_000;
                all.extend((0..length).map(|i| (place + i, size + i % 2)));
                place += length;
            } else {
                place += 1;
            }
        }
        all
    }

    #[test]
    fn index_is_one_over_the_length_of_the_clusters() {
        for (length, expected) in [(1, 1.0), (2, 0.5), (4, 0.25)] {
            let mean = (0..20).map(|seed| decluster(&over(length, seed)).1).sum::<f64>() / 20.0;
            assert!((mean / expected - 1.0).abs() < 0.06, "{length}: {mean}");
        }
    }

    #[test]
    fn each_cluster_is_one_with_its_largest_value() {
        let late = over(4, 5);
        let (clusters, _) = decluster(&late);
        let expected = late.len() / 4;
        let apart = (clusters.len() as f64 / expected as f64 - 1.0).abs();
        assert!(apart < 0.1, "{} clusters of {expected}", clusters.len());
        assert!(clusters.iter().all(|c| late.contains(c)));
        let largest = late.iter().map(|t| t.1).max();
        assert_eq!(clusters.iter().map(|t| t.1).max(), largest);
        assert!(decluster(&[]).0.is_empty() && decluster(&[(3, 9)]).0 == [(3, 9)]);
    }
}
