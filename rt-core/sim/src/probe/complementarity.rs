//! Forces that only push: `gap = q + A p`, `gap >= 0`, `p >= 0`, `gap p = 0`.
//!
//! By active sets: which pads are in contact says the forces, the forces and gaps say which pads are in contact. Where the sets go round in a circle,
//! sweeps of projected Gauss-Seidel find them.

/// Rounds of active sets, at most: seven were the most that a jump of 5 mm took.
const ROUNDS: usize = 24;
const SWEEPS: usize = 300;
/// Of the mean of the diagonal, added to it: pads share nodes of a coarse body.
const RIDGE: f64 = 1e-6;

/// Room for the largest problem; nothing is allocated after that.
#[derive(Clone, Debug)]
pub struct Problem {
    most: usize,
    /// How many there are now.
    pub count: usize,
    /// `A`, row after row of `count`.
    pub matrix: Vec<f64>,
    /// `q`, m.
    pub free_m: Vec<f64>,
    /// `p`, N: the first guess, then the answer.
    pub forces_n: Vec<f64>,
    /// Numbers of those in contact.
    pub set: Vec<u32>,
    factor: Vec<f64>,
    /// Room for one number a pad.
    pub work: Vec<f64>,
    is_in: Vec<bool>,
    /// Rounds that the last solve took; more than [`ROUNDS`] where it swept.
    pub rounds: usize,
}

impl Problem {
    /// Of at most so many pads.
    pub fn with_room(most: usize) -> Self {
        Problem {
            most,
            count: 0,
            matrix: vec![0.0; most * most],
            free_m: vec![0.0; most],
            forces_n: vec![0.0; most],
            set: Vec::with_capacity(most),
            factor: vec![0.0; most * most],
            work: vec![0.0; most],
            is_in: vec![false; most],
            rounds: 0,
        }
    }

    /// Finds the forces.
    pub fn solve(&mut self) {
        let n = self.count.min(self.most);
        for i in 0..n {
            self.is_in[i] = self.forces_n[i] > 0.0;
        }
        self.rounds = 0;
        while self.rounds < ROUNDS {
            self.rounds += 1;
            if !self.solve_set() {
                break;
            }
            if !self.change_set() {
                return;
            }
        }
        self.rounds = ROUNDS + 1;
        self.sweep();
        for i in 0..n {
            self.is_in[i] = self.forces_n[i] > 0.0;
        }
        // The sweeps' set, solved for in full, where that only pushes.
        if self.solve_set() && self.forces_n[..n].iter().any(|p| *p < 0.0) {
            self.sweep();
        }
    }

    /// Forces with which the gaps of the set are closed and the others are 0; false where the matrix has no factor.
    pub fn solve_set(&mut self) -> bool {
        let n = self.count.min(self.most);
        self.set.clear();
        self.set.extend((0..n as u32).filter(|&i| self.is_in[i as usize]));
        if !self.decompose() {
            return false;
        }
        let m = self.set.len();
        for (at, &i) in self.set.iter().enumerate() {
            self.work[at] = -self.free_m[i as usize];
        }
        let (factor, work) = (&self.factor, &mut self.work[..m]);
        substitute(factor, work);
        self.forces_n[..n].fill(0.0);
        for (at, &i) in self.set.iter().enumerate() {
            self.forces_n[i as usize] = self.work[at];
        }
        true
    }

    /// Takes those that pull out of the set, and those that overlap into it.
    fn change_set(&mut self) -> bool {
        let n = self.count.min(self.most);
        let mut has_changed = false;
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let is_in = if self.is_in[i] {
                self.forces_n[i] > 0.0
            } else {
                let gap_m = self.free_m[i] + dot(row, &self.forces_n[..n]);
                gap_m < -1e-10
            };
            has_changed |= is_in != self.is_in[i];
            self.is_in[i] = is_in;
        }
        has_changed
    }

    fn sweep(&mut self) {
        let n = self.count.min(self.most);
        for p in &mut self.forces_n[..n] {
            *p = p.max(0.0);
        }
        for _ in 0..SWEEPS {
            let mut largest = 0.0_f64;
            for i in 0..n {
                let row = &self.matrix[i * n..(i + 1) * n];
                let gap_m = self.free_m[i] + dot(row, &self.forces_n[..n]);
                let before = self.forces_n[i];
                let now = (before - gap_m / row[i].max(1e-12)).max(0.0);
                largest = largest.max((now - before).abs() * row[i]);
                self.forces_n[i] = now;
            }
            if largest < 1e-10 {
                return;
            }
        }
    }

    /// Cholesky of the rows and columns in the set.
    fn decompose(&mut self) -> bool {
        let (n, m) = (self.count.min(self.most), self.set.len());
        let mean = (0..n).map(|i| self.matrix[i * n + i]).sum::<f64>() / n.max(1) as f64;
        for (r, &i) in self.set.iter().enumerate() {
            for (c, &j) in self.set.iter().enumerate().take(r + 1) {
                let (before, here) = self.factor.split_at(r * m);
                let row = &here[..c];
                let other = if c == r { row } else { &before[c * m..c * m + c] };
                let ridge = if r == c { RIDGE * mean } else { 0.0 };
                let left = self.matrix[i as usize * n + j as usize] + ridge - dot(row, other);
                let value = if r == c {
                    // NaN as well.
                    if !(left > 0.0) {
                        return false;
                    }
                    left.sqrt()
                } else {
                    left / self.factor[c * m + c]
                };
                self.factor[r * m + c] = value;
            }
        }
        true
    }

    /// Solves with the factor of the last set, in place.
    pub fn back(&self, values: &mut [f64]) {
        substitute(&self.factor, values);
    }
}

/// `L L' x = b` in place; rows of `factor` are as long as `values`.
fn substitute(factor: &[f64], values: &mut [f64]) {
    let m = values.len();
    for r in 0..m {
        let row = &factor[r * m..r * m + r];
        values[r] = (values[r] - dot(row, &values[..r])) / factor[r * m + r];
    }
    for r in (0..m).rev() {
        let value = values[r] / factor[r * m + r];
        values[r] = value;
        for (c, slot) in values[..r].iter_mut().enumerate() {
            *slot -= factor[r * m + c] * value;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
