//! A small motion of the body as a whole, on what surrounds it.

use super::PackedField;
use crate::scene::Lattice;
use bytemuck::{Pod, Zeroable};
use nalgebra::{Matrix3, Vector3};

/// Displacement `shift + turn x place` of every place of the scene frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BodyShift {
    /// Of the origin of the scene frame, m.
    pub shift_m: [f64; 3],
    /// Rotation vector, rad; small.
    pub turn_rad: [f64; 3],
}

impl BodyShift {
    /// The motion as a whole that is nearest to a field, by least squares over the elements; at rest for a body too thin to turn.
    pub fn of_field(lattice: &Lattice, field: &PackedField) -> Self {
        let elements = 0..lattice.element_count() as u32;
        let count = elements.len().max(1) as f64;
        let place = |element: u32| Vector3::from(lattice.rest_m(element));
        let moved = |element: u32| Vector3::from(field.at(element).map(f64::from));
        let middle = elements.clone().map(place).sum::<Vector3<f64>>() / count;
        let mean = elements.clone().map(moved).sum::<Vector3<f64>>() / count;
        let (mut inertia, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        for element in elements {
            let r = place(element) - middle;
            inertia += Matrix3::identity() * r.norm_squared() - r * r.transpose();
            moment += r.cross(&moved(element));
        }
        let turn = inertia
            .try_inverse()
            .map_or(Vector3::zeros(), |inverse| inverse * moment);
        Self {
            shift_m: (mean - turn.cross(&middle)).into(),
            turn_rad: turn.into(),
        }
    }

    /// The sum of factor times motion; what has no factor counts as 0.
    pub fn sum(motions: &[BodyShift], factors: &[f64]) -> Self {
        let mut sum = Self::default();
        for (motion, factor) in motions.iter().zip(factors) {
            for axis in 0..3 {
                sum.shift_m[axis] += factor * motion.shift_m[axis];
                sum.turn_rad[axis] += factor * motion.turn_rad[axis];
            }
        }
        sum
    }

    /// Displacement of a place, m.
    pub fn at_m(&self, place_m: [f64; 3]) -> [f64; 3] {
        let turned = Vector3::from(self.turn_rad).cross(&Vector3::from(place_m));
        [0, 1, 2].map(|a| self.shift_m[a] + turned[a])
    }

    /// No place of the body is displaced farther, m.
    pub fn largest_m(&self, lattice: &Lattice) -> f64 {
        let (low, high) = lattice.bounds_m();
        let corner = |n: usize| [0, 1, 2].map(|a| if n >> a & 1 == 1 { high[a] } else { low[a] });
        let sizes = (0..8).map(|n| Vector3::from(self.at_m(corner(n))).norm());
        sizes.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::tissue::ElementField;

    /// What is added to a motion as a whole and has no part of it changes nothing.
    #[test]
    fn the_motion_as_a_whole_is_found_again_in_a_field() {
        let scene = Scene::builtin("paper").unwrap();
        let lattice = &scene.lattice;
        let motion = BodyShift {
            shift_m: [1e-3, -2e-3, 5e-4],
            turn_rad: [0.02, 0.01, -0.03],
        };
        let middle = lattice.bounds_m();
        let middle: [f64; 3] = std::array::from_fn(|a| 0.5 * (middle.0[a] + middle.1[a]));
        let mut field = ElementField::zeros(lattice.element_count());
        for element in 0..lattice.element_count() as u32 {
            let place_m = lattice.rest_m(element);
            let u = motion.at_m(place_m);
            // Stretched along x about its middle: no motion as a whole in a body that is symmetric to it.
            let stretch = [0.05 * (place_m[0] - middle[0]), 0.0, 0.0];
            for ((slot, u), stretch) in field.0.iter_mut().zip(u).zip(stretch) {
                slot[element as usize] = (u + stretch) as f32;
            }
        }
        let mut packed = PackedField::zeros(lattice.element_count());
        packed.pack(&field);
        let found = BodyShift::of_field(lattice, &packed);
        for n in 0..8 {
            let place_m = [0, 1, 2].map(|a| middle[a] + if n >> a & 1 == 1 { 0.02 } else { -0.02 });
            let off = Vector3::from(found.at_m(place_m)) - Vector3::from(motion.at_m(place_m));
            assert!(off.norm() < 2e-6, "{off:?}");
        }
        let doubled = BodyShift::sum(&[found, found, found], &[1.0, 1.0]);
        let [a, b] = [&doubled, &found].map(|m| m.at_m(middle)[1]);
        assert!((a - 2.0 * b).abs() < 1e-12);
        assert!(found.largest_m(lattice) >= Vector3::from(found.at_m(middle)).norm());
    }
}
