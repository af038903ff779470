//! ChainMail's settings fitted to the converged FEM, on the insertions that are meant for it.

use crate::models::chainmail;
use crate::runs::{Reference, run};
use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;
use stylet_sim::limits::TissueParameters;
use stylet_sim::scene::Scene;
use stylet_sim::tissue::Held;

/// An insertion with its answer.
pub struct Lesson {
    pub script: Vec<Held>,
    pub travel_m: f64,
    pub reference: Reference,
}

const MOST_EVALUATIONS: u64 = 80;

/// Mean over the lessons of the RMS error in parts of the tip's travel; infinite for settings that are not valid.
struct Cost<'a> {
    scene: &'a Scene,
    lessons: &'a [Lesson],
}

impl CostFunction for Cost<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let parameters = limits_of(p);
        if parameters.validate().is_err() {
            return Ok(f64::INFINITY);
        }
        let mut model = chainmail(self.scene, &parameters);
        let errors = self.lessons.iter().map(|lesson| {
            let run = run(&mut model, &lesson.script, &[], lesson.travel_m, &lesson.reference);
            run.error.all.rms_m() / lesson.travel_m
        });
        Ok(errors.sum::<f64>() / self.lessons.len() as f64)
    }
}

/// Logarithms keep what must be positive positive.
fn limits_of(p: &[f64]) -> TissueParameters {
    TissueParameters {
        min_stretch: 1.0 - p[0].exp(),
        max_stretch: 1.0 + p[1].exp(),
        shear_deg: p[2].exp(),
        shear_vert_deg: p[2].exp(),
        recovery_time_s: p[3].exp(),
        ..TissueParameters::default()
    }
}

/// Fits limits and recovery.
pub fn fit(scene: &Scene, lessons: &[Lesson]) -> TissueParameters {
    let start = [0.3_f64, 0.5, 20.0, 0.5].map(f64::ln).to_vec();
    let corner = |n: usize| {
        let mut p = start.clone();
        p[n] -= 0.4;
        p
    };
    let simplex = std::iter::once(start.clone()).chain((0..start.len()).map(corner));
    let solver = NelderMead::new(simplex.collect())
        .with_sd_tolerance(1e-5)
        .expect("positive");
    let found = Executor::new(Cost { scene, lessons }, solver)
        .configure(|state| state.max_iters(MOST_EVALUATIONS))
        .run()
        .expect("the cost is always defined");
    limits_of(&found.state.best_param.unwrap_or(start))
}
