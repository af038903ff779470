//! Natural dose of an implant: the low-dose edge of the volume histogram without the inverse
//! square.

/// Width of a bin of u, which is 1 at the prescription.
const BIN: f64 = 0.04;
/// Number of bins; the last is at a quarter of the prescription.
const BINS: usize = 200;
/// Number of bins on each side in the moving average.
const SMOOTH: usize = 3;

/// Returns the dose at which the natural histogram dV/du has fallen from its peak to half of it
/// towards low doses. Here u = D^(-3/2) (Anderson, Med. Phys. 13, 898, 1986). `None` if it does not
/// fall so far above the dose at which the volume leaves the region.
pub fn natural_dose_gy(dose_gy: &[f64], prescription_gy: f64, leaves_gy: f64) -> Option<f64> {
    let mut counts = vec![0.0; BINS];
    for gy in dose_gy.iter().filter(|gy| **gy > 0.0) {
        let bin = ((gy / prescription_gy).powf(-1.5) / BIN) as usize;
        if bin < BINS {
            counts[bin] += 1.0;
        }
    }
    let smooth = |n: usize| {
        let near = &counts[n.saturating_sub(SMOOTH)..(n + SMOOTH + 1).min(BINS)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    let values: Vec<f64> = (0..BINS).map(smooth).collect();
    let peak = (0..BINS).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let half = values[peak] / 2.0;
    let below = (peak..BINS).find(|n| values[*n] < half)?;
    let (high, low) = (values[below.saturating_sub(1)], values[below]);
    let at = below as f64 - if high > low { (half - low) / (high - low) } else { 0.0 };
    let gy = prescription_gy * ((at + 0.5) * BIN).powf(-2.0 / 3.0);
    (gy > leaves_gy).then_some(gy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests doses whose volume over u is constant up to an edge.
    #[test]
    fn the_edge_of_a_histogram_is_found_and_a_lone_source_has_none() {
        let to = |edge: f64| -> Vec<f64> {
            (0..200_000)
                .map(|n| 145.0 * (edge * (f64::from(n) + 0.5) / 200_000.0).powf(-2.0 / 3.0))
                .collect()
        };
        let found = natural_dose_gy(&to(1.2), 145.0, 10.0).unwrap();
        let edge = 145.0 * 1.2_f64.powf(-2.0 / 3.0);
        assert!((found / edge - 1.0).abs() < 0.01, "{found} {edge}");
        // A point source alone: its natural histogram is flat.
        assert_eq!(natural_dose_gy(&to(20.0), 145.0, 10.0), None);
    }
}
