//! Motion of the body under hand and needle: the farthest element, and the target's centre.

use nalgebra::Vector3;
use stylet_sim::scene::{Role, Scene};
use stylet_sim::tissue::Deformed;

/// Most elements that the target's centre is averaged over.
const MOST_ELEMENTS: usize = 500;

/// Elements spread evenly over the target, or over the whole body if it has none.
pub struct TargetElements(Vec<u32>);

impl TargetElements {
    pub fn of(scene: &Scene) -> Self {
        let is_target = |element: &u32| {
            let structure = usize::from(scene.body.structure(*element));
            scene.structures.get(structure).is_some_and(|s| s.role == Role::Target)
        };
        let all = 0..scene.body.element_count() as u32;
        let mut elements: Vec<u32> = all.clone().filter(is_target).collect();
        if elements.is_empty() {
            elements = all.collect();
        }
        let every = elements.len().div_ceil(MOST_ELEMENTS).max(1);
        Self(elements.into_iter().step_by(every).collect())
    }
}

#[cfg(test)]
impl TargetElements {
    /// Mean displacement, m.
    pub fn mean_m(&self, body: Deformed<'_>) -> Vector3<f64> {
        let mut motion = Motion::new(self);
        motion.sum_m(body) / self.0.len().max(1) as f64
    }
}

/// The largest displacements so far.
pub struct Motion<'a> {
    elements: &'a [u32],
    displacements_m: Vec<[f32; 3]>,
    /// Sum over the target before the needle: needles that stay in have moved it.
    before_m: Vector3<f64>,
    pub largest_m: f64,
    pub target_m: f64,
}

impl<'a> Motion<'a> {
    pub fn new(target: &'a TargetElements) -> Self {
        Self {
            displacements_m: vec![[0.0; 3]; target.0.len()],
            elements: &target.0,
            before_m: Vector3::zeros(),
            largest_m: 0.0,
            target_m: 0.0,
        }
    }

    /// Takes the displacements after a tissue tick.
    pub fn look(&mut self, displacement_m: f64, body: Deformed<'_>) {
        self.largest_m = self.largest_m.max(displacement_m);
        let sum = self.sum_m(body) - self.before_m;
        self.target_m = self.target_m.max(sum.norm() / self.elements.len().max(1) as f64);
    }

    /// Sets the reference: the body before the needle.
    pub fn begin(&mut self, body: Deformed<'_>) {
        self.before_m = self.sum_m(body);
    }

    fn sum_m(&mut self, body: Deformed<'_>) -> Vector3<f64> {
        body.write_displacements(self.elements, &mut self.displacements_m);
        let each = self.displacements_m.iter();
        each.fold(Vector3::zeros(), |sum, d| sum + Vector3::from(d.map(f64::from)))
    }
}
