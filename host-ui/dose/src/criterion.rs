//! The share of trials that meet a criterion.

use super::criteria::{DoseStructure, Limit};
use super::error::DoseError;
use super::metric::Metric;

/// Limit of one measure, by its name in [`crate::report::Judge::values`].
#[derive(Clone, Debug, PartialEq)]
pub struct Criterion {
    /// Name and unit of the measure.
    pub measure: String,
    /// Limit in the unit of the measure, Gy or percent of the structure.
    pub limit: Limit,
}

/// Number of trials that met a criterion.
#[derive(Clone, Debug, PartialEq)]
pub struct CriterionCount {
    /// Criterion to meet.
    pub criterion: Criterion,
    /// Trials that met it.
    pub met: usize,
    /// Trials in which the measure is defined.
    pub of: usize,
}

impl Criterion {
    /// Returns the limits of a structure from the project's page (ABS, AAPM TG-137); none for one
    /// without a role.
    pub fn of_structure(name: &str, is_target: bool, prescription_gy: f64) -> Vec<Self> {
        let Some(structure) = DoseStructure::of(name, is_target) else {
            return Vec::new();
        };
        let limited = structure.metrics(prescription_gy).into_iter();
        limited
            .filter_map(|(metric, limit)| Some(Self::new(name, metric, limit?)))
            .collect()
    }

    fn new(structure: &str, metric: Metric, limit: Limit) -> Self {
        Self {
            measure: format!("{structure} {metric} [{}]", metric.unit()),
            limit,
        }
    }

    /// Reads `Prostate D90>=130.5` or, for the target, `V150<=60`: doses in Gy, volumes in percent.
    /// Also returns the metric, which must be computed.
    pub fn parse(text: &str, names: &[&str], target: usize) -> Result<(Self, Metric), DoseError> {
        let wrong = |why: &str| {
            DoseError::Metric(format!(
                "\"{text}\" is not a criterion: {why}; write [STRUCTURE ]METRIC>=VALUE or <=, as in \"D90>=130.5\" (Gy) or \"Urethra V150<=10\" (percent)"
            ))
        };
        let at_least = text.split_once(">=").map(|(left, value)| (left, value, true));
        let (left, value, is_least) = at_least
            .or_else(|| text.split_once("<=").map(|(left, value)| (left, value, false)))
            .ok_or_else(|| wrong("it has neither >= nor <="))?;
        let value: f64 = value.trim().parse().map_err(|_| wrong("its value is not a number"))?;
        if !value.is_finite() {
            return Err(wrong("its value is not finite"));
        }
        let (name, metric) = left.trim().rsplit_once(' ').unwrap_or((names[target], left));
        let name = names
            .iter()
            .find(|n| n.eq_ignore_ascii_case(name.trim()))
            .ok_or_else(|| {
                wrong(&format!(
                    "no structure is called {}, there are {}",
                    name.trim(),
                    names.join(", ")
                ))
            })?;
        let metric = Metric::parse(metric)?;
        let limit = if is_least {
            Limit::AtLeast(value)
        } else {
            Limit::AtMost(value)
        };
        Ok((Self::new(name, metric, limit), metric))
    }

    /// Returns how many trials meet it; `None` where `measures` has no such measure.
    pub fn kept(
        &self,
        measures: &[(String, Option<f64>)],
        trials: &[(usize, Vec<Option<f64>>)],
    ) -> Option<CriterionCount> {
        let column = measures.iter().position(|(name, _)| *name == self.measure)?;
        let values = || trials.iter().filter_map(|(_, row)| row[column]);
        Some(CriterionCount {
            criterion: self.clone(),
            met: values().filter(|v| self.limit.is_met(*v)).count(),
            of: values().count(),
        })
    }
}

impl std::fmt::Display for Criterion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.limit {
            Limit::AtLeast(value) => write!(f, "{} at least {value:.2}", self.measure),
            Limit::AtMost(value) => write!(f, "{} at most {value:.2}", self.measure),
        }
    }
}

impl CriterionCount {
    /// Returns the share of the trials with its 95 % interval (Wilson, J. Am. Stat. Assoc. 22, 209,
    /// 1927); `None` without a trial.
    pub fn share(&self) -> Option<[f64; 3]> {
        let (z, n) = (1.959_963_985_f64, self.of as f64);
        let p = self.met as f64 / n;
        let middle = p + z * z / (2.0 * n);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        let all = 1.0 + z * z / n;
        // Rounding must not leave the share itself outside.
        (self.of > 0).then(|| {
            [
                p,
                ((middle - half) / all).clamp(0.0, p),
                ((middle + half) / all).clamp(p, 1.0),
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks Wilson's interval: its ends are where a score test is just significant, (p - q)² = z²
    /// q (1 - q) / n.
    #[test]
    fn the_interval_of_a_share_ends_where_the_score_test_does() {
        for (met, of) in [(0, 10), (3, 10), (95, 100), (1000, 1000)] {
            let criterion = Criterion::new("a", Metric::Mean, Limit::AtLeast(0.0));
            let [p, low, high] = CriterionCount { criterion, met, of }.share().unwrap();
            for q in [low, high].into_iter().filter(|q| (1e-9..1.0 - 1e-9).contains(q)) {
                let score = (p - q).powi(2) / (q * (1.0 - q) / of as f64);
                assert!((score.sqrt() - 1.959_964).abs() < 1e-5, "{met} of {of}: {score}");
            }
            assert!(low <= p && p <= high);
        }
    }

    #[test]
    fn trials_are_counted_on_the_right_side_of_the_limit() {
        let measures = [("Prostate D90 [gy]".to_owned(), None)];
        let trials: Vec<_> = [Some(130.4), Some(130.5), None, Some(140.0)]
            .into_iter()
            .map(|v| (0, vec![v]))
            .collect();
        let names = ["Urethra", "Prostate"];
        for (text, met) in [("D90>=130.5", 2), ("prostate D90 <= 130.5", 2), ("D90>=1000", 0)] {
            let (criterion, metric) = Criterion::parse(text, &names, 1).unwrap();
            let kept = criterion.kept(&measures, &trials).unwrap();
            assert_eq!(
                (kept.met, kept.of, metric),
                (met, 3, Metric::DoseToShare(0.9)),
                "{text}"
            );
        }
        for wrong in ["D90", "D90>=", "D90>=nan", "Bladder D90>=1", "X90>=1"] {
            assert!(Criterion::parse(wrong, &names, 1).is_err(), "{wrong}");
        }
        let of_urethra = Criterion::of_structure("Urethra", false, 145.0);
        assert_eq!(of_urethra[0].to_string(), "Urethra D10 [gy] at most 217.50");
    }
}
