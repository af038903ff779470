//! Forces that only push: `gap = q + A p`, `gap >= 0`, `p >= 0`, `gap p = 0`.
//!
//! By active sets: which points are in contact says the forces, the forces and gaps say which points are in contact.
//! Sets that do not settle are left for a way downhill, on which forces push at each step: what a wrong set says may be
//! a thousand times too much.

/// Rounds of active sets, at most.
const ROUNDS: usize = 6;
/// Legs of the way downhill, at most, and sweeps in each.
const LEGS: usize = 6;
const SWEEPS: usize = 8;
/// Depth of a gap up to which it counts as closed, m.
const CLOSED_M: f64 = 1e-10;
/// Addition to the diagonal, over its mean: pads share nodes of a coarse body.
const RIDGE: f64 = 1e-5;

/// Room for the largest problem; nothing is allocated after that.
#[derive(Clone, Debug)]
pub struct Problem {
    most: usize,
    /// Number of unknowns now.
    pub count: usize,
    /// `A`, row after row of `count`.
    pub matrix: Vec<f64>,
    /// `q`, m.
    pub free_m: Vec<f64>,
    /// `p`, N: the first guess, then the answer.
    pub forces_n: Vec<f64>,
    /// The first guess, on the way downhill the forces before a step.
    before_n: Vec<f64>,
    /// Numbers of those in contact, of which the factor is.
    pub set: Vec<u32>,
    factor: Vec<f64>,
    is_factored: bool,
    /// Room for one number a pad.
    pub work: Vec<f64>,
    is_in: Vec<bool>,
    /// Rounds that the last solve took.
    pub rounds: usize,
}

impl Problem {
    /// Makes room for at most so many pads.
    pub fn with_room(most: usize) -> Self {
        Problem {
            most,
            count: 0,
            matrix: vec![0.0; most * most],
            free_m: vec![0.0; most],
            forces_n: vec![0.0; most],
            before_n: vec![0.0; most],
            set: Vec::with_capacity(most),
            is_factored: false,
            factor: vec![0.0; most * most],
            work: vec![0.0; most],
            is_in: vec![false; most],
            rounds: 0,
        }
    }

    /// Marks the matrix as changed.
    pub fn is_new(&mut self) {
        self.is_factored = false;
    }

    /// Finds the forces from a guess.
    pub fn solve(&mut self) {
        let n = self.count.min(self.most);
        self.before_n[..n].copy_from_slice(&self.forces_n[..n]);
        self.rounds = 0;
        self.take_set();
        while self.rounds < ROUNDS {
            self.rounds += 1;
            if !self.solve_set() {
                break;
            }
            if !self.change_set() {
                return;
            }
        }
        self.forces_n[..n].copy_from_slice(&self.before_n[..n]);
        self.go_downhill();
    }

    /// Takes the pushing points as those in contact.
    fn take_set(&mut self) {
        let n = self.count.min(self.most);
        for (is_in, force_n) in self.is_in.iter_mut().zip(&self.forces_n[..n]) {
            *is_in = *force_n > 0.0;
        }
    }

