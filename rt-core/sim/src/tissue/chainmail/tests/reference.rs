//! The same sweeps over every element in f64, plainly written: what f32, the scale and looking only
//! at what moves cost in error. Slow.

use crate::tissue::Held;
use crate::tissue::chainmail::ChainMail;

/// Sweeps of one step, at most.
const MAX_SWEEPS: usize = 50;
/// Residual at which sweeps end, in elements.
const CONVERGED: f64 = 1e-9;

/// A body of one structure, in f64.
pub struct Reference {
    /// Displacement from rest of each element, in elements.
    pub u: Vec<[f64; 3]>,
}

impl Reference {
    pub fn at_rest(model: &ChainMail) -> Self {
        Reference {
            u: vec![[0.0; 3]; model.element_count()],
        }
    }

    /// Recovers, puts the held element in place, and sweeps; returns the residual in elements.
    ///
    /// # Panics
    ///
    /// If there is no such element or the body has several structures.
    pub fn step(&mut self, model: &ChainMail, held: Held, dt_s: f64) -> f64 {
        assert_eq!(model.classes.count(), 1, "one kind of tissue");
        let kept = (-dt_s.max(0.0) / model.limits().recovery_time_s).exp();
        self.u.iter_mut().flatten().for_each(|u| *u *= kept);
        let (rest, h) = (model.lattice.rest_m(held.element), model.lattice.spacing_m);
        let at = [0, 1, 2].map(|a| (held.position_m[a] - rest[a]) / h);
        self.u[held.element as usize] = at;
        self.sweep(model, held.element)
    }

    fn sweep(&mut self, model: &ChainMail, held: u32) -> f64 {
        let dims = model.lattice.dims;
        let centre = model.lattice.cell(held);
        let outward = |axis: usize| (centre[axis]..dims[axis]).chain((0..centre[axis]).rev());
        let mut residual = f64::INFINITY;
        for _ in 0..MAX_SWEEPS {
            for k in outward(2) {
                for j in outward(1) {
                    for i in outward(0) {
                        if let Some(element) = model.lattice.element_of_cell(i, j, k) {
                            self.follow(model, element, centre);
                        }
                    }
                }
            }
            residual = self.largest_violation(model);
            if residual <= CONVERGED {
                break;
            }
        }
        residual
    }

    /// Moves an element into the limits of its links with its inner neighbours.
    fn follow(&mut self, model: &ChainMail, element: u32, centre: [usize; 3]) {
        let cell = model.lattice.cell(element);
        let around = model.lattice.neighbours(element);
        for axis in [2, 1, 0] {
            let sign = if cell[axis] > centre[axis] { 1.0 } else { -1.0 };
            let inner = around[2 * axis + usize::from(sign < 0.0)];
            let (Some(inner), true) = (inner, cell[axis] != centre[axis]) else {
                continue;
            };
            let (low, high, tan) = limits(model, axis);
            let from = self.u[inner as usize];
            let to = &mut self.u[element as usize];
            let along = (sign * (to[axis] - from[axis])).clamp(low, high);
            let shear = tan * (1.0 + along);
            for n in 0..3 {
                to[n] = if n == axis {
                    from[n] + sign * along
                } else {
                    from[n] + (to[n] - from[n]).clamp(-shear, shear)
                };
            }
        }
    }

    fn largest_violation(&self, model: &ChainMail) -> f64 {
        let mut worst = 0.0_f64;
        for axis in 0..3 {
            let (low, high, tan) = limits(model, axis);
            for span in model.links[axis].all() {
                for n in 0..span.len {
                    let [lo, hi] = [span.lo, span.hi].map(|first| self.u[(first + n) as usize]);
                    let d = [0, 1, 2].map(|c| hi[c] - lo[c]);
                    let sides = (0..3).filter(|&c| c != axis).map(|c| d[c].abs());
                    let shear = sides.fold(0.0, f64::max) - tan * (1.0 + d[axis]);
                    worst = worst.max(low - d[axis]).max(d[axis] - high).max(shear);
                }
            }
        }
        worst
    }
}

fn limits(model: &ChainMail, axis: usize) -> (f64, f64, f64) {
    let l = model.classes.limits(0, axis);
    (f64::from(l.low), f64::from(l.high), f64::from(l.tan))
}
