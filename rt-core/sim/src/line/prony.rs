//! Creep: the displacement of tissue under a constant load grows with time.
//!
//! Creep in the form of a Kelvin chain on the stations: `u = W (f + sum J_i q_i)`, `time_i dq_i/dt = f - q_i`. A load
//! held for ever moves its place by `1 + sum J_i` times what it does at once; a displacement that is held relaxes from
//! 1 to `1 / (1 + sum J_i)` of its force. All of the body relaxes alike, what surrounds it included. Each step is
//! implicit, so each element of the chain stores or dissipates and none makes energy.

use super::rows::{Rows, dot};
use serde::{Deserialize, Serialize};

/// One element of the chain; a strength of 0 is off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PronyTerm {
    /// J: displacement that is added in time, over that at once.
    pub strength: f64,
    /// Time constant of the creep under a constant load.
    pub time_s: f64,
}

impl Default for PronyTerm {
    fn default() -> Self {
        PronyTerm {
            strength: 0.0,
            time_s: 1.0,
        }
    }
}

/// The past loads that the tissue remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    /// q of each term, in newtons.
    loads_n: [Vec<f64>; 2],
    /// Displacement of each row by q of each term, over its strength.
    moved_m: [Vec<f64>; 2],
    /// q of what a membrane passes on to the body as a whole.
    whole_n: [f64; 2],
    /// Displacement of each row by what the past leaves.
    pub offset_m: Vec<f64>,
    /// Part of that which displaces the body as a whole.
    pub whole_offset_m: f64,
    sum: Vec<f64>,
    whole_sum_n: f64,
    /// Displacement at once and within the tick, over that at once.
    pub gain: f64,
    /// Energy that the chain held before this tick, J.
    pub held_j: f64,
    parts: [f64; 2],
    is_on: bool,
}

impl Memory {
    pub fn new(rows: usize) -> Self {
        let zeros = || vec![0.0; rows];
        Memory {
            loads_n: [zeros(), zeros()],
            moved_m: [zeros(), zeros()],
            whole_n: [0.0; 2],
            offset_m: zeros(),
            whole_offset_m: 0.0,
            sum: zeros(),
            whole_sum_n: 0.0,
            gain: 1.0,
            held_j: 0.0,
            parts: [0.0; 2],
            is_on: false,
        }
    }

    /// Forgets every load; does not allocate.
    pub fn reset(&mut self) {
        self.vectors_mut().into_iter().for_each(|field| field.fill(0.0));
        self.whole_n = [0.0; 2];
        (self.whole_offset_m, self.whole_sum_n, self.held_j) = (0.0, 0.0, 0.0);
        self.gain = 1.0;
        self.parts = [0.0; 2];
        self.is_on = false;
    }

    /// Keeps what `from` holds; does not allocate where there is room for as many rows. Names every field, so that a
    /// new one is not forgotten.
    pub fn copy_from(&mut self, from: &Memory) {
        let Memory {
            loads_n,
            moved_m,
            whole_n,
            offset_m,
            whole_offset_m,
            sum,
            whole_sum_n,
            gain,
            held_j,
            parts,
            is_on,
        } = from;
        for (to, from) in self.loads_n.iter_mut().zip(loads_n) {
            to.clone_from(from);
        }
        for (to, from) in self.moved_m.iter_mut().zip(moved_m) {
            to.clone_from(from);
        }
        self.whole_n = *whole_n;
        self.offset_m.clone_from(offset_m);
        self.whole_offset_m = *whole_offset_m;
        self.sum.clone_from(sum);
        self.whole_sum_n = *whole_sum_n;
        self.gain = *gain;
        self.held_j = *held_j;
        self.parts = *parts;
        self.is_on = *is_on;
    }

    /// Returns all of its vectors.
    pub fn vectors_mut(&mut self) -> [&mut Vec<f64>; 6] {
        let ([first, second], [third, fourth]) = (&mut self.loads_n, &mut self.moved_m);
        [first, second, third, fourth, &mut self.offset_m, &mut self.sum]
    }

