//! One model through one insertion: its time, and its error against the converged FEM on the same lattice.

use std::time::Instant;
use stylet_benches::error::{Error, Field, apart, best_shift_m, field, norm, quantile, rms};
use stylet_benches::insertions::TICK_S;
use stylet_sim::tissue::{Held, TissueModel};

/// The converged answer to a script, at the ticks that are compared.
pub struct Reference {
    fields: Vec<Field>,
    tip_force_n: Vec<[f64; 3]>,
}

/// Every so many ticks the tissue is compared.
const COMPARED: usize = 4;

fn is_compared(tick: usize, ticks: usize) -> bool {
    tick % COMPARED == COMPARED - 1 || tick + 1 == ticks
}

impl Reference {
    pub fn of(converged: &mut dyn TissueModel, script: &[Held]) -> Reference {
        let (mut fields, mut tip_force_n) = (Vec::new(), Vec::new());
        for (tick, &held) in script.iter().enumerate() {
            let report = converged.step(Some(held), TICK_S);
            assert!(report.converged, "the reference has to converge: {report:?}");
            if is_compared(tick, script.len()) {
                fields.push(field(&converged.deformed()));
                tip_force_n.push(report.tip_force_n.unwrap_or_default());
            }
        }
        Reference { fields, tip_force_n }
    }

    /// Returns the errors without any model: where nothing moves, and where each tick shifts the body as one piece by
    /// the best fit, which cannot be known beforehand.
    pub fn without_model(&self, travel_m: f64, seeds: &[u32]) -> [Error; 2] {
        let mut errors = [Error::default(), Error::default()];
        for field in &self.fields {
            let shifts_m = [[0.0; 3], best_shift_m(field, travel_m)];
            for (error, shift_m) in errors.iter_mut().zip(shifts_m) {
                error.add(field, |_| shift_m, travel_m, seeds);
            }
        }
        errors
    }
}

/// Cost and error of one run.
pub struct Run {
    /// Microseconds of each tick.
    pub micros: Vec<f64>,
    pub error: Error,
    /// Ticks that did not meet the model's own residual, and the largest residual.
    pub unconverged: usize,
    pub residual: f64,
    /// Error of the force on the tip over the largest of the insertion, RMS and largest; `None` where the model knows
    /// no forces.
    pub tip_force: Option<[f64; 2]>,
}

/// Steps a model at rest through a script.
pub fn run(model: &mut dyn TissueModel, script: &[Held], seeds: &[u32], travel_m: f64, reference: &Reference) -> Run {
    let mut run = Run {
        micros: Vec::with_capacity(script.len()),
        error: Error::default(),
        unconverged: 0,
        residual: 0.0,
        tip_force: None,
    };
    let mut fields = reference.fields.iter();
    let mut forces_n = Vec::new();
    model.return_to_rest();
    for (tick, &held) in script.iter().enumerate() {
        // On a straight way what is held next is what the loop would see ahead.
        let next = script[tick..].iter().find(|later| later.element != held.element);
        let start = Instant::now();
        let report = std::hint::black_box(model.step(Some(held), TICK_S));
        model.prepare(next.copied());
        run.micros.push(start.elapsed().as_secs_f64() * 1e6);
        run.unconverged += usize::from(!report.converged);
        run.residual = run.residual.max(report.residual);
        if is_compared(tick, script.len()) {
            let there = fields.next().expect("one field for each compared tick");
            let body = model.deformed();
            let moved_m = |e: usize| body.displacement(e as u32).map(|u| u * body.lattice.spacing_m);
            run.error.add(there, moved_m, travel_m, seeds);
            forces_n.extend(report.tip_force_n);
        }
    }
    run.tip_force = force_error(&forces_n, &reference.tip_force_n);
    run
}

fn force_error(forces_n: &[[f64; 3]], reference_n: &[[f64; 3]]) -> Option<[f64; 2]> {
    let largest_n = reference_n.iter().map(|&f| norm(f)).fold(0.0, f64::max);
    let pairs = forces_n.iter().zip(reference_n);
    let off: Vec<f64> = pairs.map(|(a, b)| apart(*a, *b) / largest_n).collect();
    (!off.is_empty() && largest_n > 0.0).then(|| [rms(&off), quantile(&off, 1.0)])
}
