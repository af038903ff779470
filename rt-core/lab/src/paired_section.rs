//! What a report says of the paired witness.

use crate::paired::{BOTH, LOOP_ALONE, WITNESS};
use crate::raw::Raw;
use crate::sample::late_from_ns;
use crate::summary::{Summary, summary};
use serde::{Deserialize, Serialize};

/// The paired witness in a report.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PairedSection {
    /// Lateness from which a wake-up counts as late: a fifth of the period.
    pub late_from_us: f64,
    /// Wake-ups of the witness.
    pub witness: Summary,
    /// Late wake-ups of the loop alone.
    pub loop_alone: Summary,
    /// Late wake-ups of the loop for which the witness was late as well.
    pub both: Summary,
    /// Late wake-ups that the witness did not watch.
    pub unwatched: u64,
}

impl PairedSection {
    /// Computes the section from the raw data.
    pub fn of(raw: &Raw, period_ns: u64) -> Self {
        let rate_hz = 1e9 / period_ns as f64;
        let late_ns = late_from_ns(period_ns);
        let of = |name, tag| summary(name, &raw.get(tag), &raw.parts(tag), rate_hz);
        let [loop_alone, both] = [of("late, loop alone", LOOP_ALONE), of("late, both", BOTH)];
        let wake = raw.get("haptic/wake");
        let late = wake.len() - wake.count_between(0, late_ns - 1);
        Self {
            late_from_us: late_ns as f64 / 1e3,
            witness: of("wake-up of the witness", WITNESS),
            unwatched: late.saturating_sub(loop_alone.count + both.count),
            loop_alone,
            both,
        }
    }

    /// Returns whose the late ticks are, in words.
    pub fn words(&self) -> String {
        let latest = |s: &Summary| s.max_us.map_or(String::new(), |us| format!(" (latest {us:.0} us)"));
        format!(
            "Wake-ups later than {:.0} us: {} of the loop alone{}, {} also of a witness on its core{}, {} unwatched",
            self.late_from_us,
            self.loop_alone.count,
            latest(&self.loop_alone),
            self.both.count,
            latest(&self.both),
            self.unwatched
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::histogram;

    #[test]
    fn late_ticks_are_counted_by_the_bins_of_the_histogram() {
        let mut wake = histogram();
        for ns in [199_000, 200_000, 250_000, 250_000] {
            wake.record(ns).expect("in range");
        }
        let mut both = histogram();
        both.record(250_000).expect("in range");
        let raw = Raw::with(vec![("haptic/wake".to_owned(), wake), (BOTH.to_owned(), both)]);
        let section = PairedSection::of(&raw, 1_000_000);
        assert_eq!(
            (section.loop_alone.count, section.both.count, section.unwatched),
            (0, 1, 2)
        );
        assert!(
            section
                .words()
                .contains("1 also of a witness on its core (latest 250 us)")
        );
    }
}
