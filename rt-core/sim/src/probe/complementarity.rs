//! Forces that only push: `gap = q + A p`, `gap >= 0`, `p >= 0`, `gap p = 0`.
//!
//! By active sets: which points are in contact says the forces, the forces and gaps say which points are in contact.

/// Rounds of active sets, at most: what they leave is found in the next pass over the directions, which begins from the set that they leave.
const ROUNDS: usize = 6;
/// Of the mean of the diagonal, added to it: pads share nodes of a coarse body.
const RIDGE: f64 = 1e-5;

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
    /// Rounds that the last solve took.
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

    /// Finds the forces. Where sets go round in a circle, one point at a time is to change.
    pub fn solve(&mut self, one_at_a_time: bool) {
        let n = self.count.min(self.most);
        for i in 0..n {
            self.is_in[i] = self.forces_n[i] > 0.0;
        }
        self.rounds = 0;
        while self.rounds < ROUNDS {
            self.rounds += 1;
            if !self.solve_set() || !self.change_set(one_at_a_time) {
                return;
            }
        }
        self.solve_set();
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

    /// Takes those that pull out of the set, and those that overlap into it; or only the one that is farthest from where it should be.
    fn change_set(&mut self, is_one: bool) -> bool {
        let n = self.count.min(self.most);
        let (mut worst_m, mut worst) = (0.0, None);
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let wrong_m = if self.is_in[i] {
                -self.forces_n[i] * row[i]
            } else {
                -1e-10 - self.free_m[i] - dot(row, &self.forces_n[..n])
            };
            let is_wrong = wrong_m > 0.0 || (self.is_in[i] && self.forces_n[i] <= 0.0);
            if is_wrong && (worst.is_none() || wrong_m > worst_m) {
                (worst_m, worst) = (wrong_m, Some(i));
            }
            if is_wrong && !is_one {
                self.is_in[i] = !self.is_in[i];
            }
        }
        if let Some(i) = worst.filter(|_| is_one) {
            self.is_in[i] = !self.is_in[i];
        }
        worst.is_some()
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
                    if left.is_nan() || left <= 0.0 {
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

/// In eight sums side by side.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, b8) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a8.0.iter().zip(b8.0) {
        for n in 0..8 {
            sums[n] += a[n] * b[n];
        }
    }
    let whole = 8 * a8.0.len().min(b8.0.len());
    let rest: f64 = a[whole..].iter().zip(&b[whole..]).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}
