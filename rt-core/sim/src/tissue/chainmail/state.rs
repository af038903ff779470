//! State of a body: displacements times a scale, so that recovery is one multiplication.

use super::activity::Active;
use super::kernels::largest_square;
use super::model::ChainMail;
use super::stretch::Stretch;
use crate::tissue::{Carried, Deformed};

/// Displacements from rest of all elements, one array for each axis; and what the last step left to look at.
///
/// `scale` times an entry is a displacement in elements. Entries are f32, whose precision is relative: a small
/// scale costs none, until the exponent runs out.
#[derive(Clone, Debug)]
pub struct TissueState {
    pub(crate) u: [Vec<f32>; 3],
    pub(super) scale: f64,
    /// Swept and checked by the next pass.
    pub(crate) active: Active,
    /// Stretches that the present pass found for the next.
    pub(crate) next: Active,
    /// Elements that the solver has moved in this step.
    pub(crate) moved: Active,
    /// Moved in a row after its links along z, and after those along y, were handled; for the row under way.
    pub(crate) late: [Vec<Stretch>; 2],
    /// Largest square of a displacement in each run and each plane, in the unit of `u`.
    pub(super) run_square: Vec<f32>,
    pub(super) plane_square: Vec<f32>,
    pub(crate) max_displacement: f32,
    /// Largest violation of a link that is not active, at most, in elements.
    pub(crate) settled: f32,
    /// Violation that the last step left, in elements; infinite where it is unknown.
    pub(super) residual: f32,
    trial: Trial,
}

/// State before a step that may be undone: runs that moved, as they were.
#[derive(Clone, Debug)]
struct Trial {
    is_under_way: bool,
    before: [Vec<f32>; 3],
    active: Active,
    was_active: bool,
    settled: f32,
}

/// Scale below which displacements are rescaled: f32 squares still have room on both sides.
const SMALLEST_SCALE: f64 = 1e-9;
/// Displacements below this become zero, long before they become denormal and slow.
const AT_REST: f32 = 1e-12;

impl TissueState {
    /// Returns the body at rest. Writes every page, so that no step is the first to touch one.
    pub fn at_rest(model: &ChainMail) -> Self {
        let zeros = |n: usize| {
            let mut values = Vec::with_capacity(n);
            values.extend((0..n).map(|_| std::hint::black_box(0.0)));
            values
        };
        let (runs, planes) = (model.rows.runs.len(), model.lattice.dims[2]);
        let none = || Active::none(runs, planes);
        TissueState {
            u: std::array::from_fn(|_| zeros(model.element_count())),
            scale: 1.0,
            active: none(),
            next: none(),
            moved: none(),
            late: std::array::from_fn(|_| vec![std::hint::black_box(Stretch::EMPTY); runs]),
            run_square: zeros(runs),
            plane_square: zeros(planes),
            max_displacement: 0.0,
            settled: 0.0,
            residual: 0.0,
            trial: Trial {
                is_under_way: false,
                before: std::array::from_fn(|_| {
                    zeros(if model.classes.any_fixed() {
                        model.element_count()
                    } else {
                        0
                    })
                }),
                active: none(),
                was_active: false,
                settled: 0.0,
            },
        }
    }

    /// Returns how many elements a unit of `u` is.
    pub fn scale(&self) -> f32 {
        self.scale as f32
    }

    /// Returns the deformed body.
    pub fn deformed<'a>(&'a self, model: &'a ChainMail) -> Deformed<'a> {
        let stretch = model.classes.longest().iter().sum::<f32>();
        Deformed {
            lattice: &model.lattice,
            u: self.u.each_ref().map(Vec::as_slice),
            scale: self.scale(),
            carried: Carried::Not,
            reach: 1.0 + stretch + self.max_displacement,
        }
    }

    /// Returns every element to its place at rest, at once.
    pub fn return_to_rest(&mut self, model: &ChainMail) {
        for component in &mut self.u {
            component.fill(0.0);
        }
        self.run_square.fill(0.0);
        self.plane_square.fill(0.0);
        self.active.clear(&model.rows, model.lattice.dims[1]);
        (self.scale, self.max_displacement, self.settled, self.residual) = (1.0, 0.0, 0.0, 0.0);
    }

    /// Makes the next step check every link, as it must when the limits are new.
    pub fn disturb(&mut self, model: &ChainMail) {
        self.active.add_all(&model.rows, model.lattice.dims[1]);
        (self.settled, self.residual) = (0.0, f32::INFINITY);
    }

    /// Begins a trial: from here on motion can be undone; nothing may have moved in this step.
    pub(super) fn begin_trial(&mut self) {
        self.trial.is_under_way = true;
        self.trial.settled = self.settled;
        // Most often there is nothing to copy.
        if !self.active.is_empty() {
            self.trial.active.copy_from(&self.active);
        }
        self.trial.was_active = !self.active.is_empty();
    }

