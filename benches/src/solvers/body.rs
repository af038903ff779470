//! A homogeneous body: its limits, and the displacement of each element.

use std::sync::Arc;
use stylet_sim::limits::{Limits, LinkLimits};
use stylet_sim::scene::{Lattice, Scene};

/// Place of every element, and limits of its links.
pub struct Body {
    /// Elements and their neighbours.
    pub lattice: Arc<Lattice>,
    /// Displacement from rest along x, y, z, in elements.
    pub u: [Vec<f32>; 3],
    /// Limits of the links along x, y, z.
    pub limits: [LinkLimits; 3],
}

impl Body {
    /// Returns the body of a scene at rest.
    ///
    /// # Panics
    ///
    /// If the scene has several structures.
    pub fn at_rest(scene: &Scene, limits: &Limits) -> Self {
        assert_eq!(scene.structures.len(), 1, "the textbook knows one kind of tissue");
        Body {
            lattice: scene.lattice.clone(),
            u: std::array::from_fn(|_| vec![0.0; scene.lattice.element_count()]),
            limits: *limits.links(),
        }
    }

    /// Returns every element to its place at rest.
    pub fn return_to_rest(&mut self) {
        self.u.iter_mut().for_each(|c| c.fill(0.0));
    }

    /// Puts an element `at` elements from rest.
    pub fn put(&mut self, element: u32, at: [f32; 3]) {
        for (component, value) in self.u.iter_mut().zip(at) {
            component[element as usize] = value;
        }
    }

    /// Returns the largest violation of a limit over all links, in elements; zero if there is none.
    pub fn largest_violation(&self) -> f64 {
        let mut worst = 0.0_f64;
        for element in 0..self.lattice.element_count() as u32 {
            let around = self.lattice.neighbours(element);
            for (axis, l) in self.limits.iter().enumerate() {
                let Some(neighbour) = around[2 * axis + 1] else {
                    continue;
                };
                let d = [0, 1, 2].map(|c| f64::from(self.u[c][neighbour as usize] - self.u[c][element as usize]));
                let sides = (0..3).filter(|&c| c != axis).map(|c| d[c].abs());
                let shear = sides.fold(0.0, f64::max) - f64::from(l.tan) * (1.0 + d[axis]);
                worst = worst
                    .max(f64::from(l.low) - d[axis])
                    .max(d[axis] - f64::from(l.high))
                    .max(shear);
            }
        }
        worst
    }
}

/// Returns where the outer end of a link along one axis goes, given both ends with that axis first, and whether it had
/// to move; `UP`: the outer end is the upper one. A component that is within its limits keeps its bits.
#[inline(always)]
pub(super) fn outer_end<const UP: bool>(l: &LinkLimits, inner: [f32; 3], outer: [f32; 3]) -> ([f32; 3], bool) {
    let d = if UP { outer[0] - inner[0] } else { inner[0] - outer[0] };
    let along = clamp(d, l.low, l.high);
    let end = if UP { inner[0] + along } else { inner[0] - along };
    let shear = l.tan * (1.0 + along);
    let (b, b_moved) = beside(shear, inner[1], outer[1]);
    let (c, c_moved) = beside(shear, inner[2], outer[2]);
    let a_moved = d != along;
    let a = if a_moved { end } else { outer[0] };
    ([a, b, c], a_moved | b_moved | c_moved)
}

#[inline(always)]
fn beside(shear: f32, inner: f32, outer: f32) -> (f32, bool) {
    let d = outer - inner;
    let kept = clamp(d, -shear, shear);
    let moved = d != kept;
    (if moved { inner + kept } else { outer }, moved)
}

#[inline(always)]
fn clamp(value: f32, low: f32, high: f32) -> f32 {
    let value = if value > low { value } else { low };
    if value < high { value } else { high }
}

/// Components with that along `axis` first.
#[inline(always)]
pub(super) fn ordered<T>(axis: usize, [x, y, z]: [T; 3]) -> [T; 3] {
    match axis {
        0 => [x, y, z],
        1 => [y, x, z],
        _ => [z, x, y],
    }
}
