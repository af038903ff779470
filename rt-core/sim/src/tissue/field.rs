//! Displacement of every element: a model's answer to a force.

use crate::simd::{Simd, vectorised};
use serde::{Deserialize, Serialize};

/// Displacement of every element's centre, along x, y, z: per newton, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementField(pub [Vec<f32>; 3]);

impl ElementField {
    /// Makes zeros for that many elements, every page of which was written to.
    pub fn with_room(elements: usize) -> Self {
        ElementField(std::array::from_fn(|_| {
            let mut axis = vec![1.0; elements];
            axis.fill(0.0);
            axis
        }))
    }

    /// Becomes the sum of answers times loads, m. Does not allocate.
    pub fn load(&mut self, columns: &[PackedField], loads_n: &[f64]) {
        add_up(Simd::detect(), columns, loads_n, 1.0, &mut self.0);
    }

    /// Loads one of several parts of that, in any order. Does not allocate.
    pub fn load_part(&mut self, columns: &[PackedField], loads_n: &[f64], part: [usize; 2]) {
        add_up_part(Simd::detect(), (columns, loads_n), 1.0, &mut self.0, part);
    }

    /// Makes zeros for that many elements.
    pub fn zeros(elements: usize) -> Self {
        ElementField(std::array::from_fn(|_| vec![0.0; elements]))
    }
}

/// The same in half of the memory, which is what adding up many of them waits for: in steps of 1 / 32,767 of the
/// largest displacement in it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PackedField {
    step_m: f32,
    steps: [Vec<i16>; 3],
}

impl PackedField {
    /// Makes zeros for that many elements.
    pub fn zeros(elements: usize) -> Self {
        PackedField {
            step_m: 0.0,
            steps: std::array::from_fn(|_| vec![0; elements]),
        }
    }

    /// Packs a field of as many elements; values that are not finite count as zero. Does not allocate.
    pub fn pack(&mut self, field: &ElementField) {
        let simd = Simd::detect();
        let largest = field.0.iter().map(|u| largest(simd, u)).fold(0.0, f32::max);
        self.step_m = largest / f32::from(i16::MAX);
        let steps_per_m = if self.step_m > 0.0 { 1.0 / self.step_m } else { 0.0 };
        for (steps, u) in self.steps.iter_mut().zip(&field.0) {
            to_steps(simd, steps_per_m, u, steps);
        }
    }

    /// Returns the displacement of an element, m/N; zero for a number past the end.
    pub fn at(&self, element: u32) -> [f32; 3] {
        let steps = |axis: &Vec<i16>| axis.get(element as usize).copied().map_or(0.0, f32::from);
        self.steps.each_ref().map(|axis| steps(axis) * self.step_m)
    }

    /// Returns whether every displacement has the same bits.
    pub fn is_identical(&self, other: &PackedField) -> bool {
        self.step_m.to_bits() == other.step_m.to_bits() && self.steps == other.steps
    }

    /// Returns the number of elements.
    pub fn elements(&self) -> usize {
        self.steps[0].len()
    }

    /// Returns whether it has as many along each axis, in steps of a finite size.
    pub fn is_sound(&self) -> bool {
        self.steps.iter().all(|axis| axis.len() == self.elements()) && self.step_m.is_finite()
    }

    /// Returns the size of the displacements, in bytes.
    pub fn bytes(&self) -> usize {
        self.steps.iter().map(|axis| axis.len() * size_of::<i16>()).sum()
    }
}

vectorised! {
    /// Returns the largest size among the numbers that are finite.
    fn largest(u: &[f32]) -> f32 {
        const TOGETHER: usize = 16;
        let mut largest = [0.0_f32; TOGETHER];
        let (blocks, rest) = u.as_chunks::<TOGETHER>();
        let rest = rest.iter().map(|u| [*u; TOGETHER]);
        for block in blocks.iter().copied().chain(rest) {
            for n in 0..TOGETHER {
                let size = block[n].abs();
                largest[n] = if size > largest[n] && size < f32::INFINITY { size } else { largest[n] };
            }
        }
        largest.into_iter().fold(0.0, f32::max)
    }
}

vectorised! {
    fn to_steps(steps_per_m: f32, u: &[f32], steps: &mut [i16]) {
        for (steps, u) in steps.iter_mut().zip(u) {
            // A cast of a float saturates, and takes NaN for 0.
            *steps = (u * steps_per_m).round() as i16;
        }
    }
}

/// Number of elements that are added up at once: their sum stays in the first cache.
const BLOCK: usize = 2048;

/// Replaces `sum` by the sum of factor times field for each factor other than zero.
pub(crate) fn add_up(simd: Simd, fields: &[PackedField], factors: &[f64], scale: f64, sum: &mut [Vec<f32>; 3]) {
    add_up_part(simd, (fields, factors), scale, sum, [0, 1]);
}

