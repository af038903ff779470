//! Assembly of the compliance of all needles that stay in, and its coupling with the moving one.

use super::{LeftNeedle, LeftNeedles};
use crate::line::cross::Cross;
use crate::line::model::MAX_STATIONS;
use crate::line::ready::HandLine;
use crate::line::rows::{Rows, add_scaled};
use crate::simd::{Simd, vectorised};

/// Coupling of two lines, from either side.
#[derive(Clone, Copy)]
pub(super) struct PairCoupling<'a> {
    cross: &'a Cross,
    is_turned: bool,
}

/// Finds the coupling of two lines; `None` where neither knows the other.
pub(super) fn pair_coupling<'a>(a: &'a HandLine, b: &'a HandLine) -> Option<PairCoupling<'a>> {
    let rows = [a, b].map(|line| 2 * line.model.compliance.stations);
    let found = |of: &'a HandLine, with: &HandLine, is_turned: bool| {
        let cross = of.beside.iter().find(|cross| cross.with == with.generation)?;
        let wanted = if is_turned { [rows[1], rows[0]] } else { rows };
        (cross.rows() == wanted).then_some(PairCoupling { cross, is_turned })
    };
    found(a, b, false).or_else(|| found(b, a, true))
}

impl PairCoupling<'_> {
    fn at(&self, a: usize, b: usize) -> f64 {
        if self.is_turned {
            self.cross.at(b, a)
        } else {
            self.cross.at(a, b)
        }
    }
}

impl LeftNeedle {
    /// Returns what its tip and an element lack of moving each other.
    fn near_m_per_n(&self, element: usize) -> f64 {
        let (c, tip_m) = (&self.line.model.compliance, self.line.state.tip.material_m);
        let missing = self.line.tip_missing_m_per_n();
        if element == self.stations {
            return missing;
        }
        let is_near = c.near.stations(tip_m, c.spacing_m, self.stations).contains(&element);
        if is_near {
            c.near_m_per_n(missing, tip_m, element, tip_m)
        } else {
            0.0
        }
    }

    /// Returns the rows of its line that an element loads, each with its share.
    pub(super) fn rows(&self, element: usize) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let state = &self.line.state;
        let m = self.line.model.compliance.stations;
        let is_tip = element == self.stations;
        let tip = state.tip_range.clone().zip(&state.tip_weights);
        let tip = tip.filter(move |_| is_tip).map(move |(n, weight)| (m + n, *weight));
        (!is_tip).then_some((element, 1.0)).into_iter().chain(tip)
    }
}

impl LeftNeedles {
    /// Assembles every matrix again after a needle was left or taken, or another moves beside them.
    pub(super) fn assemble(&mut self, moving: Option<&HandLine>) {
        let last = self.needles.last();
        self.count = last.map_or(0, |needle| needle.first + needle.stations + 1);
        self.stride = self.count.next_multiple_of(8);
        self.own[..self.count * self.stride].fill(0.0);
        for (n, a) in self.needles.iter().enumerate() {
            for b in &self.needles[n..] {
                let joined = pair_coupling(&a.line, &b.line);
                let is_same = std::ptr::eq(a, b);
                let rows = &a.line.model.compliance;
                for i in 0..=a.stations {
                    for j in 0..=b.stations {
                        let pairs = a.rows(i).flat_map(|(p, w)| b.rows(j).map(move |(q, v)| (p, q, w * v)));
                        let missing = if is_same && j == a.stations {
                            a.near_m_per_n(i)
                        } else {
                            0.0
                        };
                        let entry: f64 = pairs
                            .map(|(p, q, w)| {
                                w * if is_same {
                                    rows.at(p, q)
                                } else {
                                    joined.map_or(0.0, |joined| joined.at(p, q))
                                }
                            })
                            .sum::<f64>()
                            + missing;
                        self.own[(a.first + i) * self.stride + b.first + j] = entry;
                        self.own[(b.first + j) * self.stride + a.first + i] = entry;
                    }
                }
            }
        }
        self.invert();
        self.join(moving);
        self.limit();
    }

