//! Measures of the objectives, at the points of the full dose engine and at those of the search.

use super::samples::{RECTUM_M3, Samples};
use crate::plan::anatomy::{Body, DOSE_PITCH_M};
use crate::plan::dose::{DoseKernel, DosePoints, Dvh, Seed, Structure};
use std::fmt;

/// Measures of a plan in percent, of the target or of the prescription; `None` for a missing
/// structure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Share of the target with the prescription.
    pub v100: f64,
    /// Dose to the hottest 90 % of the target.
    pub d90: f64,
    /// Share of the target with 150 % of the prescription.
    pub v150: f64,
    /// Share of the target with 200 % of the prescription, without a limit.
    pub v200: f64,
    /// Dose to the hottest tenth of the urethra.
    pub urethra_d10: Option<f64>,
    /// Dose to the hottest 30 % of the urethra.
    pub urethra_d30: Option<f64>,
    /// Dose to the hottest 2 cc of the rectum.
    pub rectum_d2cc: Option<f64>,
}

/// Measure with its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measure {
    /// Structure and measure, for display.
    pub name: &'static str,
    /// Its value, percent.
    pub value: f64,
    /// Least and most, percent.
    pub limits: [f64; 2],
}

impl Measure {
    /// Returns the excess over its limits, percent; 0 within them.
    pub fn beyond(&self) -> f64 {
        let [least, most] = self.limits;
        (least - self.value).max(self.value - most).max(0.0)
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.limits;
        let (name, value, by) = (self.name, self.value, self.beyond());
        if value < least {
            write!(f, "{name} is {value:.1} %, {by:.1} below its limit of {least} %")
        } else if value > most {
            write!(f, "{name} is {value:.1} %, {by:.1} above its limit of {most} %")
        } else {
            write!(f, "{name} is {value:.1} %")
        }
    }
}

impl Figures {
    /// Computes measures from histograms of target, urethra and rectum; `None` without a target.
    /// `rectum` is 2 cc in the unit of its volumes.
    fn of(dvhs: &[Option<Dvh>; 3], prescription: f64, rectum: f64) -> Option<Self> {
        let [target, urethra, other] = dvhs;
        let percent = |dose: Option<f64>| dose.map(|dose| dose / prescription * 100.0);
        let to_share = |dvh: &Dvh, share: f64| percent(dvh.dose_of_gy(share * dvh.volume_m3()));
        let target = target.as_ref()?;
        let share = |level: f64| target.at_least_m3(level * prescription) / target.volume_m3() * 100.0;
        Some(Self {
            v100: share(1.0),
            d90: to_share(target, 0.9)?,
            v150: share(1.5),
            v200: share(2.0),
            urethra_d10: urethra.as_ref().and_then(|dvh| to_share(dvh, 0.1)),
            urethra_d30: urethra.as_ref().and_then(|dvh| to_share(dvh, 0.3)),
            rectum_d2cc: other.as_ref().and_then(|dvh| percent(dvh.dose_of_gy(rectum))),
        })
    }

    /// Computes measures at the points of the search, from doses as shares of the prescription.
    pub(super) fn of_samples(samples: &Samples, dose: &[f32]) -> Option<Self> {
        let dvh = |range: &std::ops::Range<usize>| {
            let doubles = |values: &[f32]| values[range.clone()].iter().map(|v| f64::from(*v)).collect::<Vec<_>>();
            Dvh::new(&doubles(dose), &doubles(&samples.weights))
        };
        Self::of(&[&samples.target, &samples.urethra, &samples.rectum].map(dvh), 1.0, 1.0)
    }

    /// Returns each measure with its limits.
    pub fn measures(&self) -> impl Iterator<Item = Measure> + use<> {
        let measure = |name, value: Option<f64>, limits| value.map(|value| Measure { name, value, limits });
        let most = |percent| [0.0, percent];
        [
            measure("target V100", Some(self.v100), [95.0, 100.0]),
            measure("target D90", Some(self.d90), [100.0, 125.0]),
            measure("target V150", Some(self.v150), most(60.0)),
            measure("urethra D10", self.urethra_d10, most(150.0)),
            measure("urethra D30", self.urethra_d30, most(130.0)),
            measure("rectum D2cc", self.rectum_d2cc, most(100.0)),
        ]
        .into_iter()
        .flatten()
    }

    /// Returns the sum of all excesses over limits, percent.
    pub fn beyond(&self) -> f64 {
        self.measures().map(|m| m.beyond()).sum()
    }

    /// Returns the violated limits with their excess.
    pub fn broken(&self) -> Vec<String> {
        let broken = self.measures().filter(|m| m.beyond() > 0.0);
        broken.map(|m| m.to_string()).collect()
    }
}

/// Full dose engine on the structures of the objectives.
pub struct Engine<'a> {
    kernel: &'a DoseKernel,
    structures: [Option<(DosePoints, Structure)>; 3],
}

impl<'a> Engine<'a> {
    /// Creates an engine for target, urethra and rectum.
    pub fn new(kernel: &'a DoseKernel, bodies: [Option<&Body>; 3]) -> Self {
        let structure = |body: Option<&Body>| {
            let structure = body?.structure(DOSE_PITCH_M);
            Some((DosePoints::new(&structure.points_m), structure))
        };
        Self {
            kernel,
            structures: bodies.map(structure),
        }
    }

    /// Computes histograms of seeds.
    pub fn histograms(&self, seeds: &[Seed]) -> Histograms {
        let dvh = |structure: &Option<(DosePoints, Structure)>| {
            let (points, structure) = structure.as_ref()?;
            Dvh::new(&points.of_seeds_gy(self.kernel, seeds), &structure.volumes_m3)
        };
        Histograms([0, 1, 2].map(|n| dvh(&self.structures[n])))
    }

    /// Returns the points of all structures, m.
    pub fn points_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let structures = self.structures.iter().flatten();
        structures.flat_map(|(_, structure)| structure.points_m.iter().copied())
    }
}

/// Histograms of target, urethra and rectum.
pub struct Histograms([Option<Dvh>; 3]);

impl Histograms {
    /// Returns the measures of the same seeds at a multiple of their strength.
    pub fn figures(&self, strengthened: f64, prescription_gy: f64) -> Option<Figures> {
        Figures::of(&self.0, prescription_gy / strengthened, RECTUM_M3)
    }
}
