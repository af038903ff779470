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
        let (structure, metric) = (&self.structure, self.metric);
        Some(format!(
            "{structure} {metric} is {}: limit {limit} not met",
            self.shown()
        ))
    }

    /// Returns the value with its unit.
    pub fn shown(&self) -> String {
        let unit = match self.metric.unit() {
            "gy" => "Gy",
            _ => "%",
        };
        format!("{} {unit}", shown(self.value, self.limit, 1))
    }
}

/// Formats a value, with more decimals than asked where only they show on which side of its limit
/// it is.
pub fn shown(value: f64, limit: Option<Limit>, decimals: usize) -> String {
    let text = |decimals: usize| format!("{value:.decimals$}");
    let agrees = |text: &String| {
        limit.is_none_or(|limit| {
            text.parse::<f64>()
                .is_ok_and(|shown| limit.is_met(shown) == limit.is_met(value))
        })
    };
    let longer = (decimals..decimals + 4).map(text);
    longer.into_iter().find(agrees).unwrap_or_else(|| value.to_string())
}

/// Returns the figures of all structures, the first of each role.
pub fn figures<'a>(
    structures: impl IntoIterator<Item = (&'a str, &'a Dvh)>,
    target: usize,
    prescription_gy: f64,
) -> Vec<Figure> {
    let mut known = Vec::new();
    let mut all = Vec::new();
    for (n, (name, dvh)) in structures.into_iter().enumerate() {
        if let Some(role) = DoseStructure::of(name, n == target).filter(|role| !known.contains(role)) {
            known.push(role);
            all.extend(role.figures(dvh, prescription_gy));
        }
    }
    all
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

    /// Returns in words whether a value meets the limit.
    pub fn verdict(self, value: f64) -> &'static str {
        if self.is_met(value) { "met" } else { "not met" }
    }
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (sign, Self::AtLeast(limit) | Self::AtMost(limit)) = match self {
            Self::AtLeast(_) => ("≥", self),
            Self::AtMost(_) => ("≤", self),
        };
        // A product such as 1.3 times 115 has digits beyond those of a limit.
        write!(f, "{sign} {}", (limit * 100.0).round() / 100.0)
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
    pub fn metrics(self, prescription_gy: f64) -> Vec<(Metric, Option<Limit>)> {
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
                "urethra D10 is 291.0 Gy: limit ≤ 217.5 not met",
                "urethra D30 is 291.0 Gy: limit ≤ 188.5 not met"
            ]
        );
        let dvh = Dvh::new(&[145.0; 10], &[1e-7; 10]).unwrap();
        let target = DoseStructure::Target.figures(&dvh, 145.0);
        assert!(target.iter().all(|f| f.broken().is_none()) && target.len() == 3);
    }

    /// Guards against "218.0 Gy, above 218".
    #[test]
    fn a_value_is_never_shown_on_the_other_side_of_its_limit() {
        let (most, least) = (Limit::AtMost(217.5), Limit::AtLeast(145.0));
        for (value, limit, text, verdict) in [
            (217.5, most, "217.5", "met"),
            (217.52, most, "217.52", "not met"),
            (217.500_000_1, most, "217.5000001", "not met"),
            (218.0, most, "218.0", "not met"),
            (144.96, least, "144.96", "not met"),
            (145.04, least, "145.0", "met"),
        ] {
            assert_eq!(
                (shown(value, Some(limit), 1).as_str(), limit.verdict(value)),
                (text, verdict)
            );
        }
        assert_eq!(shown(217.52, None, 1), "217.5");
        assert_eq!(
            [Limit::AtMost(1.3 * 115.0), least].map(|l| l.to_string()),
            ["≤ 149.5", "≥ 145"]
        );
    }
}
