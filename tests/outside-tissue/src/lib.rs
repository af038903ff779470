//! A tissue model of another crate: tissue follows the tip, and the less the farther it is from it.

use nalgebra::Vector3;
use std::sync::Arc;
use stylet_sim::scene::Lattice;
use stylet_sim::tissue::{Carried, Deformed, Held, HeldOutcome, Solve, StepReport, TissueModel, TissueSpec};

/// Distance over which the displacement falls to 1/e.
const REACH_M: f64 = 8e-3;

/// The model as a run takes it.
pub const JELLY: TissueSpec = TissueSpec::new(|scene, _| {
    let lattice = Arc::clone(&scene.body);
    let u = [0; 3].map(|_| vec![0.0; lattice.element_count()]);
    Ok(Box::new(Jelly { lattice, u, reach: 0.0 }))
});

struct Jelly {
    lattice: Arc<Lattice>,
    /// Displacement along each axis, in elements.
    u: [Vec<f32>; 3],
    reach: f32,
}

impl TissueModel for Jelly {
    fn step(&mut self, held: Option<Held>, _dt_s: f64) -> StepReport {
        self.return_to_rest();
        if let Some(Held {
            element, position_m, ..
        }) = held
        {
            let rest_m = |element| Vector3::from(self.lattice.rest_m(element));
            let tip = (Vector3::from(position_m) - rest_m(element)) / self.lattice.spacing_m;
            for n in 0..self.lattice.element_count() {
                let share = (-(rest_m(n as u32) - rest_m(element)).norm() / REACH_M).exp();
                (0..3).for_each(|a| self.u[a][n] = (tip[a] * share) as f32);
            }
            self.reach = tip.norm() as f32;
        }
        StepReport {
            passes: 1,
            residual: 0.0,
            moved: self.u[0].len() as u32,
            converged: true,
            max_displacement: self.reach,
            held: held.map_or(HeldOutcome::None, |_| HeldOutcome::Followed),
            solve: Solve::Sweeps,
            tip_force_n: None,
        }
    }

    fn deformed(&self) -> Deformed<'_> {
        Deformed {
            lattice: &self.lattice,
            u: self.u.each_ref().map(Vec::as_slice),
            scale: 1.0,
            carried: Carried::Not,
            reach: self.reach,
        }
    }

    fn return_to_rest(&mut self) {
        self.u.iter_mut().for_each(|u| u.fill(0.0));
        self.reach = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;
    use stylet_hw::DeviceInfo;
    use stylet_runtime::rehearse::{Rehearsed, Stage};
    use stylet_shm_schema::{NeedleRehearsal, ParameterSet};
    use stylet_sim::scene::{SceneSource, TissueKind};

    /// Takes a needle along the middle of the paper's gland to half its depth, drops a seed there, and draws it out.
    fn needle_in_and_out(tissue: TissueSpec) -> Rehearsed {
        let source = SceneSource::Builtin("paper".to_owned());
        let (low_m, high_m) = source.build().expect("built in").lattice.bounds_m();
        let middle_m = (Vector3::from(low_m) + Vector3::from(high_m)) / 2.0;
        let run = NeedleRehearsal {
            entry_m: [middle_m.x, middle_m.y, low_m[2] - 0.01],
            direction: [0.0, 0.0, 1.0],
            insert_m_per_s: 0.05,
            retract_m_per_s: 0.05,
            approach_m_per_s: 0.1,
            acceleration_m_per_s2: 2.0,
            retract_to_m: 0.0,
            strand_pitch_m: None,
            stabilising: Vec::new(),
            earlier: Vec::new(),
            as_points: false,
            drops_m: vec![middle_m.into()],
        };
        let mut stage = Stage::build(&source, tissue, DeviceInfo::phantom_premium_1_5()).expect("built in");
        let rehearse = stage.rehearse(&run, &ParameterSet::default(), &AtomicBool::new(false));
        rehearse.expect("goes through")
    }

    #[test]
    fn a_needle_goes_in_and_out() {
        let (jelly, paper) = (needle_in_and_out(JELLY), needle_in_and_out(TissueKind::Paper.into()));
        for done in [&jelly, &paper] {
            // The membrane gives at 8 mm (ADR 6), seen once in a tick of 0.25 mm.
            let punctured_m = done.displacement_before_puncture_m;
            assert!((7.5e-3..8.3e-3).contains(&punctured_m), "{punctured_m}");
            assert!(done.peak_force_n > 1.0, "{}", done.peak_force_n);
            // The seed goes back with the tissue that the needle had dragged along.
            let back_m = done.seeds[0].dropped_at_m[2] - done.seeds[0].position_m[2];
            assert!((0.5e-3..done.largest_displacement_m).contains(&back_m), "{back_m}");
        }
        assert_ne!(jelly.target_shift_m, paper.target_shift_m);
        assert_eq!(jelly, needle_in_and_out(JELLY));
    }
}