    /// Returns whether it has that many rows.
    pub fn fits(&self, rows: usize) -> bool {
        let ([first, second], [third, fourth]) = (&self.loads_n, &self.moved_m);
        [first, second, third, fourth, &self.offset_m, &self.sum]
            .iter()
            .all(|v| v.len() == rows)
    }

    /// Begins a tick before its loads are known. `common_m_per_n` is the displacement of the body as a whole by a
    /// newton. A chain that is turned off forgets its loads.
    pub fn begin(&mut self, rows: &Rows, common_m_per_n: f64, terms: &[PronyTerm; 2], dt_s: f64) {
        if !terms.iter().any(|t| t.strength > 0.0) {
            if self.is_on {
                self.reset();
            }
            return;
        }
        self.is_on = true;
        self.parts = terms.map(|t| dt_s / (t.time_s + dt_s));
        self.gain = 1.0
            + terms
                .iter()
                .zip(self.parts)
                .map(|(t, part)| t.strength * part)
                .sum::<f64>();
        self.sum.fill(0.0);
        self.offset_m.fill(0.0);
        (self.whole_sum_n, self.whole_offset_m, self.held_j) = (0.0, 0.0, 0.0);
        for (number, (term, part)) in terms.iter().zip(self.parts).enumerate() {
            if term.strength > 0.0 {
                self.add_term(rows, common_m_per_n, number, (term.strength, part));
            }
        }
        self.whole_offset_m += common_m_per_n * (self.sum.iter().sum::<f64>() + self.whole_sum_n);
        let by_whole_m = common_m_per_n * self.whole_sum_n;
        self.offset_m.iter_mut().for_each(|offset| *offset += by_whole_m);
    }

    fn add_term(&mut self, rows: &Rows, common_m_per_n: f64, number: usize, (strength, part): (f64, f64)) {
        let left = strength * (1.0 - part);
        let (q, moved_m) = (&self.loads_n[number], &mut self.moved_m[number]);
        let mut work_j = 0.0;
        for (n, moved) in moved_m.iter_mut().enumerate() {
            *moved = dot(rows.row(n), q);
            work_j += q[n] * *moved;
            self.offset_m[n] += left * *moved;
            self.sum[n] += left * q[n];
        }
        let whole_n = self.whole_n[number];
        let load_n: f64 = q.iter().sum();
        work_j += common_m_per_n * whole_n * (whole_n + 2.0 * load_n);
        self.held_j += 0.5 * strength * work_j;
        self.whole_sum_n += left * whole_n;
    }

    /// Takes in the loads of this tick, and makes them those under which the tissue without memory would be where it
    /// is. So for what a membrane passes on to the body as a whole, which is returned.
    pub fn finish(&mut self, loads_n: &mut [f64], whole_n: f64) -> f64 {
        if !self.is_on {
            return whole_n;
        }
        for ((q, of_whole), part) in self.loads_n.iter_mut().zip(&mut self.whole_n).zip(self.parts) {
            q.iter_mut().zip(&*loads_n).for_each(|(q, f)| *q += part * (f - *q));
            *of_whole += part * (whole_n - *of_whole);
        }
        for (f, sum) in loads_n.iter_mut().zip(&self.sum) {
            *f = self.gain * *f + sum;
        }
        self.gain * whole_n + self.whole_sum_n
    }

    /// Returns whether the tissue creeps.
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Returns the energy in the springs of the chain, J.
    pub fn stored_j(&self, rows: &Rows, common_m_per_n: f64, terms: &[PronyTerm; 2]) -> f64 {
        let each = |((term, q), whole_n): ((&PronyTerm, &Vec<f64>), &f64)| {
            let work = |(n, f): (usize, &f64)| f * dot(rows.row(n), q);
            let load_n: f64 = q.iter().sum();
            let by_whole = common_m_per_n * whole_n * (whole_n + 2.0 * load_n);
            0.5 * term.strength * (q.iter().enumerate().map(work).sum::<f64>() + by_whole)
        };
        terms.iter().zip(&self.loads_n).zip(&self.whole_n).map(each).sum()
    }
}

#[cfg(test)]
mod tests;
