//! All that one step leaves to the next, as bytes: for flight recordings.

use super::model::ChainMail;
use super::state::TissueState;
use crate::tissue::parts;
use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};

const PARTS: usize = 18;

impl TissueState {
    /// Returns every part that a later step reads before it writes it.
    pub(super) fn memory(&self) -> [&[u8]; PARTS] {
        let [x, y, z] = &self.u;
        let [a, b, c] = self.active.memory();
        let [d, e, f] = self.next.memory();
        let [g, h, i] = self.moved.memory();
        [
            cast_slice(x),
            cast_slice(y),
            cast_slice(z),
            bytes_of(&self.scale),
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            i,
            cast_slice(&self.run_square),
            cast_slice(&self.plane_square),
            bytes_of(&self.max_displacement),
            bytes_of(&self.settled),
            bytes_of(&self.residual),
        ]
    }

    /// Returns the same parts, in the same order.
    fn memory_mut(&mut self) -> [&mut [u8]; PARTS] {
        let [x, y, z] = &mut self.u;
        let [a, b, c] = self.active.memory_mut();
        let [d, e, f] = self.next.memory_mut();
        let [g, h, i] = self.moved.memory_mut();
        [
            cast_slice_mut(x),
            cast_slice_mut(y),
            cast_slice_mut(z),
            bytes_of_mut(&mut self.scale),
            a,
            b,
            c,
            d,
            e,
            f,
            g,
            h,
            i,
            cast_slice_mut(&mut self.run_square),
            cast_slice_mut(&mut self.plane_square),
            bytes_of_mut(&mut self.max_displacement),
            bytes_of_mut(&mut self.settled),
            bytes_of_mut(&mut self.residual),
        ]
    }

    pub(super) fn memory_len(&self) -> usize {
        parts::len(&self.memory())
    }

    pub(super) fn save(&self, to: &mut [u8]) {
        parts::save(&self.memory(), to);
    }

    /// Stretches that are not of this body would be followed out of it: such a memory leaves the body at rest.
    pub(super) fn load(&mut self, model: &ChainMail, from: &[u8]) {
        if !parts::load(&mut self.memory_mut(), from) {
            return;
        }
        let sets = [&self.active, &self.next, &self.moved];
        if !sets.iter().all(|set| set.is_of(&model.rows, model.lattice.dims)) {
            *self = Self::at_rest(model);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::limits::TissueParameters;
    use crate::scene::Scene;
    use crate::tissue::{ChainMailTissue, Held, TissueModel};

    #[test]
    fn a_body_goes_on_from_its_memory_bit_for_bit() {
        let scene = Scene::builtin("paper").unwrap();
        let limits = TissueParameters::default().validate().unwrap();
        let mut first = ChainMailTissue::new(&scene, limits.clone());
        let element = scene.lattice.element_of_cell(53, 31, 80).unwrap();
        let rest_m = scene.lattice.rest_m(element);
        let held = |n: usize| Held {
            element,
            position_m: [rest_m[0] + 1e-4 * n as f64, rest_m[1], rest_m[2] + 3e-4 * n as f64],
            patch_m: 0.0,
        };
        for n in 0..20 {
            first.step(Some(held(n)), 5e-3);
        }
        let mut memory = vec![0; first.memory_len()];
        first.save(&mut memory);
        let mut second = ChainMailTissue::new(&scene, limits);
        second.load(&memory);
        for n in 20..40 {
            let grip = (n % 7 != 0).then(|| held(n));
            assert_eq!(first.step(grip, 5e-3), second.step(grip, 5e-3), "step {n}");
        }
        let (a, b) = (first.deformed(), second.deformed());
        let places = |body: &crate::tissue::Deformed<'_>, e: u32| body.displacement(e).map(f64::to_bits);
        assert!((0..scene.lattice.element_count() as u32).all(|e| places(&a, e) == places(&b, e)));
    }

    #[test]
    fn a_memory_that_is_not_of_this_body_is_not_followed() {
        let scene = Scene::builtin("paper").unwrap();
        let limits = TissueParameters::default().validate().unwrap();
        let mut body = ChainMailTissue::new(&scene, limits);
        // Stretches of one element each, none of them in its own run.
        let words: Vec<u32> = (0..body.memory_len() as u32 / 4).collect();
        let invalid: &[u8] = bytemuck::cast_slice(&words);
        body.load(invalid);
        assert!(body.step(None, 5e-3).converged);
        body.load(&invalid[4..]);
        assert!(body.step(None, 5e-3).converged);
    }
}
