//! The delay from one input to another, with an uncertainty budget after the GUM (NIST TN 1297): each term named.

use super::align::Alignment;
use super::capture::{Capture, CaptureError, Channel};
use serde::Serialize;

/// One term of a budget, as a standard uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Term {
    pub name: &'static str,
    /// A: by statistics of the readings. B: by other means.
    pub kind: char,
    pub why: String,
    pub us: f64,
}

/// A delay with its uncertainty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Delay {
    /// The input at whose edges it begins.
    pub from: String,
    pub channel: String,
    pub pairs: usize,
    pub mean_us: f64,
    pub least_us: f64,
    pub most_us: f64,
    pub terms: Vec<Term>,
    /// Standard uncertainty of the mean, all terms together.
    pub combined_us: f64,
    /// Expanded uncertainty with a coverage factor of 2: about 95 %.
    pub expanded_us: f64,
}

/// Longest delay of an answer after its toggle.
const LATEST_S: f64 = 0.5;
/// Fewest answers needed.
const FEWEST: usize = 10;

/// Rest of an input before a new motion.
const REST_S: f64 = 0.3;

/// Edges of an input at which events begin that others answer.
pub struct Begins<'a> {
    pub channel: &'a Channel,
    pub edges_s: Vec<f64>,
}

impl<'a> Begins<'a> {
    /// Returns the edges that are toggles of the run.
    pub fn at_pin(pin: &'a Channel, alignment: &Alignment) -> Self {
        Self {
            channel: pin,
            edges_s: alignment.pairs.iter().map(|&(_, edge)| pin.edges_s[edge]).collect(),
        }
    }

    /// Returns the first edge of each motion: a handle keeps moving, and an accelerometer rings.
    pub fn at_motion(channel: &'a Channel) -> Self {
        let mut last_s = f64::MIN;
        let begins = channel.edges_s.iter().copied().filter(|&edge_s| {
            let rested = edge_s - last_s > REST_S;
            last_s = edge_s;
            rested
        });
        Self {
            channel,
            edges_s: begins.collect(),
        }
    }
}

/// Returns the time from each edge of `from` to the next one of `channel`, in seconds of our clock.
pub fn delay(
    capture: &Capture,
    from: &Begins<'_>,
    alignment: &Alignment,
    channel: &Channel,
) -> Result<Delay, CaptureError> {
    let mut delays: Vec<f64> = Vec::new();
    for (i, &at_s) in from.edges_s.iter().enumerate() {
        let next_s = from.edges_s.get(i + 1).copied().unwrap_or(f64::MAX);
        let place = channel.edges_s.partition_point(|e| *e < at_s);
        if let Some(answer_s) = channel
            .edges_s
            .get(place)
            .filter(|a| **a < next_s && **a - at_s < LATEST_S)
        {
            // The instrument's clock is not ours.
            delays.push((answer_s - at_s) / (1.0 + alignment.drift));
        }
    }
    if delays.len() < FEWEST || 2 * delays.len() < from.edges_s.len() {
        return Err(CaptureError::NoAnswer {
            to: channel.name.clone(),
            answers: delays.len(),
            from: from.channel.name.clone(),
            edges: from.edges_s.len(),
            fewest: FEWEST,
        });
    }
    let n = delays.len() as f64;
    let mean_s = delays.iter().sum::<f64>() / n;
    let scatter_s = (delays.iter().map(|d| (d - mean_s).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let term = |name, kind, seconds: f64, why: String| Term {
        name,
        kind,
        why,
        us: seconds * 1e6,
    };
    let terms = vec![
        term(
            "repeatability",
            'A',
            scatter_s / n.sqrt(),
            format!(
                "standard deviation {:.1} us of {n} delays, over the root of their number",
                scatter_s * 1e6
            ),
        ),
        term(
            "sampling",
            'B',
            capture.step_s / 6_f64.sqrt(),
            format!(
                "both edges lie anywhere within a sample of {:.2} us (two rectangles); not averaged",
                capture.step_s * 1e6
            ),
        ),
        term(
            "clock of the instrument",
            'B',
            mean_s * alignment.drift_u,
            format!(
                "drift {:.3} ppm, known to {:.4} ppm, over the delay",
                alignment.drift * 1e6,
                alignment.drift_u * 1e6
            ),
        ),
    ];
    let combined_us = terms.iter().map(|t| t.us * t.us).sum::<f64>().sqrt();
    Ok(Delay {
        from: from.channel.name.clone(),
        channel: channel.name.clone(),
        pairs: delays.len(),
        mean_us: mean_s * 1e6,
        least_us: delays.iter().copied().fold(f64::MAX, f64::min) * 1e6,
        most_us: delays.iter().copied().fold(0.0, f64::max) * 1e6,
        terms,
        combined_us,
        expanded_us: 2.0 * combined_us,
    })
}