    pub(super) fn end_trial(&mut self) {
        self.trial.is_under_way = false;
    }

    /// Keeps a run; to be called before anything in it moves.
    #[inline(always)]
    pub(super) fn keep(&mut self, model: &ChainMail, run: usize) {
        if self.trial.is_under_way && self.moved.of_run(run).is_empty() {
            let run = model.rows.runs[run];
            let elements = run.first as usize..run.end() as usize;
            for (before, now) in self.trial.before.iter_mut().zip(&self.u) {
                before[elements.clone()].copy_from_slice(&now[elements.clone()]);
            }
        }
    }

    /// Returns to the beginning of the trial.
    pub(super) fn undo(&mut self, model: &ChainMail) {
        let ny = model.lattice.dims[1];
        let (u, before, moved) = (&mut self.u, &self.trial.before, &self.moved);
        moved.for_each_row(|j, k| {
            for run in model.rows.numbers(j + ny * k) {
                if !moved.of_run(run).is_empty() {
                    let elements = model.rows.runs[run].first as usize..model.rows.runs[run].end() as usize;
                    for (now, before) in u.iter_mut().zip(before) {
                        now[elements.clone()].copy_from_slice(&before[elements.clone()]);
                    }
                }
            }
        });
        self.moved.clear(&model.rows, ny);
        self.active.clear(&model.rows, ny);
        if self.trial.was_active {
            self.active.copy_from(&self.trial.active);
        }
        self.settled = self.trial.settled;
    }

    /// Puts an element `u` elements from rest; whether it was not there. The caller looks after its links.
    pub(crate) fn put(&mut self, element: usize, u: [f32; 3]) -> bool {
        let scale = self.scale();
        let mut moved = false;
        for (component, value) in self.u.iter_mut().zip(u) {
            if let Some(slot) = component.get_mut(element) {
                let before = std::mem::replace(slot, value / scale);
                moved |= before != *slot;
            }
        }
        moved
    }

    /// Returns whether every index of `model` lies inside this state, so that no step goes out of bounds.
    pub(crate) fn fits(&self, model: &ChainMail) -> bool {
        let (n, planes) = (model.element_count(), model.lattice.dims[2]);
        let kept = if model.classes.any_fixed() { n } else { 0 };
        self.u.iter().all(|c| c.len() == n)
            && self.run_square.len() == model.rows.runs.len()
            && self.plane_square.len() == planes
            && self.trial.before.iter().all(|c| c.len() == kept)
    }

    /// Recovers towards rest by the surroundings: differences shrink in proportion, so no limit is broken.
    pub(crate) fn recover(&mut self, model: &ChainMail, kept: f64) {
        if self.max_displacement == 0.0 {
            return;
        }
        let least = f64::from(model.classes.least_room());
        self.settled = (kept * f64::from(self.settled) - (1.0 - kept) * least).max(0.0) as f32;
        self.max_displacement *= kept as f32;
        self.scale *= kept;
        if self.max_displacement < AT_REST {
            self.return_to_rest(model);
        } else if self.scale < SMALLEST_SCALE {
            self.renormalise();
        }
    }

    /// Writes the scale into the displacements, and starts again from 1.
    fn renormalise(&mut self) {
        let scale = self.scale();
        for value in self.u.iter_mut().flatten() {
            let left = *value * scale;
            *value = if left.abs() > AT_REST { left } else { 0.0 };
        }
        for square in self.run_square.iter_mut().chain(&mut self.plane_square) {
            *square *= scale * scale;
        }
        self.scale = 1.0;
    }

    /// Takes the largest displacement again, from what this step has moved.
    pub(crate) fn measure(&mut self, model: &ChainMail) {
        let ny = model.lattice.dims[1];
        let u = self.u.each_ref().map(Vec::as_slice);
        let planes = self.moved.planes();
        for k in planes.numbers() {
            for j in self.moved.rows(k).numbers() {
                for run in model.rows.numbers(j + ny * k) {
                    if !self.moved.of_run(run).is_empty() {
                        let of_run = &model.rows.runs[run];
                        self.run_square[run] =
                            largest_square(model.simd, &u, of_run.first as usize, of_run.end() as usize);
                    }
                }
            }
            let [first, end] = model.rows_of_plane[k];
            let runs = model.rows.numbers_of_rows(first + ny * k, end + ny * k);
            self.plane_square[k] = largest(&self.run_square[runs]);
        }
        if !planes.is_empty() {
            self.max_displacement = largest(&self.plane_square).sqrt() * self.scale();
        }
    }
}

fn largest(values: &[f32]) -> f32 {
    values.iter().fold(0.0, |a, &b| if b > a { b } else { a })
}
