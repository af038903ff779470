//! Dose-volume histogram: the volume of a structure over its dose.

use rayon::prelude::*;

/// Doses of a structure, highest first, with the volume at each dose or more.
///
/// Each point's volume counts half above and half below its own dose; between points the volume is
/// linear in the dose.
#[derive(Clone, Debug, PartialEq)]
pub struct Dvh {
    dose_gy: Vec<f64>,
    /// Volume above each dose (m³), up to the middle of the point's own.
    above_m3: Vec<f64>,
    volume_m3: f64,
    mean_gy: f64,
}

/// Line of a differential histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Lower edge of the bin, in Gy.
    pub from_gy: f64,
    /// Upper edge of the bin, in Gy.
    pub to_gy: f64,
    /// Volume with a dose in the bin.
    pub volume_m3: f64,
    /// Volume with a dose of `from_gy` or more.
    pub at_least_m3: f64,
}

impl Dvh {
    /// Creates a histogram from the dose and the volume of each point; `None` without points.
    pub fn new(dose_gy: &[f64], volumes_m3: &[f64]) -> Option<Self> {
        let mut pairs: Vec<(f64, f64)> = dose_gy.iter().copied().zip(volumes_m3.iter().copied()).collect();
        pairs.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
        let (mut above, mut mean) = (0.0, 0.0);
        let mut above_m3 = Vec::with_capacity(pairs.len());
        for &(dose, volume) in &pairs {
            above_m3.push(above + volume / 2.0);
            above += volume;
            mean += dose * volume;
        }
        (above > 0.0).then(|| Self {
            dose_gy: pairs.into_iter().map(|p| p.0).collect(),
            above_m3,
            volume_m3: above,
            mean_gy: mean / above,
        })
    }

    /// Returns the volume of the structure, in m³.
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Returns the mean dose, in Gy.
    pub fn mean_gy(&self) -> f64 {
        self.mean_gy
    }

    /// Returns the highest dose, in Gy.
    pub fn highest_gy(&self) -> f64 {
        self.dose_gy[0]
    }

    /// Returns the lowest dose, in Gy.
    pub fn lowest_gy(&self) -> f64 {
        self.dose_gy[self.dose_gy.len() - 1]
    }

    /// Returns the volume with at least this dose (m³).
    pub fn at_least_m3(&self, dose_gy: f64) -> f64 {
        let below = self.dose_gy.partition_point(|&d| d >= dose_gy);
        match below {
            0 => 0.0,
            n if n == self.dose_gy.len() => self.volume_m3,
            n => {
                let (d0, d1) = (self.dose_gy[n - 1], self.dose_gy[n]);
                let (v0, v1) = (self.above_m3[n - 1], self.above_m3[n]);
                v0 + (v1 - v0) * (d0 - dose_gy) / (d0 - d1)
            }
        }
    }

    /// Returns the highest dose that at least this volume receives (Gy); `None` if the structure is
    /// smaller.
    pub fn dose_of_gy(&self, volume_m3: f64) -> Option<f64> {
        // A part in 10^9 is rounding.
        if !(0.0..=self.volume_m3 * (1.0 + 1e-9)).contains(&volume_m3) {
            return None;
        }
        let after = self.above_m3.partition_point(|&v| v < volume_m3);
        Some(match after {
            0 => self.dose_gy[0],
            n if n == self.dose_gy.len() => self.dose_gy[n - 1],
            n => {
                let (d0, d1) = (self.dose_gy[n - 1], self.dose_gy[n]);
                let (v0, v1) = (self.above_m3[n - 1], self.above_m3[n]);
                d0 + (d1 - d0) * (volume_m3 - v0) / (v1 - v0)
            }
        })
    }

    /// Returns the differential and cumulative histogram from 0 to `to_gy` or above.
    pub fn bins(&self, width_gy: f64, to_gy: f64) -> Vec<Bin> {
        let count = (to_gy / width_gy).ceil() as usize;
        let edge = |i: usize| i as f64 * width_gy;
        (0..count)
            .map(|i| {
                let at_least_m3 = self.at_least_m3(edge(i));
                Bin {
                    from_gy: edge(i),
                    to_gy: edge(i + 1),
                    volume_m3: at_least_m3 - self.at_least_m3(edge(i + 1)),
                    at_least_m3,
                }
            })
            .collect()
    }
}
