//! Figures of merit of a dose: measures of the structures with their limits, and the histogram of
//! the target. They are counted in the points of the debrief and the plan, so that all agree.

use stylet_dose::criteria::{self, Figure};
use stylet_dose::{DoseKernel, DosePoints, Dvh, Seed, Structure};
use stylet_host::link::SceneModel;
use stylet_implant::plan::Anatomy;

/// Structures of a scene in which dose is counted, the target first; none without a closed target.
pub(super) struct Counted(Vec<(Structure, DosePoints)>);

impl Counted {
    pub fn of(scene: &SceneModel) -> Self {
        let structures = Anatomy::of(scene).map_or(Vec::new(), |anatomy| anatomy.structures());
        let with_points = |s: Structure| {
            let points = DosePoints::new(&s.points_m);
            (s, points)
        };
        Self(structures.into_iter().map(with_points).collect())
    }

    /// Computes figures and the histogram of the target.
    pub fn figures(&self, kernel: &DoseKernel, seeds: &[Seed], prescription_gy: f64) -> (Vec<Figure>, Vec<[f64; 2]>) {
        let dvh = |(s, points): &(Structure, DosePoints)| Dvh::new(&points.of_seeds_gy(kernel, seeds), &s.volumes_m3);
        let dvhs: Vec<Option<Dvh>> = self.0.iter().map(dvh).collect();
        let named = self
            .0
            .iter()
            .zip(&dvhs)
            .map(|((s, _), dvh)| (s.name.as_str(), dvh.as_ref()));
        let figures = criteria::figures(named.filter_map(|(name, dvh)| Some((name, dvh?))), 0, prescription_gy);
        let target = dvhs.first().and_then(Option::as_ref);
        (figures, target.map_or(Vec::new(), |dvh| curve(dvh, prescription_gy)))
    }
}

fn curve(dvh: &Dvh, prescription_gy: f64) -> Vec<[f64; 2]> {
    const STEPS: usize = 120;
    let at = |i: usize| 3.0 * i as f64 / STEPS as f64;
    let share = |x: f64| dvh.at_least_m3(x * prescription_gy) / dvh.volume_m3();
    (0..=STEPS).map(|i| [at(i), share(at(i))]).collect()
}
