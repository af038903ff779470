//! Differences between recorded and repeated numbers, by their name.

use std::collections::BTreeMap;
use std::fmt;

/// Difference of one number over a recording.
#[derive(Clone, Copy, Debug)]
struct Difference {
    first_tick: usize,
    ticks: usize,
    largest: f64,
    /// Largest size of the recorded number.
    of: f64,
}

/// Numbers that differ in any bit.
#[derive(Clone, Debug, Default)]
pub struct Differences {
    found: BTreeMap<&'static str, Difference>,
    sizes: BTreeMap<&'static str, f64>,
}

impl Differences {
    /// Compares a number of that tick.
    pub fn compare(&mut self, tick: usize, name: &'static str, recorded: f64, repeated: f64) {
        let size = self.sizes.entry(name).or_default();
        *size = size.max(recorded.abs());
        if recorded.to_bits() == repeated.to_bits() {
            return;
        }
        let found = self.found.entry(name).or_insert(Difference {
            first_tick: tick,
            ticks: 0,
            largest: 0.0,
            of: 0.0,
        });
        found.largest = found.largest.max((repeated - recorded).abs());
        found.ticks += 1;
        found.of = *size;
    }

    /// True if every bit was the same.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }
}

impl fmt::Display for Differences {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut found: Vec<_> = self.found.iter().collect();
        found.sort_by_key(|(name, difference)| (difference.first_tick, **name));
        for (name, d) in found {
            writeln!(
                f,
                "  {name}: {} times, first in tick {}, by {:e} at most, of {:e}",
                d.ticks, d.first_tick, d.largest, d.of
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_differs_is_named_with_its_first_tick() {
        let mut differences = Differences::default();
        differences.compare(1, "depth_m", 2.0, 2.0);
        assert!(differences.is_empty());
        for tick in 2..5 {
            differences.compare(tick, "depth_m", 2.0, 2.5);
        }
        let text = differences.to_string();
        assert_eq!(text, "  depth_m: 3 times, first in tick 2, by 5e-1 at most, of 2e0\n");
    }
}
