//! Dose rates over distance along and away from the axis of a source, and their comparison with the
//! rates that its TG-43 tables give.

use crate::tg43::{Formalism, Tables};
use std::fmt;

/// Agreement that TG-43U1 asks of a computation with the published rates, in percent.
pub const TOLERANCE_PERCENT: f64 = 2.0;
/// Mean difference above which another unit is likelier than another computation, in percent.
const OTHER_UNIT_PERCENT: f64 = 20.0;
const M_PER_CM: f64 = 0.01;
/// 1 Gy/s in cGy/h.
const CGY_PER_H_PER_GY_PER_S: f64 = 3.6e5;

/// Published dose rates of 1 U.
#[derive(Clone, Debug, PartialEq)]
pub struct AlongAway {
    /// Distances along the axis from the middle of the source, in cm.
    pub along_cm: Vec<f64>,
    /// Distances from the axis, in cm.
    pub away_cm: Vec<f64>,
    /// Dose rates in cGy/h, a row for each distance along the axis; `None` where the table is empty.
    pub rates: Vec<Option<f64>>,
}

/// One entry of the table and the computed rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Distance along the axis, in cm.
    pub along_cm: f64,
    /// Distance from the axis, in cm.
    pub away_cm: f64,
    /// Rate in the table, cGy/h.
    pub published: f64,
    /// Computed rate, cGy/h.
    pub computed: f64,
}

impl Entry {
    /// Returns the difference of the computed rate from the published one, in percent.
    pub fn percent(&self) -> f64 {
        (self.computed / self.published - 1.0) * 100.0
    }
}

/// Computed and published rates.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Entries outside the capsule.
    pub entries: Vec<Entry>,
    /// Number of entries inside the capsule, which have no dose.
    pub in_capsule: usize,
    /// Number of compared entries whose distance from the middle no table reaches.
    pub beyond_tables: usize,
}

impl AlongAway {
    /// Returns the rates that the tables give at the distances of this table.
    pub fn compare(&self, tables: &Tables) -> Comparison {
        let [least_m, most_m] = tables.radii_m();
        let mut found = Comparison {
            entries: Vec::new(),
            in_capsule: 0,
            beyond_tables: 0,
        };
        let places = self
            .along_cm
            .iter()
            .flat_map(|along| self.away_cm.iter().map(move |away| (*along, *away)));
        for ((along_cm, away_cm), published) in places.zip(&self.rates) {
            let Some(published) = published.filter(|rate| *rate > 0.0) else {
                continue;
            };
            let (along_m, away_m) = (along_cm * M_PER_CM, away_cm * M_PER_CM);
            if tables.capsule.holds(away_m.abs(), along_m) {
                found.in_capsule += 1;
                continue;
            }
            if !(least_m..=most_m).contains(&along_m.hypot(away_m)) {
                found.beyond_tables += 1;
            }
            found.entries.push(Entry {
                along_cm,
                away_cm,
                published,
                computed: tables.rate_gy_per_s(Formalism::TwoD, away_m, along_m) * CGY_PER_H_PER_GY_PER_S,
            });
        }
        found
    }
}

impl Comparison {
    /// Returns the mean difference, in percent.
    pub fn mean_percent(&self) -> f64 {
        self.entries.iter().map(Entry::percent).sum::<f64>() / self.entries.len() as f64
    }

    /// Returns the mean size of the differences, in percent.
    pub fn mean_size_percent(&self) -> f64 {
        self.entries.iter().map(|entry| entry.percent().abs()).sum::<f64>() / self.entries.len() as f64
    }

    /// Returns the entry with the largest difference.
    pub fn worst(&self) -> Option<&Entry> {
        let size = |entry: &&Entry| entry.percent().abs();
        self.entries.iter().max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// Returns the number of entries within the tolerance.
    pub fn within_tolerance(&self) -> usize {
        let is_within = |entry: &&Entry| entry.percent().abs() <= TOLERANCE_PERCENT;
        self.entries.iter().filter(is_within).count()
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(worst) = self.worst() else {
            return write!(f, "no dose rate outside the capsule to compare with");
        };
        write!(
            f,
            "{} of {} dose rates within the {TOLERANCE_PERCENT} % of TG-43U1; mean {:+.2} %, mean size {:.2} %, worst {:+.2} % at \
             {} cm along, {} cm away ({:.5} computed, {:.5} published, cGy/h for 1 U)",
            self.within_tolerance(),
            self.entries.len(),
            self.mean_percent(),
            self.mean_size_percent(),
            worst.percent(),
            worst.along_cm,
            worst.away_cm,
            worst.computed,
            worst.published,
        )?;
        if self.in_capsule > 0 {
            write!(f, "; {} inside the capsule are left out", self.in_capsule)?;
        }
        if self.beyond_tables > 0 {
            write!(f, "; {} lie where g or F is extrapolated", self.beyond_tables)?;
        }
        if self.mean_percent().abs() > OTHER_UNIT_PERCENT {
            write!(f, "; are they in cGy/h for 1 U?")?;
        }
        Ok(())
    }
}
