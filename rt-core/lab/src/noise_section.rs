//! What a report says of the noise on the force loop's core.

use crate::noise::{GAPS, Noise, NoiseGap, SWITCHED};
use crate::raw::Raw;
use serde::{Deserialize, Serialize};

/// The pass in a report.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NoiseSection {
    pub core: Option<usize>,
    pub watched_s: f64,
    /// Gaps in which the kernel switched no thread.
    pub gaps: u64,
    pub worst_us: Option<f64>,
    /// Gaps in which another thread had the core.
    pub switched: u64,
    pub worst_switched_us: Option<f64>,
    /// The longest of both kinds.
    pub longest: Vec<NoiseGap>,
}

impl NoiseSection {
    /// Returns the section; its counts are those of [`NoiseSection::derive`].
    pub fn of(noise: &Noise) -> Self {
        Self {
            core: noise.seen.core,
            watched_s: noise.seen.watched_ns as f64 / 1e9,
            gaps: 0,
            worst_us: None,
            switched: 0,
            worst_switched_us: None,
            longest: noise.longest(),
        }
    }

    /// Computes the counts from the raw data.
    pub fn derive(&mut self, raw: &Raw) {
        let of = |name| {
            let h = raw.get(name);
            (h.len(), (!h.is_empty()).then(|| h.max() as f64 / 1e3))
        };
        (self.gaps, self.worst_us) = of(GAPS);
        (self.switched, self.worst_switched_us) = of(SWITCHED);
    }

    /// Returns the counts in words.
    pub fn words(&self) -> String {
        let core = self.core.map_or("any core".to_owned(), |core| format!("core {core}"));
        let worst = |us: Option<f64>| us.map_or(String::new(), |us| format!(", the longest {us:.0} us"));
        format!(
            "Noise before the loop started: {:.1} s watched on {core}: {} gaps over 20 us without a switch{}; {} in which \
             another thread had the core{}",
            self.watched_s,
            self.gaps,
            worst(self.worst_us),
            self.switched,
            worst(self.worst_switched_us)
        )
    }

    /// Returns what contradicts the histograms.
    pub fn contradiction(&self, raw: &Raw) -> Option<String> {
        let both = [raw.get(GAPS), raw.get(SWITCHED)];
        let longest: Vec<f64> = self.longest.iter().map(|gap| gap.us).collect();
        let ends_us = both.iter().map(|h| h.max()).max().unwrap_or(0) as f64 / 1e3;
        let known = |us: &f64| both.iter().any(|h| h.count_at((us * 1e3).round() as u64) > 0);
        let right = longest.iter().all(known) && longest.is_sorted_by(|a, b| a >= b);
        let first = longest.first().copied().unwrap_or(0.0);
        (!right || first != ends_us).then(|| "noise: the longest gaps are not those of the histograms".to_owned())
    }
}
