//! Force over time: tissue that goes on giving way under a constant load.
//!
//! Creep in the form of a Kelvin chain on the stations: `u = W (f + sum J_i q_i)`, `time_i dq_i/dt = f - q_i`. A load held for ever
//! moves its place by `1 + sum J_i` times what it does at once; a displacement that is held relaxes from 1 to
//! `1 / (1 + sum J_i)` of its force. All of the body relaxes alike, what surrounds it included. Each step is implicit, so each
//! element of the chain stores or dissipates and none makes energy.

use super::rows::{Rows, dot};
use serde::{Deserialize, Serialize};

/// One element of the chain; a strength of 0 is off.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Displacement of each row by what the past leaves.
    pub offset_m: Vec<f64>,
    sum: Vec<f64>,
    /// Displacement at once and within the tick, over that at once.
    pub gain: f64,
    parts: [f64; 2],
    is_on: bool,
}

impl Memory {
    pub fn new(rows: usize) -> Self {
        let zeros = || vec![0.0; rows];
        Memory {
            loads_n: [zeros(), zeros()],
            offset_m: zeros(),
            sum: zeros(),
            gain: 1.0,
            parts: [0.0; 2],
            is_on: false,
        }
    }

    /// Forgets every load; does not allocate.
    pub fn reset(&mut self) {
        for field in self.loads_n.iter_mut().chain([&mut self.offset_m, &mut self.sum]) {
            field.fill(0.0);
        }
        self.gain = 1.0;
        self.parts = [0.0; 2];
        self.is_on = false;
    }

    /// Keeps what `from` holds; does not allocate where there is room for as many rows.
    pub fn copy_from(&mut self, from: &Memory) {
        let [first, second] = &mut self.loads_n;
        first.clone_from(&from.loads_n[0]);
        second.clone_from(&from.loads_n[1]);
        self.offset_m.clone_from(&from.offset_m);
        self.sum.clone_from(&from.sum);
        self.gain = from.gain;
        self.parts = from.parts;
        self.is_on = from.is_on;
    }

    /// Every vector of it.
    pub fn vectors_mut(&mut self) -> [&mut Vec<f64>; 4] {
        let [first, second] = &mut self.loads_n;
        [first, second, &mut self.offset_m, &mut self.sum]
    }

    /// Whether it is of that many rows.
    pub fn fits(&self, rows: usize) -> bool {
        let [first, second] = &self.loads_n;
        [first, second, &self.offset_m, &self.sum]
            .iter()
            .all(|v| v.len() == rows)
    }

    /// What is known of this tick before its loads are.
    pub fn begin(&mut self, rows: &Rows, terms: &[PronyTerm; 2], dt_s: f64) {
        self.is_on = terms.iter().any(|t| t.strength > 0.0);
        if !self.is_on {
            return;
        }
        self.parts = terms.map(|t| dt_s / (t.time_s + dt_s));
        self.gain = 1.0
            + terms
                .iter()
                .zip(self.parts)
                .map(|(t, part)| t.strength * part)
                .sum::<f64>();
        self.sum.fill(0.0);
        for ((term, part), q) in terms.iter().zip(self.parts).zip(&self.loads_n) {
            let left = term.strength * (1.0 - part);
            self.sum.iter_mut().zip(q).for_each(|(sum, q)| *sum += left * q);
        }
        for (n, offset) in self.offset_m.iter_mut().enumerate() {
            *offset = dot(rows.row(n), &self.sum);
        }
    }

    /// Takes in the loads of this tick, and makes them those under which the tissue without memory would be where it is.
    pub fn finish(&mut self, loads_n: &mut [f64]) {
        if !self.is_on {
            return;
        }
        for (q, part) in self.loads_n.iter_mut().zip(self.parts) {
            q.iter_mut().zip(&*loads_n).for_each(|(q, f)| *q += part * (f - *q));
        }
        for (f, sum) in loads_n.iter_mut().zip(&self.sum) {
            *f = self.gain * *f + sum;
        }
    }

    /// In the springs of the chain.
    pub fn stored_j(&self, rows: &Rows, terms: &[PronyTerm; 2]) -> f64 {
        let each = |(term, q): (&PronyTerm, &Vec<f64>)| {
            let work = |(n, f): (usize, &f64)| f * dot(rows.row(n), q);
            0.5 * term.strength * q.iter().enumerate().map(work).sum::<f64>()
        };
        terms.iter().zip(&self.loads_n).map(each).sum()
    }
}

#[cfg(test)]
mod tests;
