//! Alignment of captured edges with the loop's toggles: by the pattern of the times between them, then by a straight
//! line.

use super::capture::CaptureError;

/// Linear map from our clock to the instrument's, by least squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// Pairs of a toggle's index and an edge's index.
    pub pairs: Vec<(usize, usize)>,
    /// Relative rate by which the instrument's clock is faster than ours.
    pub drift: f64,
    /// Standard uncertainty of the drift.
    pub drift_u: f64,
    /// Instrument's seconds at our first toggle.
    pub at_first_s: f64,
    /// Residual of each pair, seconds.
    pub residuals_s: Vec<f64>,
}

/// Fewest edges needed.
const FEWEST: usize = 20;
/// Largest relative difference of two gaps that count as equal: drift of any quartz, and jitter.
const DRIFT: f64 = 5e-4;
const JITTER_S: f64 = 4e-4;
/// Fraction of the gaps in the overlap that must agree.
const SHARE: f64 = 0.8;

/// Aligns `edges_s` with `toggles_s`; fails with a reason if they are not of one run.
pub fn align(toggles_s: &[f64], edges_s: &[f64]) -> Result<Alignment, CaptureError> {
    if edges_s.len() < FEWEST || toggles_s.len() < FEWEST {
        return Err(CaptureError::TooFew {
            edges: edges_s.len(),
            toggles: toggles_s.len(),
            fewest: FEWEST,
        });
    }
    let (ours, theirs) = (gaps(toggles_s), gaps(edges_s));
    let agrees = |a: f64, b: f64| (a - b).abs() < JITTER_S + DRIFT * a;
    // `shift`: index of the first edge's toggle; negative if the capture began before the loop.
    let mut best = (0, 0, 0_isize);
    for shift in -(theirs.len() as isize - 1)..ours.len() as isize {
        let first = (-shift).max(0) as usize;
        let all = theirs[first..]
            .iter()
            .zip(ours[(shift + first as isize) as usize..].iter());
        let (mut same, mut of) = (0, 0);
        for (b, a) in all {
            of += 1;
            same += usize::from(agrees(*a, *b));
        }
        if same > best.0 {
            best = (same, of, shift);
        }
    }
    let (same, of, shift) = best;
    if same + 1 < FEWEST || (same as f64) < SHARE * of as f64 {
        return Err(CaptureError::OtherRun { same, of });
    }
    let pair = |edge: usize| {
        let toggle = edge as isize + shift;
        (0..toggles_s.len() as isize)
            .contains(&toggle)
            .then_some((toggle as usize, edge))
    };
    let pairs: Vec<(usize, usize)> = (0..edges_s.len()).filter_map(pair).collect();
    Ok(line(toggles_s, edges_s, pairs))
}

fn gaps(times: &[f64]) -> Vec<f64> {
    times.windows(2).map(|w| w[1] - w[0]).collect()
}

fn line(toggles_s: &[f64], edges_s: &[f64], pairs: Vec<(usize, usize)>) -> Alignment {
    let origin_s = toggles_s[0];
    let n = pairs.len() as f64;
    let xy = || pairs.iter().map(|&(t, e)| (toggles_s[t] - origin_s, edges_s[e]));
    let (sx, sy) = xy().fold((0.0, 0.0), |(sx, sy), (x, y)| (sx + x, sy + y));
    let (mx, my) = (sx / n, sy / n);
    // Around the means, and with the slope 1 removed: the small remainder is not lost in rounding.
    let (sxx, sxd) = xy().fold((0.0, 0.0), |(sxx, sxd), (x, y)| {
        let (dx, d) = (x - mx, (y - x) - (my - mx));
        (sxx + dx * dx, sxd + dx * d)
    });
    let drift = sxd / sxx;
    let at_first_s = my - (1.0 + drift) * mx;
    let residuals_s: Vec<f64> = xy().map(|(x, y)| y - at_first_s - x - drift * x).collect();
    let variance = residuals_s.iter().map(|r| r * r).sum::<f64>() / (n - 2.0).max(1.0);
    Alignment {
        pairs,
        drift,
        drift_u: (variance / sxx).sqrt(),
        at_first_s,
        residuals_s,
    }
}