/// Adds up the blocks of one of so many parts.
fn add_up_part(
    simd: Simd,
    (fields, factors): (&[PackedField], &[f64]),
    scale: f64,
    sum: &mut [Vec<f32>; 3],
    [part, of]: [usize; 2],
) {
    for (axis, sum) in sum.iter_mut().enumerate() {
        let blocks = sum.chunks_mut(BLOCK).enumerate();
        for (block, sum) in blocks.skip(part).step_by(of.max(1)) {
            sum.fill(0.0);
            let (mut waiting, mut count) = ([(0.0, &[][..]); 4], 0);
            for (field, &factor) in fields.iter().zip(factors).filter(|(_, factor)| **factor != 0.0) {
                let from = (block * BLOCK).min(field.steps[axis].len());
                let factor = (factor * scale * f64::from(field.step_m)) as f32;
                waiting[count] = (factor, &field.steps[axis][from..]);
                count += 1;
                if count == waiting.len() {
                    add_four(
                        simd,
                        sum,
                        waiting.map(|(factor, _)| factor),
                        waiting.map(|(_, steps)| steps),
                    );
                    count = 0;
                }
            }
            for (factor, steps) in &waiting[..count] {
                add(simd, sum, *factor, steps);
            }
        }
    }
}

/// Adds other fields, m, times a scale.
pub(crate) fn add_fields(fields: &[&ElementField], scale: f32, sum: &mut [Vec<f32>; 3]) {
    for field in fields {
        for (sum, axis) in sum.iter_mut().zip(&field.0) {
            for (sum, u) in sum.iter_mut().zip(axis) {
                *sum += scale * u;
            }
        }
    }
}

vectorised! {
    fn add(sum: &mut [f32], factor: f32, steps: &[i16]) {
        for (sum, &steps) in sum.iter_mut().zip(steps) {
            *sum += factor * f32::from(steps);
        }
    }
}

vectorised! {
    /// Adds four fields as one after the other, in every bit; the sum is read and written once instead of four times.
    fn add_four(sum: &mut [f32], factors: [f32; 4], steps: [&[i16]; 4]) {
        let [a, b, c, d] = steps;
        let both = a.iter().zip(b).zip(c.iter().zip(d));
        for (sum, ((a, b), (c, d))) in sum.iter_mut().zip(both) {
            let mut added = *sum + factors[0] * f32::from(*a);
            added += factors[1] * f32::from(*b);
            added += factors[2] * f32::from(*c);
            *sum = added + factors[3] * f32::from(*d);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(elements: usize, scale: f32) -> ElementField {
        let mut field = ElementField::zeros(elements);
        for (axis, u) in field.0.iter_mut().enumerate() {
            for (n, u) in u.iter_mut().enumerate() {
                *u = scale * (n as f32 * 0.37 + axis as f32).sin();
            }
        }
        field
    }

    #[test]
    fn packed_fields_add_up_as_fields_do_to_a_part_in_30_000_of_each() {
        let elements = 2 * BLOCK + 37;
        let fields = [1e-3, 7e-4, 2e-3].map(|scale| field(elements, scale));
        let packed = fields.each_ref().map(|field| {
            let mut packed = PackedField::zeros(elements);
            packed.pack(field);
            packed
        });
        let (factors, scale) = ([2.0, 0.0, -0.5], 700.0);
        for simd in [Simd::Portable, Simd::detect()] {
            let mut sum: [Vec<f32>; 3] = std::array::from_fn(|_| vec![f32::NAN; elements]);
            add_up(simd, &packed, &factors, scale, &mut sum);
            for (axis, sum) in sum.iter().enumerate() {
                for (element, &sum) in sum.iter().enumerate() {
                    let each = fields
                        .iter()
                        .zip(factors)
                        .map(|(f, factor)| factor * f64::from(f.0[axis][element]));
                    let off = (f64::from(sum) - scale * each.sum::<f64>()).abs();
                    assert!(off < 700.0 * (2.0 * 1e-3 + 0.5 * 2e-3) / 60_000.0, "{off}");
                }
            }
        }
        assert!((packed[0].at(5)[0] - fields[0].0[0][5]).abs() < 1e-3 / 60_000.0);
    }

    #[test]
    fn a_field_of_zeros_and_one_that_is_not_finite_are_packed() {
        let mut packed = PackedField::zeros(3);
        packed.pack(&ElementField::zeros(3));
        assert_eq!(packed.at(1), [0.0; 3]);
        let mut broken = field(3, 1.0);
        broken.0[0][1] = f32::NAN;
        packed.pack(&broken);
        assert_eq!(packed.at(1)[0], 0.0);
    }
}
