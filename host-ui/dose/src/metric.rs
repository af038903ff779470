//! Measures of a DVH by their clinical names: D90, D2cc, V150, V20Gy, Dmean.

use super::Dvh;
use super::error::DoseError;

const M3_PER_CC: f64 = 1e-6;

/// Measure of a DVH.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Metric {
    /// Dose to the hottest share of the volume: D90.
    DoseToShare(f64),
    /// Dose to the hottest volume: D2cc.
    DoseToVolume {
        /// The volume, in m³.
        m3: f64,
    },
    /// Volume with at least a share of the prescription: V150.
    VolumeAtShare(f64),
    /// Volume with at least a dose: V20Gy.
    VolumeAtDose {
        /// The dose, in Gy.
        gy: f64,
    },
    /// Mean dose.
    Mean,
    /// Highest dose.
    Highest,
    /// Lowest dose.
    Lowest,
}

/// Value of a measure, in display units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A dose.
    Dose {
        /// In Gy.
        gy: f64,
        /// In percent of the prescription.
        percent: f64,
    },
    /// A volume.
    Volume {
        /// In cm³.
        cc: f64,
        /// In percent of the structure.
        percent: f64,
    },
    /// The structure is smaller than the requested volume.
    TooSmall {
        /// Volume of the structure, in cm³.
        cc: f64,
    },
}

impl Value {
    /// Returns the value in Gy, or in percent of the structure, for statistics.
    pub fn main(self) -> Option<f64> {
        match self {
            Self::Dose { gy, .. } => Some(gy),
            Self::Volume { percent, .. } => Some(percent),
            Self::TooSmall { .. } => None,
        }
    }
}

impl Metric {
    /// Reads a name such as `D90`, `D90%`, `D0.1cc`, `V150`, `V150%`, `V145Gy`, `Dmean`, `Dmax`, `Dmin`.
    pub fn parse(name: &str) -> Result<Self, DoseError> {
        let lower = name.trim().to_ascii_lowercase();
        match lower.as_str() {
            "dmean" => return Ok(Self::Mean),
            "dmax" => return Ok(Self::Highest),
            "dmin" => return Ok(Self::Lowest),
            _ => {}
        }
        let wrong = || {
            DoseError::Metric(format!(
                "\"{name}\" is not a metric; write D90 (or D90%), D2cc, V150 (or V150%), V145Gy, Dmean, Dmax or Dmin"
            ))
        };
        let number_before = |unit: &str| -> Option<f64> {
            let number: f64 = lower.get(1..)?.strip_suffix(unit)?.trim().parse().ok()?;
            (number.is_finite() && number >= 0.0).then_some(number)
        };
        let percent = number_before("%").or_else(|| number_before(""));
        match lower.chars().next() {
            Some('d') => match (number_before("cc"), percent) {
                (Some(cc), _) => Ok(Self::DoseToVolume { m3: cc * M3_PER_CC }),
                (None, Some(p)) if p <= 100.0 => Ok(Self::DoseToShare(p / 100.0)),
                _ => Err(wrong()),
            },
            Some('v') => match (number_before("gy"), percent) {
                (Some(gy), _) => Ok(Self::VolumeAtDose { gy }),
                (None, Some(p)) => Ok(Self::VolumeAtShare(p / 100.0)),
                _ => Err(wrong()),
            },
            _ => Err(wrong()),
        }
    }

    /// Returns the value in a histogram; `prescription_gy` in Gy.
    pub fn of(self, dvh: &Dvh, prescription_gy: f64) -> Value {
        let dose = |gy: f64| Value::Dose {
            gy,
            percent: gy / prescription_gy * 100.0,
        };
        let volume = |m3: f64| Value::Volume {
            cc: m3 / M3_PER_CC,
            percent: m3 / dvh.volume_m3() * 100.0,
        };
        let to_volume = |m3: f64| {
            dvh.dose_of_gy(m3).map_or(
                Value::TooSmall {
                    cc: dvh.volume_m3() / M3_PER_CC,
                },
                dose,
            )
        };
        match self {
            Self::DoseToShare(share) => to_volume(share * dvh.volume_m3()),
            Self::DoseToVolume { m3 } => to_volume(m3),
            Self::VolumeAtShare(share) => volume(dvh.at_least_m3(share * prescription_gy)),
            Self::VolumeAtDose { gy } => volume(dvh.at_least_m3(gy)),
            Self::Mean => dose(dvh.mean_gy()),
            Self::Highest => dose(dvh.highest_gy()),
            Self::Lowest => dose(dvh.lowest_gy()),
        }
    }

    /// Returns the unit of its value: dose (Gy) or volume (percent).
    pub fn unit(self) -> &'static str {
        match self {
            Self::VolumeAtShare(_) | Self::VolumeAtDose { .. } => "percent",
            _ => "gy",
        }
    }
}

impl std::fmt::Display for Metric {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Shares come from percents: drop digits beyond those that were typed.
        let percent = |share: f64| (share * 1e8).round() / 1e6;
        match self {
            Self::DoseToShare(share) => write!(f, "D{}", percent(*share)),
            Self::DoseToVolume { m3 } => write!(f, "D{}cc", (m3 / M3_PER_CC * 1e6).round() / 1e6),
            Self::VolumeAtShare(share) => write!(f, "V{}", percent(*share)),
            Self::VolumeAtDose { gy } => write!(f, "V{gy}Gy"),
            Self::Mean => f.write_str("Dmean"),
            Self::Highest => f.write_str("Dmax"),
            Self::Lowest => f.write_str("Dmin"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_with_their_units_and_written_the_same() {
        for (name, written) in [
            ("D90", "D90"),
            ("d90%", "D90"),
            ("D2cc", "D2cc"),
            ("D0.1cc", "D0.1cc"),
            ("D 0.1 cc", "D0.1cc"),
            ("V150", "V150"),
            ("V100%", "V100"),
            ("V145Gy", "V145Gy"),
            ("Dmean", "Dmean"),
            ("D99.9", "D99.9"),
        ] {
            assert_eq!(Metric::parse(name).unwrap().to_string(), written);
        }
        for wrong in [
            "", "D", "D101", "V-1", "X90", "D2ml", "V100cc", "Dnan", "Vinf", "D2cc%", "ä90",
        ] {
            assert!(Metric::parse(wrong).is_err(), "{wrong} was taken");
        }
    }
}