    fn invert(&mut self) {
        let count = self.count;
        if !self.inverse.begin(count) {
            return;
        }
        for k in 0..count {
            let own = &self.own[k * self.stride..k * self.stride + count];
            self.inverse.row_mut(k)[..count].copy_from_slice(own);
        }
        if !invert(self.simd, &mut self.inverse, &mut self.pivot) {
            self.inverse.begin(0);
        }
    }

    fn join(&mut self, moving: Option<&HandLine>) {
        self.moving = moving.map_or(0, |line| line.generation);
        self.moving_rows = moving.map_or(0, |line| 2 * line.model.compliance.stations);
        self.added_m.fill(0.0);
        let Some(moving) = moving else { return };
        let stations = moving.model.compliance.stations;
        let elements = self.count;
        if !self.all.begin(elements + stations) {
            return;
        }
        for k in 0..elements {
            let own = &self.own[k * self.stride..k * self.stride + elements];
            self.all.row_mut(k)[..elements].copy_from_slice(own);
        }
        for n in 0..stations {
            let row = &moving.model.compliance.rows.row(n)[..stations];
            self.all.row_mut(elements + n)[elements..elements + stations].copy_from_slice(row);
        }
        for needle in &self.needles {
            let Some(joined) = pair_coupling(&needle.line, moving) else {
                continue;
            };
            for i in 0..=needle.stations {
                let k = needle.first + i;
                self.whole[k] = joined.cross.whole_m_per_n;
                for row in 0..self.moving_rows {
                    let entry: f64 = needle.rows(i).map(|(p, w)| w * joined.at(p, row)).sum();
                    self.to_moving[k * 2 * MAX_STATIONS + row] = entry;
                    self.from_moving[row * self.stride + k] = entry;
                    if row < stations {
                        self.all.row_mut(k)[elements + row] = entry;
                        self.all.row_mut(elements + row)[k] = entry;
                    }
                }
            }
        }
    }
}

vectorised! {
    /// Inverts a symmetric, positive definite matrix in place by elimination; returns false, with nothing to be used,
    /// where it is none.
    fn invert(rows: &mut Rows, pivot: &mut [f64]) -> bool {
        let size = rows.size();
        let pivot = &mut pivot[..size];
        for k in 0..size {
            pivot.copy_from_slice(&rows.row(k)[..size]);
            if !(pivot[k] > 0.0 && pivot[k].is_finite()) {
                return false;
            }
            let by = 1.0 / pivot[k];
            pivot.iter_mut().for_each(|entry| *entry *= by);
            pivot[k] = by;
            for i in 0..size {
                let row = &mut rows.row_mut(i)[..size];
                if i == k {
                    row.copy_from_slice(pivot);
                    continue;
                }
                let factor = std::mem::take(&mut row[k]);
                add_scaled(-factor, pivot, row);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_is_one_and_what_has_none_is_seen() {
        let size = 37;
        let entry = |i: usize, j: usize| (-(i.abs_diff(j) as f64) / 5.0).exp() + if i == j { 3.0 } else { 0.7 };
        let matrix = Rows::new(size, entry);
        let mut pivot = vec![0.0; size];
        for simd in Simd::all() {
            let mut inverse = matrix.clone();
            assert!(invert(simd, &mut inverse, &mut pivot));
            for i in 0..size {
                for j in 0..size {
                    let one: f64 = (0..size).map(|k| matrix.row(i)[k] * inverse.row(k)[j]).sum();
                    let wanted = if i == j { 1.0 } else { 0.0 };
                    assert!((one - wanted).abs() < 1e-12, "{i} {j}: {one}");
                }
            }
        }
        let mut indefinite = Rows::new(4, |i, j| if i == j { 1.0 } else { 2.0 });
        assert!(!invert(Simd::detect(), &mut indefinite, &mut pivot));
    }
}
