//! The same sweeps and relaxation over every element in f64, plainly written: what f32, the scale and looking only
//! at what moves cost in error. Slow.

use crate::tissue::Held;
use crate::tissue::chainmail::ChainMail;
use crate::tissue::chainmail::segments::{LEFT, RIGHT};

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

    /// Recovers, puts the held element in place, sweeps, relaxes and sweeps again; returns the residual in elements.
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
        let mut residual = self.sweep(model, held.element);
        if let Some(relaxation) = model.limits().relaxation {
            for half in 0..2 * relaxation.iterations as usize {
                self.relax(model, held.element, half % 2);
            }
            residual = self.sweep(model, held.element);
        }
        residual
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

    /// Makes one half pass of relaxation, as `relax::half_pass`.
    fn relax(&mut self, model: &ChainMail, held: u32, parity: usize) {
        let Some(relaxation) = model.limits().relaxation else {
            return;
        };
        let at = self.u[held as usize];
        let [_, ny, nz] = model.lattice.dims;
        let (shear, foundation) = (f64::from(relaxation.shear), f64::from(relaxation.foundation));
        for (j, k) in (0..nz).flat_map(|k| (0..ny).map(move |j| (j, k))) {
            if (j + k) % 2 != parity {
                continue;
            }
            for segment in model.segments.of_row(j + ny * k) {
                let first = segment.first as usize;
                let mut left = self.u[first - usize::from(segment.open & LEFT == 0)];
                for n in 0..segment.len as usize {
                    let own = self.u[first + n];
                    let is_last = n + 1 == segment.len as usize;
                    let right = if is_last && segment.open & RIGHT != 0 {
                        own
                    } else {
                        self.u[first + n + 1]
                    };
                    let beside = segment.beside.map(|b| self.u[b as usize + n]);
                    for c in 0..3 {
                        let k = [0, 1, 2].map(|axis| if axis == c { 1.0 } else { shear });
                        let springs = 2.0 * (k[0] + k[1] + k[2]) + foundation;
                        let pull = k[0] * (left[c] + right[c])
                            + k[1] * (beside[0][c] + beside[1][c])
                            + k[2] * (beside[2][c] + beside[3][c]);
                        let part = f64::from(relaxation.weight) / (springs + 2.0 * k[0]);
                        self.u[first + n][c] = own[c] + part * (pull - springs * own[c]);
                    }
                    left = own;
                }
                self.u[held as usize] = at;
            }
        }
    }
}

fn limits(model: &ChainMail, axis: usize) -> (f64, f64, f64) {
    let l = model.classes.limits(0, axis);
    (f64::from(l.low), f64::from(l.high), f64::from(l.tan))
}
