//! Criteria for the dose of a permanent implant: limits of the measures, after the ABS and AAPM
//! TG-137 guidance for I-125 at 145 Gy.

use super::Dvh;
use super::metric::Metric;
use stylet_anatomy::Organ;

/// Measure of one structure, for display.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of the structure, for display.
    pub structure: String,
    /// Measure.
    pub metric: Metric,
    /// Its value in Gy, or in percent of the structure.
    pub value: f64,
    /// Its limit, if it has one.
    pub limit: Option<Limit>,
}

impl Figure {
    /// Returns the limit that the value violates, in words; `None` if it meets its limit or has
    /// none.
    pub fn broken(&self) -> Option<String> {
        let limit = self.limit.filter(|limit| !limit.is_met(self.value))?;
        let unit = match self.metric.unit() {
            "gy" => "Gy",
            _ => "%",
        };
        let (side, value) = match limit {
            Limit::AtLeast(value) => ("below", value),
            Limit::AtMost(value) => ("above", value),
        };
        let (structure, metric) = (&self.structure, self.metric);
        Some(format!(
            "{structure} {metric} is {:.1} {unit}, {side} {value:.1} {unit} by {:.1}",
            self.value,
            (self.value - value).abs()
        ))
    }
}

/// Limit of a measure, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// The value should be this or more.
    AtLeast(f64),
    /// The value should be this or less.
    AtMost(f64),
}

impl Limit {
    /// Returns whether a value meets the limit.
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
        }
    }
}

/// Structure whose dose is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoseStructure {
    /// The target.
    Target,
    /// The urethra.
    Urethra,
    /// The rectum or its wall.
    Rectum,
}

impl DoseStructure {
    /// Classifies a structure by its role, or by a word in its name; `None` for one without limits.
    pub fn of(name: &str, is_target: bool) -> Option<Self> {
        if is_target {
            Some(Self::Target)
        } else if Organ::Urethra.is_mentioned_in(name) {
            Some(Self::Urethra)
        } else {
            Organ::RectalWall.is_mentioned_in(name).then_some(Self::Rectum)
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Target => "target",
            Self::Urethra => "urethra",
            Self::Rectum => "rectum",
        }
    }

    /// Returns the measures of the structure, with their limits.
    pub(crate) fn metrics(self, prescription_gy: f64) -> Vec<(Metric, Option<Limit>)> {
        let dose = |share: f64| Metric::DoseToShare(share);
        let volume = |share: f64| Metric::VolumeAtShare(share);
        match self {
            Self::Target => vec![
                (dose(0.9), Some(Limit::AtLeast(prescription_gy))),
                (volume(1.0), Some(Limit::AtLeast(95.0))),
                (volume(1.5), Some(Limit::AtMost(60.0))),
            ],
            Self::Urethra => vec![
                (dose(0.1), Some(Limit::AtMost(1.5 * prescription_gy))),
                (dose(0.3), Some(Limit::AtMost(1.3 * prescription_gy))),
            ],
            Self::Rectum => vec![(Metric::DoseToVolume { m3: 2e-6 }, Some(Limit::AtMost(prescription_gy)))],
        }
    }

    /// Returns the measures of the structure that its histogram allows.
    pub fn figures(self, dvh: &Dvh, prescription_gy: f64) -> Vec<Figure> {
        let figure = |(metric, limit): (Metric, Option<Limit>)| {
            Some(Figure {
                structure: self.name().to_owned(),
                metric,
                // A structure smaller than the requested volume has no such figure.
                value: metric.of(dvh, prescription_gy).main()?,
                limit,
            })
        };
        self.metrics(prescription_gy).into_iter().filter_map(figure).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards against V150 and D10 of the urethra above their limits next to "nothing is wrong with
    /// the plan".
    #[test]
    fn only_a_measure_beyond_its_limit_is_reported() {
        let urethra = DoseStructure::of("prostatic urethra", false).unwrap();
        let dvh = Dvh::new(&[291.0; 10], &[1e-7; 10]).unwrap();
        let broken: Vec<String> = urethra.figures(&dvh, 145.0).iter().filter_map(Figure::broken).collect();
        assert_eq!(
            broken,
            [
                "urethra D10 is 291.0 Gy, above 217.5 Gy by 73.5",
                "urethra D30 is 291.0 Gy, above 188.5 Gy by 102.5"
            ]
        );
        let dvh = Dvh::new(&[145.0; 10], &[1e-7; 10]).unwrap();
        let target = DoseStructure::Target.figures(&dvh, 145.0);
        assert!(target.iter().all(|f| f.broken().is_none()) && target.len() == 3);
    }
}
