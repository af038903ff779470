//! Stations across the line: the shaft in longer pieces, since a needle bends over centimetres.

use super::beam::MAX_ACROSS;
use super::stations::Stations;

/// About so long; a needle of 18 G bends over 35 mm in tissue.
const LENGTH_M: f64 = 4e-3;

impl Stations {
    /// Returns how many stations along the line make one across.
    pub fn group(&self) -> usize {
        let by_length = (LENGTH_M / self.settings.spacing_m).round() as usize;
        by_length.max(self.count().div_ceil(MAX_ACROSS)).max(1)
    }

    /// Returns the number of stations across; the remainder at the end of the line belongs to none.
    pub fn across_count(&self) -> usize {
        self.count() / self.group()
    }

    /// Returns the nodes and weights, which add up to 1, of the shaft in station `n` across.
    pub fn across_weights(&self, n: usize) -> Vec<(u32, f64)> {
        let group = self.group();
        let share = 1.0 / group as f64;
        let own = self.shaft.iter().skip(n * group).take(group).flatten();
        let mut all: Vec<(u32, f64)> = own.map(|&(node, weight)| (node, weight * share)).collect();
        all.sort_by_key(|(node, _)| *node);
        let mut merged: Vec<(u32, f64)> = Vec::new();
        for (node, weight) in all {
            match merged.last_mut() {
                Some((last, sum)) if *last == node => *sum += weight,
                _ => merged.push((node, weight)),
            }
        }
        merged
    }

    /// Returns the compliance of station `n` across that the lattice lacks for a load along the line, m/N.
    pub fn across_missing_m_per_n(&self, n: usize) -> f64 {
        let group = self.group();
        let own = self.missing_m_per_n.iter().skip(n * group).take(group);
        // Mean of what each piece lacks, over a load spread on all of them.
        own.sum::<f64>() / (group * group) as f64
    }
}