    /// Finds the forces that close the gaps of the set while the others are 0; returns false where the matrix has no
    /// factor.
    fn solve_set(&mut self) -> bool {
        let n = self.count.min(self.most);
        let is_in = &self.is_in[..n];
        let is_same = self
            .set
            .iter()
            .all(|&i| is_in.get(i as usize).is_some_and(|is_in| *is_in))
            && is_in.iter().filter(|is_in| **is_in).count() == self.set.len();
        if !is_same || !self.is_factored {
            self.set.clear();
            self.set.extend((0..n as u32).filter(|&i| is_in[i as usize]));
            self.is_factored = self.decompose();
        }
        if !self.is_factored {
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

    /// Takes those that pull out of the set, and those that overlap into it; whether there were any.
    fn change_set(&mut self) -> bool {
        let n = self.count.min(self.most);
        let mut any = false;
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let is_wrong = match self.is_in[i] {
                true => self.forces_n[i] <= 0.0,
                false => self.free_m[i] + dot(row, &self.forces_n[..n]) < -CLOSED_M,
            };
            if is_wrong {
                self.is_in[i] = !self.is_in[i];
                any = true;
            }
        }
        any
    }

    /// Sweeps of projected Gauss-Seidel say who pushes, and the forces go towards those of that set until the first of
    /// them would pull. The energy falls with each step.
    fn go_downhill(&mut self) {
        let n = self.count.min(self.most);
        for _ in 0..LEGS {
            self.rounds += 1;
            for _ in 0..SWEEPS {
                self.sweep();
            }
            self.before_n[..n].copy_from_slice(&self.forces_n[..n]);
            self.take_set();
            if !self.solve_set() {
                self.forces_n[..n].copy_from_slice(&self.before_n[..n]);
                return;
            }
            let mut part = 1.0_f64;
            for (before, after) in self.before_n[..n].iter().zip(&self.forces_n) {
                if *after < 0.0 {
                    part = part.min(before / (before - after));
                }
            }
            for (before, after) in self.before_n[..n].iter().zip(&mut self.forces_n) {
                *after = (before + part * (*after - before)).max(0.0);
            }
            if part == 1.0 && !self.change_set() {
                return;
            }
        }
    }

    fn sweep(&mut self) {
        let n = self.count.min(self.most);
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let gap_m = self.free_m[i] + dot(row, &self.forces_n[..n]);
            self.forces_n[i] = (self.forces_n[i] - gap_m / row[i]).max(0.0);
        }
    }

    /// Returns how far the forces close the gap of pad `i`, m.
    pub fn closes_m(&self, i: usize) -> f64 {
        let n = self.count.min(self.most);
        dot(&self.matrix[i * n..(i + 1) * n], &self.forces_n[..n])
    }

    /// Factors the rows and columns of the set by Cholesky.
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

/// Solves `L L' x = b` in place; rows of `factor` are as long as `values`.
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

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    crate::simd::dot::<8>(a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 40;

    /// Returns points along a line, each of which moves those beside it nearly as much as itself: sets of such problems
    /// cycle.
    fn problem(turn: u32) -> Problem {
        let mut problem = Problem::with_room(N);
        problem.count = N;
        let mut random = stylet_random::Random(u64::from(turn));
        for i in 0..N {
            for j in 0..N {
                let apart = (i as f64 - j as f64) / 6.0;
                problem.matrix[i * N + j] = 1e-3 * (-apart * apart).exp();
            }
            problem.matrix[i * N + i] *= 1.0 + 1e-4;
            problem.free_m[i] = 1e-3 * random.signed();
        }
        problem
    }

    fn energy_j(problem: &Problem) -> f64 {
        let p = &problem.forces_n;
        (0..N)
            .map(|i| p[i] * (0.5 * problem.closes_m(i) + problem.free_m[i]))
            .sum()
    }

    /// Solves by brute force.
    fn swept(turn: u32) -> Problem {
        let mut problem = problem(turn);
        (0..200_000).for_each(|_| problem.sweep());
        problem
    }

    #[test]
    fn forces_are_those_of_many_sweeps_whichever_way_they_are_found() {
        let mut downhill = 0;
        for turn in 0..8 {
            let wanted = swept(turn);
            let mut found = problem(turn);
            found.solve();
            downhill += usize::from(found.rounds > ROUNDS);
            let off = wanted.forces_n.iter().zip(&found.forces_n).map(|(a, b)| (a - b).abs());
            let largest = wanted.forces_n.iter().fold(0.0_f64, |m, f| m.max(*f));
            let off = off.fold(0.0, f64::max);
            // The ridge in the factor, a tenth of the smallest eigenvalue, is not in the sweeps.
            assert!(off < 1e-3 * largest, "{turn}: {off} of {largest}");
            let worse = energy_j(&found) / energy_j(&wanted) - 1.0;
            assert!(worse.abs() < 1e-8, "{turn}: {worse}");
        }
        assert!(downhill > 0, "none of the sets went round");
    }

    #[test]
    fn what_is_left_early_pushes_and_is_nearer_than_the_guess() {
        for turn in 0..20 {
            let mut problem = problem(turn);
            for i in 0..N {
                problem.forces_n[i] = f64::from(turn) * 0.1 * ((i * i) as f64).sin().max(0.0);
            }
            let before_j = energy_j(&problem);
            problem.go_downhill();
            assert!(problem.forces_n.iter().all(|f| *f >= 0.0));
            assert!(energy_j(&problem) < before_j, "{turn}");
        }
    }
}
