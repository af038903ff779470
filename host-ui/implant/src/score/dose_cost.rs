//! Cost of each seed's error: the measures of the implant with this one seed on plan, minus the
//! actual ones.

use stylet_anatomy::Organ;
use stylet_dose::{DoseKernel, DosePoints, Dvh, Metric, Seed, Structure};

/// Gain if this seed alone were on plan; positive D90 and V100 were lost, positive doses to the
/// urethra were saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// D90 of the target, Gy.
    pub target_d90_gy: f64,
    /// V100 of the target, %.
    pub target_v100_percent: f64,
    /// D10 of the urethra, Gy; `None` without a urethra.
    pub urethra_d10_gy: Option<f64>,
    /// D30 of the urethra, Gy; `None` without a urethra.
    pub urethra_d30_gy: Option<f64>,
}

/// Points of one structure with the dose of all seeds as delivered.
struct Field<'a> {
    points: DosePoints,
    volumes_m3: &'a [f64],
    dose_gy: Vec<f64>,
}

impl<'a> Field<'a> {
    fn new(structure: &'a Structure, kernel: &DoseKernel, delivered: &[Seed]) -> Self {
        let points = DosePoints::new(&structure.points_m);
        Self {
            dose_gy: points.of_seeds_gy(kernel, delivered),
            volumes_m3: &structure.volumes_m3,
            points,
        }
    }

    /// Returns the doses with one seed moved to its planned place.
    fn with_seed_on_plan(&self, kernel: &DoseKernel, planned: &Seed, delivered: &Seed) -> Option<Dvh> {
        let there = self.points.of_seeds_gy(kernel, std::slice::from_ref(planned));
        let here = self.points.of_seeds_gy(kernel, std::slice::from_ref(delivered));
        let moved = self.dose_gy.iter().zip(there.iter().zip(&here));
        Dvh::new(
            &moved.map(|(all, (t, h))| all + t - h).collect::<Vec<_>>(),
            self.volumes_m3,
        )
    }

    fn as_delivered(&self) -> Option<Dvh> {
        Dvh::new(&self.dose_gy, self.volumes_m3)
    }
}

/// Returns the costs in the order of the planned seeds; `delivered` has theirs first, then the
/// others in the tissue. `structures` begins with the target.
pub fn costs(
    structures: &[Structure],
    kernel: &DoseKernel,
    prescription_gy: f64,
    planned: &[Seed],
    delivered: &[Seed],
) -> Vec<Cost> {
    let field = |s| Field::new(s, kernel, delivered);
    let target = structures.first().map(field);
    let is_urethra = |s: &&Structure| Organ::Urethra.is_mentioned_in(&s.name);
    let urethra = structures.iter().skip(1).find(is_urethra).map(field);
    let value = |dvh: &Option<Dvh>, metric: Metric| dvh.as_ref().and_then(|d| metric.of(d, prescription_gy).main());
    let now = |f: &Option<Field>| f.as_ref().and_then(Field::as_delivered);
    let (target_now, urethra_now) = (now(&target), now(&urethra));
    planned
        .iter()
        .zip(delivered)
        .map(|(there, here)| {
            let then = |f: &Option<Field>| f.as_ref().and_then(|f| f.with_seed_on_plan(kernel, there, here));
            let (target, urethra) = (then(&target), then(&urethra));
            let gain = |after: &Option<Dvh>, before: &Option<Dvh>, metric| {
                Some(value(after, metric)? - value(before, metric)?)
            };
            let (d90, v100) = (Metric::DoseToShare(0.9), Metric::VolumeAtShare(1.0));
            Cost {
                target_d90_gy: gain(&target, &target_now, d90).unwrap_or(0.0),
                target_v100_percent: gain(&target, &target_now, v100).unwrap_or(0.0),
                urethra_d10_gy: gain(&urethra, &urethra_now, Metric::DoseToShare(0.1)).map(|g| -g),
                urethra_d30_gy: gain(&urethra, &urethra_now, Metric::DoseToShare(0.3)).map(|g| -g),
            }
        })
        .collect()
}
